"""`skyway fleet`: many simulated drones in one agent process."""

import json
from itertools import cycle, islice
from typing import Annotated, Any, Final

import typer

from skyway.cli.data_folder import DataFolder, data_folder
from skyway.cli.drones.agent_options import (
    AbsentOption,
    ChargeTimeOption,
    FileArgument,
    FlightEnergyOption,
    FlightTimeOption,
    ScenarioOption,
    SeedOption,
    agent_arguments,
)
from skyway.cli.drones.agent_process import Drones, fly, read_drones, write_drones
from skyway.cli.gateway import call_gateway, fail
from skyway.cli.system.up import DataOption

_OPERATOR_KEY: Final = "SKYWAY_OPERATOR_KEY"

#: The gateway answers lists in pages of at most this many.
_PAGE: Final = 200


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
    disturbed = agent_arguments(
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
        fly(folder, read_drones(file), disturbed)
    if drones is None:
        fail("give FILE, or --drones N, or both")
    homes = home or _all_stations(folder)
    owner = provider_id or _new_provider(folder)
    hosted = _register(folder, owner, model_id, list(islice(cycle(homes), drones)))
    if file is not None:
        write_drones(file, hosted)
    fly(folder, hosted, disturbed)


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


def _register(folder: DataFolder, provider_id: str, model_id: str, homes: list[str]) -> Drones:
    body = [{"model_id": model_id, "home_station_id": station} for station in homes]
    answer = _operate(folder, "POST", f"/v1/providers/{provider_id}/drones", body)
    registered: Drones = answer["items"]
    typer.echo(f"{len(registered)} drones registered with provider {provider_id}", err=True)
    return registered


def _operate(folder: DataFolder, method: str, path: str, body: object = None) -> Any:
    """One call with the operator's key; its answer is whatever JSON the route documents."""
    encoded = None if body is None else json.dumps(body).encode()
    return call_gateway(method, path, key_name=_OPERATOR_KEY, folder=folder, body=encoded)
