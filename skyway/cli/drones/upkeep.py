"""`skyway battery` and `skyway maintenance`: which battery a drone has, and when it is due."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Any, Final
from urllib.parse import quote

import typer

from skyway.cli.data_folder import DataFolder, DataOption, data_folder
from skyway.cli.gateway import call_gateway, list_items
from skyway.cli.providers import ProviderOption, drone_words, provider_path

battery_app: Final = typer.Typer(
    help="Register batteries, and note which drone each is in.", no_args_is_help=True
)
maintenance_app: Final = typer.Typer(
    help="Set when drones are due for maintenance, list those that are, record what was done.",
    no_args_is_help=True,
)

#: The options of the fields that the gateway may refuse.
_OPTIONS: Final = MappingProxyType(
    {
        "model_id": "--model",
        "capacity_j": "--capacity-j",
        "every_flight_hours": "--hours",
        "every_cycles": "--cycles",
    }
)

_JsonOption = Annotated[bool, typer.Option("--json", help="Print the gateway's answer as JSON.")]
_BatteryArgument = Annotated[str, typer.Argument(metavar="BATTERY", help="Id of the battery.")]
_DroneArgument = Annotated[str, typer.Argument(metavar="DRONE", help="Id of the drone.")]
_ModelArgument = Annotated[str, typer.Argument(metavar="MODEL", help="Id of the drone model.")]

#: A JSON object of the gateway, whose members have no common type.
_Document = dict[str, Any]


@battery_app.command("list")
def list_batteries(
    provider: ProviderOption = None, as_json: _JsonOption = False, data: DataOption = None
) -> None:
    """List the batteries: the drone that each is in, its cycles and its health."""
    batteries = [*_fleet(provider, data).items("/batteries")]
    if as_json:
        typer.echo(json.dumps(batteries, indent=2))
        return
    for each in batteries:
        typer.echo(_battery_line(each))
    if not batteries:
        typer.echo("no batteries")


@battery_app.command("show")
def show_battery(
    battery: _BatteryArgument,
    provider: ProviderOption = None,
    as_json: _JsonOption = False,
    data: DataOption = None,
) -> None:
    """Show a battery, and the drones that it was in before, the newest first."""
    found = _fleet(provider, data).call("GET", f"/batteries/{_part(battery)}")
    if as_json:
        typer.echo(json.dumps(found, indent=2))
        return
    typer.echo(_battery_line(found))
    for each in found["past_installations"]:
        span = f"{each['installed_at']} to {each['removed_at']}"
        typer.echo(f"  {each['drone_id']}  {span}  {each['cycles']:.1f} cycles")


@battery_app.command("register")
def register_battery(
    serial: Annotated[str, typer.Argument(help="The serial number on the battery.")],
    model: Annotated[str, typer.Option("--model", help="The model of the drones that it fits.")],
    capacity_j: Annotated[
        float | None,
        typer.Option(
            "--capacity-j", help="Its usable energy in joules; without it, that of the model."
        ),
    ] = None,
    provider: ProviderOption = None,
    data: DataOption = None,
) -> None:
    """Register a battery that is in no drone, and print it."""
    body = {"serial": serial, "model_id": model, "capacity_j": capacity_j}
    typer.echo(_battery_line(_fleet(provider, data).call("POST", "/batteries", body)))


@battery_app.command("install")
def install_battery(
    drone: _DroneArgument,
    battery: _BatteryArgument,
    provider: ProviderOption = None,
    data: DataOption = None,
) -> None:
    """Note that a drone has this battery now; its battery from before is in no drone."""
    path, body = f"/drones/{_part(drone)}/battery", {"battery_id": battery}
    typer.echo(_installation_line(_fleet(provider, data).call("PUT", path, body)))


@battery_app.command("remove")
def remove_battery(
    drone: _DroneArgument, provider: ProviderOption = None, data: DataOption = None
) -> None:
    """Note that a drone does not have its registered battery any more."""
    path = f"/drones/{_part(drone)}/battery"
    typer.echo(_installation_line(_fleet(provider, data).call("DELETE", path)))


@battery_app.command("delete")
def delete_battery(
    battery: _BatteryArgument, provider: ProviderOption = None, data: DataOption = None
) -> None:
    """Delete a battery that is in no drone."""
    _fleet(provider, data).call("DELETE", f"/batteries/{_part(battery)}")
    typer.echo(f"{battery} is deleted")


@maintenance_app.command("list")
def list_maintenance(
    due: Annotated[bool, typer.Option("--due", help="Only the drones that are due.")] = False,
    provider: ProviderOption = None,
    as_json: _JsonOption = False,
    data: DataOption = None,
) -> None:
    """List what each drone has flown since its last maintenance, and which drones are due."""
    drones = [
        each
        for each in _fleet(provider, data).items("/drones")
        if not due or each["maintenance"]["due_since_at"] is not None
    ]
    if as_json:
        fields = ("drone_id", "name", "model_id", "maintenance")
        typer.echo(json.dumps([{name: each[name] for name in fields} for each in drones], indent=2))
        return
    for each in drones:
        typer.echo(_maintenance_line(each))
    if not drones:
        typer.echo("no drone is due" if due else "no drones")


@maintenance_app.command("rules")
def list_rules(
    provider: ProviderOption = None, as_json: _JsonOption = False, data: DataOption = None
) -> None:
    """List the rules: after how much flying the drones of each model are due."""
    rules = _fleet(provider, data).call("GET", "/maintenance-rules")["items"]
    if as_json:
        typer.echo(json.dumps(rules, indent=2))
        return
    for each in rules:
        typer.echo(_rule_line(each))
    if not rules:
        typer.echo("no rules: no drone is due")


@maintenance_app.command("rule")
def set_rule(
    model: _ModelArgument,
    hours: Annotated[
        float | None, typer.Option("--hours", help="Due after this many hours in the air.")
    ] = None,
    cycles: Annotated[
        float | None, typer.Option("--cycles", help="Due after this many full charges.")
    ] = None,
    remove: Annotated[
        bool, typer.Option("--remove", help="Remove the rule; no drone of the model is due.")
    ] = False,
    provider: ProviderOption = None,
    data: DataOption = None,
) -> None:
    """Set or remove the rule for a model; the limit that is reached first counts."""
    has_limit = hours is not None or cycles is not None
    if has_limit == remove:
        raise typer.BadParameter("give --hours, --cycles or both, or only --remove")
    fleet, path = _fleet(provider, data), f"/maintenance-rules/{_part(model)}"
    if remove:
        fleet.call("DELETE", path)
        typer.echo(f"{model}: no rule")
        return
    rule = {"every_flight_hours": hours, "every_cycles": cycles}
    typer.echo(_rule_line(fleet.call("PUT", path, rule)))


@maintenance_app.command("done")
def record_maintenance(
    drone: _DroneArgument, provider: ProviderOption = None, data: DataOption = None
) -> None:
    """Record that the maintenance of a drone was done: its counters begin at 0 again."""
    path = f"/drones/{_part(drone)}/maintenance"
    typer.echo(_maintenance_line(_fleet(provider, data).call("POST", path)))


@dataclass(frozen=True, slots=True)
class _Fleet:
    """The calls about the fleet of one provider."""

    folder: DataFolder
    path: str

    def call(self, method: str, below: str, body: Mapping[str, Any] | None = None) -> Any:
        """The gateway's answer; Any: the route documents its JSON."""
        encoded = None if body is None else json.dumps(body).encode()
        return call_gateway(
            method,
            self.path + below,
            folder=self.folder,
            body=encoded,
            options=_OPTIONS,
        )

    def items(self, below: str) -> Iterator[_Document]:
        """All items of a list."""
        return list_items(self.folder, self.path + below)


