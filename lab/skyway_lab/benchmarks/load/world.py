"""The city's people: providers with their fleets in the air, customers with their keys."""

import asyncio
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from skyway_lab.benchmarks.load.burst import Burst
from skyway_lab.benchmarks.load.city import Place

from skyway.cli.gateway import GatewayApi
from skyway.cli.system.niceness import SIMULATES
from skyway.cli.system.running_system import System
from skyway.errors import SkywayError
from skyway.runtime.signing.key_pair import FleetKeys

_CUSTOMERS: Final = 5
#: Wall seconds until all drones must be known to stand ready; a start takes about 5 ms a drone.
_READY_WITHIN_S: Final = 240.0


@dataclass(frozen=True, slots=True)
class Customer:
    """Who asks for deliveries, over REST with a key and over MQTT with an account."""

    name: str
    key: str
    mqtt_user_name: str
    mqtt_password: str


@dataclass(frozen=True, slots=True)
class World:
    """Who is there once all drones stand ready."""

    customers: tuple[Customer, ...]
    agents: tuple[str, ...]  # names of processes


async def populate(
    system: System, api: GatewayApi, city: Place, *, operator_key: str, burst: Burst
) -> World:
    """Publish the city, register everybody through the gateway, and start the drones."""

    async def operate(method: str, path: str, body: object = None) -> Any:  # the route's JSON
        return await api.call(method, path, key=operator_key, body=body)

    for network_id, document in city.documents().items():
        await operate("PUT", f"/v1/networks/{network_id}", document)
    drones: list[dict[str, Any]] = []
    for number in range(burst.providers):
        terms = {"name": f"Provider {number}", "tariff": city.tariff(number)}
        provider_id = (await operate("POST", "/v1/providers", terms))["provider_id"]
        fleet = city.fleet(number, providers=burst.providers, drones=burst.drones)
        own = FleetKeys(fleet)
        path, registered = f"/v1/providers/{provider_id}/drones", []
        for batch in own.batches():
            registered += (await operate("POST", path, batch))["items"]
        drones += own.kept(registered)
    customers = [
        _customer(await operate("POST", "/v1/keys", {"role": "customer", "subject_id": f"c{n}"}))
        for n in range(_CUSTOMERS)
    ]
    agents = _start_agents(system, drones, processes=burst.agents)
    await _until_ready(api, operator_key, len(drones))
    return World(tuple(customers), agents)


async def start_again(
    system: System, api: GatewayApi, world: World, *, operator_key: str, ready: int
) -> None:
    """Start the agents of a world in a system that was stopped, until so many drones are ready."""
    for number, name in enumerate(world.agents):
        system.start_fleet(name, _fleet_file(system, number), gives_way_by=SIMULATES)
    await _until_ready(api, operator_key, ready)


def _fleet_file(system: System, number: int) -> Path:
    return system.folder.path / f"fleet-{number}.json"


async def _until_ready(api: GatewayApi, operator_key: str, drones: int) -> None:
    try:
        async with asyncio.timeout(_READY_WITHIN_S):
            await _until_available(api, operator_key, drones)
    except TimeoutError as error:
        raise SkywayError(f"not all drones were ready within {_READY_WITHIN_S:g} s") from error


def _start_agents(
    system: System, drones: Sequence[dict[str, Any]], *, processes: int
) -> tuple[str, ...]:
    names = tuple(f"agent {number}" for number in range(processes))
    for number, name in enumerate(names):
        file = _fleet_file(system, number)
        file.touch(mode=0o600)
        file.write_text(json.dumps({"items": drones[number::processes]}))
        system.start_fleet(name, file, gives_way_by=SIMULATES)
    return names


async def _until_available(api: GatewayApi, operator_key: str, drones: int) -> None:
    """Wait until the registry shows so many drones as AVAILABLE."""
    while True:
        fleets = await api.call("GET", "/v1/stats/fleets", key=operator_key)
        if fleets["by_state"].get("AVAILABLE", 0) >= drones:
            return
        await asyncio.sleep(1.0)  # asked of another process: there is nothing to wait on


def _customer(issued: dict[str, Any]) -> Customer:
    account = issued["mqtt"]
    return Customer(
        name=issued["subject_id"],
        key=issued["key"],
        mqtt_user_name=account["user_name"],
        mqtt_password=account["password"],
    )
