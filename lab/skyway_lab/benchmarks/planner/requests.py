"""Requests drawn at random, the same for the same seed.

The source of a run depends on the network's size alone, so that cells differ in nothing else.
"""

import random
from collections.abc import Iterator

import numpy as np
from skyway_lab.benchmarks.planner.cell import Cell
from skyway_lab.benchmarks.planner.cities import SEED, distances_m

from skyway.drone.model import DroneModel
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.ids import PackageId, StationId
from skyway.network.network import Network
from skyway.planner.problem import DroneAtStart, PackageToDeliver, Problem

#: All packages of a request together, kg: most of what the model carries.
_LOAD_KG = 2.4

#: Share of the model's battery in a city of up to 100 stations: a whole battery would cross it.
_SMALL_BATTERY = 0.25


def drone_model(stations: int) -> DroneModel:
    """The maker's drone; on small cities with a smaller battery, so that it has to recharge."""
    model = DJI_MATRICE_300_RTK
    if stations > 100:
        return model
    return model.model_copy(update={"battery_j": _SMALL_BATTERY * model.battery_j})


def source_rows(network: Network, runs: int) -> list[int]:
    """The rows of the sources of these runs."""
    stations = len(network.columns.station_ids)
    return [random.Random(f"{SEED}-{stations}-{run}").randrange(stations) for run in range(runs)]


def requests(
    network: Network, cell: Cell, *, runs: int, limit_s: float, strategy: str = "exact"
) -> Iterator[Problem]:
    """The problems of a cell, one for each run, with this time limit."""
    model = drone_model(cell.stations)
    for run, source in enumerate(source_rows(network, runs)):
        chance = random.Random(f"{SEED}-{cell.stations}-{cell.packages}-{cell.reach_m}-{run}")
        rows = _destinations(network, source, cell, chance)
        yield Problem(
            network=network,
            drone=DroneAtStart(model=model, soc=model.top_soc),
            source=network.columns.station_ids[source],
            packages=_packages([network.columns.station_ids[row] for row in rows], chance),
            recharge_policy=cell.policy,
            strategy=strategy,
            time_limit_s=limit_s,
        )


def _destinations(network: Network, source: int, cell: Cell, chance: random.Random) -> list[int]:
    if cell.reach_m is None:
        count = len(network.columns.station_ids)
        near: list[int] | range = range(count)
    else:
        near = np.flatnonzero(distances_m(network, source) <= cell.reach_m).tolist()
    rows = chance.sample(near, cell.packages + 1)
    return [row for row in rows if row != source][: cell.packages]


def _packages(destinations: list[StationId], chance: random.Random) -> tuple[PackageToDeliver, ...]:
    largest_kg = _LOAD_KG / len(destinations)
    return tuple(
        PackageToDeliver(
            package_id=PackageId(f"p{number}"),
            mass_kg=round(largest_kg * chance.uniform(0.5, 1.0), 3),
            destination=destination,
        )
        for number, destination in enumerate(destinations, start=1)
    )
