"""`skyway fleet`: many simulated drones in one agent process."""

import json
import os
from collections.abc import Iterable
from enum import StrEnum
from itertools import cycle, islice
from pathlib import Path
from typing import Annotated, Any, Final
from urllib.parse import quote

import typer

from skyway.cli.data_folder import DataFolder, DataOption, data_folder
from skyway.cli.drones.agent_process import (
    AbsentOption,
    ChargeTimeOption,
    Drones,
    FileArgument,
    FlightEnergyOption,
    FlightTimeOption,
    ScenarioOption,
    SeedOption,
    agent_arguments,
    check_agent_arguments,
    fly,
    read_drones,
    write_drones,
)
from skyway.cli.gateway import call_gateway, chosen_key, fail, list_items, read_keys
from skyway.cli.providers import provider_path


class StandbyName(StrEnum):
    """`skyway.contracts.candidate.Standby`, which would make the start of every command slow."""

    HOME = "HOME"
    STAY = "STAY"
    PARKING = "PARKING"
    NEXT_PICKUP = "NEXT_PICKUP"


def fleet_command(
    file: FileArgument = None,
    drones: Annotated[
        int | None, typer.Option(min=1, max=5_000, help="Register this many new drones.")
    ] = None,
    model_id: Annotated[
        str, typer.Option("--model", help="With --drones: their drone model.")
    ] = "dji-matrice-300-rtk",
    home: Annotated[
        list[str] | None,
        typer.Option(
            help="With --drones: a home station; repeat it, and the drones take turns."
            " Without it: all stations of the first network."
        ),
    ] = None,
    provider: Annotated[
        str | None,
        typer.Option(
            metavar="ID",
            help="With --drones: their provider, by id or by name. Without it the provider of the"
            " key, or, with an operator's key, a new one.",
        ),
    ] = None,
    standby: Annotated[
        StandbyName | None,
        typer.Option(
            help="With --drones: where they go when they are idle. Without it, their provider's"
            " choice counts.",
        ),
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

    With both FILE and --drones, the drones are registered once and stored in FILE.
    """
    folder = data_folder(data)
    arguments = agent_arguments(
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
        fly(folder, read_drones(file), arguments)
    if drones is None:
        fail("give FILE, or --drones N, or both")
    # All checks come first: a provider that is registered cannot be removed again.
    check_agent_arguments(folder, arguments)
    if file is not None:
        _must_be_writable(file)
    _operate(folder, "GET", f"/v1/drone-models/{quote(model_id, safe='')}")
    if home:
        _must_exist(folder, home)
    homes = home or _all_stations(folder)
    new_drones = [
        {"model_id": model_id, "home_station_id": station, "name": f"{station} {number}"}
        | ({} if standby is None else {"standby": standby.value})
        for number, station in enumerate(islice(cycle(homes), drones), start=1)
    ]
    hosted = _register(folder, _provider(folder, provider), new_drones)
    if file is not None:
        write_drones(file, hosted)
    fly(folder, hosted, arguments)


def _must_be_writable(file: Path) -> None:
    """End the command when FILE cannot be written."""
    if not os.access(file.parent, os.W_OK):
        fail(f"{file} cannot be written: there is no writable folder {file.parent}")


def _must_exist(folder: DataFolder, station_ids: Iterable[str]) -> None:
    """End the command when one of these stations does not exist."""
    for station_id in dict.fromkeys(station_ids):
        _operate(folder, "GET", f"/v1/stations/{quote(station_id, safe='')}/pads")


def _all_stations(folder: DataFolder) -> list[str]:
    """The stations of the first network."""
    networks = _operate(folder, "GET", "/v1/networks")["items"]
    if not networks:
        fail("no network is published: skyway network import bundled")
    path = f"/v1/networks/{networks[0]['network_id']}/stations"
    return [each["station_id"] for each in list_items(folder, path)]


#: Printed when the drones of a new provider were refused.
_LEFT_BEHIND: Final = (
    "the new provider {owner} has no drones, and is suspended; providers cannot be deleted.\n"
    "To use it for the next try, set its state with "
    'PATCH /v1/providers/{owner} {{"state": "ACTIVE"}}, and add --provider {owner}'
)


def _register(folder: DataFolder, provider: str | None, new_drones: list[dict[str, str]]) -> Drones:
    """Register the drones with the provider of this path, or with a new provider.

    A new provider whose drones are refused is suspended, because it cannot fly. It stays: the API
    deletes no providers, so the message says how to use it.
    """
    from skyway.runtime.signing.key_pair import FleetKeys  # other commands start without it

    keys = FleetKeys(new_drones)
    owner = provider or f"/v1/providers/{_new_provider(folder)}"
    try:
        path = f"{owner}/drones"
        answers = [_operate(folder, "POST", path, batch) for batch in keys.batches()]
    except typer.Exit:
        if provider is None:
            _operate(folder, "PATCH", owner, {"state": "SUSPENDED"})
            typer.echo(_LEFT_BEHIND.format(owner=_id(owner)), err=True)
        raise
    registered = keys.kept([drone for answer in answers for drone in answer["items"]])
    typer.echo(f"{len(registered)} drones registered with provider {_id(owner)}", err=True)
    return registered


def _id(provider_path: str) -> str:
    return provider_path.rpartition("/")[2]


def _provider(folder: DataFolder, named: str | None) -> str | None:
    """The path of the drones' provider; None for a new one, which only an operator can register."""
    is_operator = chosen_key(read_keys(folder)) == "SKYWAY_OPERATOR_KEY"
    return None if named is None and is_operator else provider_path(folder, named)


def _new_provider(folder: DataFolder) -> str:
    body = {"name": "Simulated fleet", "tariff": {"currency": "USD", "base": 500, "per_km": 20}}
    return str(_operate(folder, "POST", "/v1/providers", body)["provider_id"])


def _operate(folder: DataFolder, method: str, path: str, body: object = None) -> Any:
    """One call; Any: the route documents the answer's JSON."""
    encoded = None if body is None else json.dumps(body).encode()
    return call_gateway(method, path, folder=folder, body=encoded)