def _fleet(provider: str | None, data: DataOption) -> _Fleet:
    folder = data_folder(data)
    return _Fleet(folder, provider_path(folder, provider))


def _part(identifier: str) -> str:
    return quote(identifier, safe="")


def _battery_line(battery: _Document) -> str:
    drone = battery["drone_id"]
    place = "in no drone" if drone is None else f"in {drone} since {battery['installed_at']}"
    return (
        f"{battery['battery_id']}  {battery['serial']}  {battery['model_id']}  {place}  "
        f"{battery['cycles']:.1f} cycles  health {battery['state_of_health']:.0%}"
    )


def _installation_line(drone: _Document) -> str:
    battery = drone["battery_id"]
    return f"{drone_words(drone)} has {battery or 'no registered battery'}"


def _maintenance_line(drone: _Document) -> str:
    wear = drone["maintenance"]
    since = wear["maintained_at"] or "its registration"
    due = wear["due_since_at"]
    line = (
        f"{drone_words(drone)}  {drone['model_id']}  {wear['flight_hours']:.1f} h in the air and "
        f"{wear['cycles']:.1f} cycles since {since}"
    )
    return line if due is None else f"{line}, due since {due}"


def _rule_line(rule: _Document) -> str:
    limits = (
        (rule["every_flight_hours"], "h in the air"),
        (rule["every_cycles"], "cycles"),
    )
    words = " or ".join(f"{limit:g} {unit}" for limit, unit in limits if limit is not None)
    return f"{rule['model_id']}: due every {words}"
