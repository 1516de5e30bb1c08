"""One day: a whole Skyway, a fleet that flies in a scenario, and deliveries in the corridor."""

import asyncio
import random
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, Final

import networkx
from skyway_drone_agent.simulated.disturbances import read_scenario
from skyway_lab.benchmarks.days.figures import Day, figures_of
from skyway_lab.benchmarks.days.forecast import forecast_of
from skyway_lab.benchmarks.days.player import Player, playing
from skyway_lab.benchmarks.load.run import data_folder, verify
from skyway_lab.benchmarks.load.storage_pair import storage_pair

from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.geo import distance_m
from skyway.ids import StationId
from skyway.network.bundled import texas_corridor
from skyway.network.geojson import write_network
from skyway.network.network import Network

_NETWORK_ID: Final = "texas-corridor"
#: How far apart pickup and destination are, metres, and what a package weighs, kilograms.
_APART_M, _MASS_KG = (8_000.0, 45_000.0), (0.3, 2.0)


@dataclass(frozen=True, slots=True)
class Trial:
    """What is flown; `every_s` is the fleet time between two requests, seconds.

    With `error_mps` the network has a forecast that is wrong by so much; None is no forecast. With
    `reserve_risk` its margins follow from this risk.
    """

    scenario: str
    deliveries: int
    drones: int
    every_s: float
    clock_rate: float
    seed: int
    error_mps: float | None = None
    reserve_risk: float | None = None

    def document(self, network: Network) -> dict[str, Any]:
        """The network as it is published on this day."""
        written = write_network(network)
        if self.reserve_risk is None:
            return written
        settings = {**written.get("settings", {}), "reserve_risk": self.reserve_risk}
        return {**written, "settings": settings}


async def fly(trial: Trial) -> Day:
    """Fly all deliveries of a day on the embedded pair, and measure them."""
    with data_folder() as folder, storage_pair("embedded", folder):
        async with playing(folder, clock_rate=trial.clock_rate) as player:
            day = await _play(trial, player)
        violations = await asyncio.to_thread(verify, folder)
    return day.with_violations(violations)


async def _play(trial: Trial, player: Player) -> Day:
    network = texas_corridor()
    await player.call("PUT", f"/v1/networks/{_NETWORK_ID}", trial.document(network))
    chance = random.Random(trial.seed)
    await player.start_fleet(
        chance.choices(connected(network), k=trial.drones),
        DJI_MATRICE_300_RTK.model_id,
        terms={"name": "Weather Air", "tariff": {"currency": "USD", "base": 100, "per_km": 10}},
        day=("--scenario", trial.scenario, "--seed", str(trial.seed)),
    )
    started_at = await player.now()
    if trial.error_mps is not None:
        forecast = forecast_of(
            read_scenario(trial.scenario),
            network,
            from_at=started_at,
            error_mps=trial.error_mps,
            seed=trial.seed,
        )
        await player.call("PUT", f"/v1/networks/{_NETWORK_ID}/weather", forecast)
    ids = []
    for number, body in enumerate(requests_in(network, trial.deliveries, chance)):
        await player.until(started_at + timedelta(seconds=number * trial.every_s))
        ids.append((await player.call("POST", "/v1/deliveries", body))["delivery_id"])
    deliveries = [await player.ended(each) for each in ids]
    missions = [
        await player.call("GET", f"/v1/missions/{mission['mission_id']}")
        for delivery in deliveries
        for mission in delivery["missions"]
    ]
    alarms = await player.call("GET", "/v1/alarms?level=CRITICAL&limit=200")
    reserve_soc = DJI_MATRICE_300_RTK.reserve_soc
    return figures_of(deliveries, missions, alarms["items"], reserve_soc=reserve_soc)


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
