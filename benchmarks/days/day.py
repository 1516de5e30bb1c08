"""One day: a whole Skyway, a fleet that flies in a scenario, and deliveries in the corridor."""

import asyncio
import json
import random
import sys
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, Final

import networkx
from skyway_drone_agent.simulated.disturbances import read_scenario

from benchmarks.days.figures import Day, figures_of
from benchmarks.days.forecast import forecast_of
from benchmarks.load.run import data_folder, verify
from benchmarks.load.storage_pair import storage_pair
from skyway.cli.gateway import GatewayApi, read_keys
from skyway.cli.system.children import Ports
from skyway.cli.system.running_system import System, running_system
from skyway.cli.system.supervisor import Child
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.errors import SkywayError
from skyway.geo import distance_m
from skyway.ids import StationId
from skyway.network.bundled import texas_corridor
from skyway.network.geojson import write_network
from skyway.network.network import Network
from skyway.runtime.signing.fleet_keys import FleetKeys

_NETWORK_ID: Final = "texas-corridor"
#: How far apart pickup and destination are, metres, and what a package weighs, kilograms.
_APART_M, _MASS_KG = (8_000.0, 45_000.0), (0.3, 2.0)
_TERMINAL: Final = ("COMPLETED", "PARTIALLY_COMPLETED", "CANCELLED", "FAILED", "REJECTED")
#: Wall seconds until all drones must be ready, and until all deliveries must be over.
_READY_WITHIN_S, _END_WITHIN_S = 120.0, 900.0


@dataclass(frozen=True, slots=True)
class Trial:
    """What is flown; `every_s` is the fleet time between two requests, seconds.

    With `error_mps` the network has a forecast that is wrong by so much; None is no forecast.
    """

    scenario: str
    deliveries: int
    drones: int
    every_s: float
    clock_rate: float
    seed: int
    error_mps: float | None = None


async def fly(trial: Trial) -> Day:
    """Fly all deliveries of a day on the embedded pair, and measure them."""
    with data_folder() as folder, storage_pair("embedded", folder):
        ports = Ports(gateway=0, broker=0)
        async with (
            running_system(folder, rate=trial.clock_rate, ports=ports, say=print) as system,
            GatewayApi(system.urls["gateway"]) as api,
        ):
            key = read_keys(folder)["SKYWAY_OPERATOR_KEY"]
            day = await _Player(trial, system, api, key).play()
        violations = await asyncio.to_thread(verify, folder)
    return day.with_violations(violations)


