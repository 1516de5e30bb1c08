"""`skyway drone` and `skyway fleet`: agent processes against a running Skyway."""

import json
import os
from itertools import cycle, islice
from pathlib import Path
from typing import Annotated, Any, NoReturn, TypeGuard

import typer

from skyway.cli.agent_process import become_agent
from skyway.cli.data_folder import DataFolder, data_folder
from skyway.cli.gateway import call_gateway, fail
from skyway.cli.up import DataOption

_OPERATOR_KEY = "SKYWAY_OPERATOR_KEY"

#: The gateway answers lists in pages of at most this many.
_PAGE = 200

FileArgument = Annotated[
    Path | None,
    typer.Argument(metavar="[FILE]", help="The answer of POST /v1/providers/{id}/drones."),
]

_ENROLMENT = "Enrolment"

EnrolOption = Annotated[
    str | None,
    typer.Option(
        metavar="TOKEN",
        envvar="SKYWAY_ENROLMENT_TOKEN",
        show_envvar=True,
        help="Exchange this token for the drone's credentials, once.",
        rich_help_panel=_ENROLMENT,
    ),
]

ApiOption = Annotated[
    str | None,
    typer.Option(help="Where; else SKYWAY_GATEWAY_URL.", rich_help_panel=_ENROLMENT),
]

RotateOption = Annotated[
    bool,
    typer.Option(
        "--rotate", help="Change its credentials before it flies.", rich_help_panel=_ENROLMENT
    ),
]

_DISTURBED = "What goes otherwise than planned"

ScenarioOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME|FILE",
        help="A day with its wind and faults: calm, windy, stormy, ... or a file.",
        rich_help_panel=_DISTURBED,
    ),
]

SeedOption = Annotated[
    int | None,
    typer.Option(
        min=0, help="Which of the scenario's many days it is.", rich_help_panel=_DISTURBED
    ),
]

FlightTimeOption = Annotated[
    float | None,
    typer.Option(help="Flights take so many times as long.", rich_help_panel=_DISTURBED),
]

FlightEnergyOption = Annotated[
    float | None,
    typer.Option(help="Flights take so many times the energy.", rich_help_panel=_DISTURBED),
]

ChargeTimeOption = Annotated[
    float | None,
    typer.Option(help="Recharges take so many times as long.", rich_help_panel=_DISTURBED),
]

AbsentOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="STATION",
        help="Nobody is there to take packages; may be given again.",
        rich_help_panel=_DISTURBED,
    ),
]

_REAL = "A real drone (docs/mavlink.md)"

VehicleOption = Annotated[
    str | None,
    typer.Option(
        metavar="mavlink:ADDRESS",
        help="Its autopilot: mavlink:udpin:127.0.0.1:14550.",
        rich_help_panel=_REAL,
    ),
]

PayloadOption = Annotated[
    str | None,
    typer.Option(
        metavar="RELEASE",
        help="What lets go: gripper:NUMBER or servo:NUMBER:MICROSECONDS.",
        rich_help_panel=_REAL,
    ),
]

AltitudeOption = Annotated[
    float | None, typer.Option(help="Metres above the take-off.", rich_help_panel=_REAL)
]


def drone_command(
    file: FileArgument = None,
    drone_id: Annotated[str | None, typer.Option(help="Which one, when there are many.")] = None,
    enrol: EnrolOption = None,
    api: ApiOption = None,
    rotate: RotateOption = False,
    scenario: ScenarioOption = None,
    seed: SeedOption = None,
    flight_time_factor: FlightTimeOption = None,
    flight_energy_factor: FlightEnergyOption = None,
    charge_time_factor: ChargeTimeOption = None,
    absent_station: AbsentOption = None,
    vehicle: VehicleOption = None,
    payload: PayloadOption = None,
    altitude_m: AltitudeOption = None,
    data: DataOption = None,
) -> None:
    """Run the agent of one drone until Ctrl-C.

    Without FILE it is the drone that enrolled here before, or enrols now with a token.
    """
    arguments = _arguments(
        {
            "scenario": scenario,
            "seed": seed,
            "flight-time-factor": flight_time_factor,
            "flight-energy-factor": flight_energy_factor,
            "charge-time-factor": charge_time_factor,
            "vehicle": vehicle,
            "payload": payload,
            "altitude-m": altitude_m,
        },
        absent_station,
    )
    if file is None:
        _run_enrolled(data_folder(data), enrol, arguments + _wishes(drone_id, api, rotate))
    if enrol is not None or rotate:
        fail("--enrol and --rotate are for a drone without FILE")
    chosen = [drone for drone in _read(file) if drone_id in (None, drone["drone_id"])]
    if len(chosen) != 1:
        fail(f"{file} holds {len(chosen)} drones to choose from: name one with --drone-id")
    _run_agent(data_folder(data), chosen, arguments)


