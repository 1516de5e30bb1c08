"""Two replicas of every service: one registry is killed, and the other one goes on."""

import json
import os
import signal
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import pytest
from skyway_lab.benchmarks.load.burst import Burst
from skyway_lab.benchmarks.load.city import City
from skyway_lab.benchmarks.load.run import verify
from skyway_lab.benchmarks.load.storage_pair import storage_pair
from skyway_lab.benchmarks.load.world import populate

from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import GatewayApi, read_keys
from skyway.cli.system.children import Ports
from skyway.cli.system.running_system import System, running_system
from skyway.runtime.signing.key_pair import FleetKeys
from tests.end_to_end.eventually import LONGEST_WAIT_S, asked_until
from tests.end_to_end.local_system import TERMINAL

pytestmark = [pytest.mark.end_to_end, pytest.mark.long, pytest.mark.integration]

WORLD = Burst(
    storage="production",
    stations=20,
    drones=6,
    providers=1,
    rate_per_s=1.0,
    seconds=1.0,
    clock_rate=300.0,
    agents=1,
    longest_wait_s=LONGEST_WAIT_S,
    seed=1,
)


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[DataFolder]:
    made = DataFolder(tmp_path / "data")
    made.make()
    with storage_pair("production", made):
        yield made


async def until_ready(api: GatewayApi, key: str, drones: int) -> None:
    async def are_ready() -> bool:
        fleets = await api.call("GET", "/v1/stats/fleets", key=key)
        return bool(fleets["by_state"].get("AVAILABLE", 0) >= drones)

    await asked_until(are_ready)


async def start_new_drone(system: System, api: GatewayApi, key: str, city: City) -> None:
    """Register a provider with one drone, and start the agent of the drone."""
    terms = {"name": "Late Air", "tariff": city.tariff(1)}
    provider_id = (await api.call("POST", "/v1/providers", key=key, body=terms))["provider_id"]
    own = FleetKeys(city.fleet(0, providers=1, drones=1))
    path = f"/v1/providers/{provider_id}/drones"
    answer = await api.call("POST", path, key=key, body=own.bodies)
    file = system.folder.path / "late.json"
    file.write_text(json.dumps({"items": own.kept(answer["items"])}))
    system.start_fleet("late agent", file)


async def until_over(api: GatewayApi, key: str, delivery_ids: list[str]) -> list[str]:
    """The states of these deliveries when all are over."""

    async def final_states() -> list[str] | None:
        states = [
            (await api.call("GET", f"/v1/deliveries/{each}", key=key))["state"]
            for each in delivery_ids
        ]
        return states if all(state in TERMINAL for state in states) else None

    final: list[str] = await asked_until(final_states)
    return final


async def test_deliveries_and_new_drones_go_on_while_a_registry_is_killed(
    folder: DataFolder,
) -> None:
    city = City.of(stations=WORLD.stations, seed=WORLD.seed)
    ports, said = Ports(gateway=0, broker=0), list[str]()
    async with running_system(
        folder, rate=WORLD.clock_rate, ports=ports, say=said.append, replicas=2
    ) as system:
        key = read_keys(folder)["SKYWAY_OPERATOR_KEY"]
        async with GatewayApi(system.urls["gateway"]) as api:
            world = await populate(system, api, city, operator_key=key, burst=WORLD)
            killed = system.supervisor.pid("registry")
            assert killed is not None
            os.kill(killed, signal.SIGKILL)

            requests = islice(city.requests(rate_per_s=1.0, seconds=60.0, seed=1), 3)
            customer = world.customers[0].key
            requested = [
                await api.call(
                    "POST", "/v1/deliveries", key=customer, body=json.loads(request.body)
                )
                for request in requests
            ]
            await start_new_drone(system, api, key, city)

            ids = [each["delivery_id"] for each in requested]
            assert await until_over(api, key, ids) == ["COMPLETED"] * 3
            await until_ready(api, key, WORLD.drones + 1)
    assert verify(folder).startswith("0 violations")