@dataclass(frozen=True, slots=True)
class _Player:
    """An operator, a provider and a customer in one."""

    trial: Trial
    system: System
    api: GatewayApi
    key: str

    async def play(self) -> Day:
        network = texas_corridor()
        await self._call("PUT", f"/v1/networks/{_NETWORK_ID}", write_network(network))
        chance = random.Random(self.trial.seed)
        await self._start_fleet(network, chance)
        started_at = await self._now()
        await self._forecast(network, started_at)
        ids = []
        for number, body in enumerate(requests_in(network, self.trial.deliveries, chance)):
            await self._until(started_at + timedelta(seconds=number * self.trial.every_s))
            answer = await self._call("POST", "/v1/deliveries", body)
            ids.append(answer["delivery_id"])
        deliveries = [await self._ended(each) for each in ids]
        missions = [
            await self._call("GET", f"/v1/missions/{mission['mission_id']}")
            for delivery in deliveries
            for mission in delivery["missions"]
        ]
        alarms = await self._call("GET", "/v1/alarms?level=CRITICAL&limit=200")
        reserve_soc = DJI_MATRICE_300_RTK.reserve_soc
        return figures_of(deliveries, missions, alarms["items"], reserve_soc=reserve_soc)

    async def _forecast(self, network: Network, now: datetime) -> None:
        if self.trial.error_mps is not None:
            body = forecast_of(
                read_scenario(self.trial.scenario),
                network,
                from_at=now,
                error_mps=self.trial.error_mps,
                seed=self.trial.seed,
            )
            await self._call("PUT", f"/v1/networks/{_NETWORK_ID}/weather", body)

    async def _start_fleet(self, network: Network, chance: random.Random) -> None:
        terms = {"name": "Weather Air", "tariff": {"currency": "USD", "base": 100, "per_km": 10}}
        provider_id = (await self._call("POST", "/v1/providers", terms))["provider_id"]
        homes = chance.choices(connected(network), k=self.trial.drones)
        model_id = DJI_MATRICE_300_RTK.model_id
        own = FleetKeys([{"model_id": model_id, "home_station_id": home} for home in homes])
        path = f"/v1/providers/{provider_id}/drones"
        registered = await self._call("POST", path, own.bodies)
        file = self.system.folder.path / "fleet.json"
        file.touch(mode=0o600)
        file.write_text(json.dumps({"items": own.kept(registered["items"])}))
        day = ("--scenario", self.trial.scenario, "--seed", str(self.trial.seed))
        self.system.supervisor.start(
            Child(
                name="agents",
                command=(sys.executable, "-m", "skyway_drone_agent", "--fleet", str(file), *day),
                log=self.system.folder.log("agents"),
                environment={
                    "SKYWAY_MQTT_URL": self.system.mqtt_url,
                    "SKYWAY_AGENT_JOURNAL": str(self.system.folder.journals.resolve()),
                },
            )
        )
        try:
            async with asyncio.timeout(_READY_WITHIN_S):
                while not await self._are_ready():  # noqa: ASYNC110
                    await asyncio.sleep(0.5)  # asked of another process
        except TimeoutError as error:
            raise SkywayError(
                f"not all {self.trial.drones} drones were ready within {_READY_WITHIN_S:g} s"
            ) from error

    async def _are_ready(self) -> bool:
        fleets = await self._call("GET", "/v1/stats/fleets")
        return bool(fleets["by_state"].get("AVAILABLE", 0) >= self.trial.drones)

    async def _ended(self, delivery_id: str) -> dict[str, Any]:
        delivery: dict[str, Any] = {}
        try:
            async with asyncio.timeout(_END_WITHIN_S):
                while delivery.get("state") not in _TERMINAL:
                    await asyncio.sleep(0.2)  # asked of another process
                    delivery = await self._call("GET", f"/v1/deliveries/{delivery_id}")
        except TimeoutError as error:
            raise SkywayError(
                f"{delivery_id} is {delivery.get('state')} after {_END_WITHIN_S:g} s"
            ) from error
        return delivery

    async def _until(self, moment: datetime) -> None:
        left_s = (moment - await self._now()).total_seconds() / self.trial.clock_rate
        await asyncio.sleep(max(0.0, left_s))

    async def _now(self) -> datetime:
        return datetime.fromisoformat((await self._call("GET", "/v1/clock"))["now"])

    async def _call(self, method: str, path: str, body: object = None) -> Any:
        return await self.api.call(method, path, key=self.key, body=body)


def requests_in(network: Network, count: int, chance: random.Random) -> list[dict[str, Any]]:
    """Requests of one package each, between stations that are not too near and not too far."""
    stations = connected(network)
    requests: list[dict[str, Any]] = []
    while len(requests) < count:
        pickup, destination = chance.sample(stations, 2)
        apart_m = distance_m(
            network.stations[pickup].position, network.stations[destination].position
        )
        if _APART_M[0] <= apart_m <= _APART_M[1]:
            package = {
                "package_id": "p",
                "mass_kg": round(chance.uniform(*_MASS_KG), 2),
                "destination": {"station_id": destination},
            }
            requests.append({"pickup": {"station_id": pickup}, "packages": [package]})
    return requests


def connected(network: Network) -> list[StationId]:
    """The stations of the largest part of the network in which all are reached from all."""
    graph = networkx.DiGraph((each.from_id, each.to_id) for each in network.segments)
    parts = sorted(networkx.strongly_connected_components(graph), key=len)
    return sorted(parts[-1])