def fleet_command(
    file: FileArgument = None,
    drones: Annotated[
        int | None, typer.Option(min=1, max=5_000, help="Register this many ourselves.")
    ] = None,
    model_id: Annotated[
        str, typer.Option("--model", help="With --drones: their model.")
    ] = "paper-scenario",
    home: Annotated[
        list[str] | None, typer.Option(help="With --drones: home stations, taken in turn.")
    ] = None,
    provider_id: Annotated[
        str | None, typer.Option(help="With --drones: whose; a new provider if not given.")
    ] = None,
    scenario: ScenarioOption = None,
    seed: SeedOption = None,
    flight_time_factor: FlightTimeOption = None,
    flight_energy_factor: FlightEnergyOption = None,
    charge_time_factor: ChargeTimeOption = None,
    absent_station: AbsentOption = None,
    data: DataOption = None,
) -> None:
    """Run many simulated drones in one agent process until Ctrl-C.

    With FILE and --drones both, the drones are registered once and remembered in FILE.
    """
    folder = data_folder(data)
    disturbed = _arguments(
        {
            "scenario": scenario,
            "seed": seed,
            "flight-time-factor": flight_time_factor,
            "flight-energy-factor": flight_energy_factor,
            "charge-time-factor": charge_time_factor,
        },
        absent_station,
    )
    if file is not None and (drones is None or file.exists()):
        _run_agent(folder, _read(file), disturbed)
    if drones is None:
        fail("give FILE, or --drones N, or both")
    homes = home or _all_stations(folder)
    owner = provider_id or _new_provider(folder)
    hosted = _register(folder, owner, model_id, list(islice(cycle(homes), drones)))
    if file is not None:
        _write(file, hosted)
    _run_agent(folder, hosted, disturbed)


def _read(file: Path) -> list[dict[str, Any]]:  # drones as the registry answers them
    try:
        content = json.loads(file.read_text())
    except (OSError, ValueError) as error:
        fail(f"{file} cannot be read: {error}")
    if isinstance(content, dict):
        content = content.get("items", [content])
    if not _are_drones(content):
        fail(f"{file} is not the answer of POST /v1/providers/{{id}}/drones")
    return content


def _are_drones(content: object) -> TypeGuard[list[dict[str, Any]]]:
    return (
        isinstance(content, list)
        and len(content) > 0
        and all(isinstance(drone, dict) and "drone_id" in drone for drone in content)
    )


def _all_stations(folder: DataFolder) -> list[str]:
    networks = _operate(folder, "GET", "/v1/networks")["items"]
    if not networks:
        fail("there is no network yet: skyway network import bundled --network-id texas")
    path = f"/v1/networks/{networks[0]['network_id']}/stations?limit={_PAGE}"
    stations: list[str] = []
    cursor: str | None = ""
    while cursor is not None:
        page = _operate(folder, "GET", path + (f"&cursor={cursor}" if cursor else ""))
        stations += [item["station_id"] for item in page["items"]]
        cursor = page["next_cursor"]
    return stations


def _new_provider(folder: DataFolder) -> str:
    body = {"name": "Simulated fleet", "tariff": {"currency": "USD", "base": 500, "per_km": 20}}
    return str(_operate(folder, "POST", "/v1/providers", body)["provider_id"])


def _register(
    folder: DataFolder, provider_id: str, model_id: str, homes: list[str]
) -> list[dict[str, Any]]:
    body = [{"model_id": model_id, "home_station_id": station} for station in homes]
    answer = _operate(folder, "POST", f"/v1/providers/{provider_id}/drones", body)
    registered: list[dict[str, Any]] = answer["items"]
    typer.echo(f"{len(registered)} drones registered with provider {provider_id}", err=True)
    return registered


def _operate(folder: DataFolder, method: str, path: str, body: object = None) -> Any:
    """One call with the operator's key; its answer is whatever JSON the route documents."""
    encoded = None if body is None else json.dumps(body).encode()
    return call_gateway(method, path, key_name=_OPERATOR_KEY, folder=folder, body=encoded)


def _write(file: Path, drones: list[dict[str, Any]]) -> None:
    """Write drones with their broker passwords, for this user's eyes only."""
    descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(descriptor, "w") as output:
        json.dump({"items": drones}, output)


def _arguments(options: dict[str, object], absent: list[str] | None) -> list[str]:
    """Options as the agent's arguments; what is not given is left to it and the scenario."""
    given = [f"--{name}={value}" for name, value in options.items() if value is not None]
    return given + [f"--absent-station={station}" for station in absent or ()]


def _wishes(drone_id: str | None, api: str | None, rotate: bool) -> list[str]:
    """What is wanted of an enrolled drone, as the agent's arguments."""
    named = {"--drone-id": drone_id, "--api": api}
    arguments = [f"{option}={value}" for option, value in named.items() if value is not None]
    return arguments + (["--rotate"] if rotate else [])


def _run_enrolled(folder: DataFolder, token: str | None, arguments: list[str]) -> NoReturn:
    """Become the agent of drones that enrolled with this data folder."""
    told = {} if token is None else {"SKYWAY_ENROLMENT_TOKEN": token}
    become_agent(folder, arguments, told=told)


def _run_agent(folder: DataFolder, drones: list[dict[str, Any]], arguments: list[str]) -> NoReturn:
    """Become the agent of these drones."""
    folder.make()
    fleet_file = folder.path / f"fleet-{drones[0]['drone_id']}.json"
    _write(fleet_file, drones)
    typer.echo(f"{len(drones)} drones fly until Ctrl-C", err=True)
    become_agent(folder, ["--fleet", str(fleet_file), *arguments])
