"""Warming: compile the planner, or load it from disk, before it is needed.

``python -m skyway.planner.warm`` leaves the compiled planner on disk for the processes to come.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from skyway.drone.model import ChargePoint, DroneModel
from skyway.geo import Position
from skyway.ids import DroneModelId, StationId
from skyway.network.network import Network, Segment, Station
from skyway.planner.compose import compose
from skyway.planner.compose_many import compose_many
from skyway.planner.exact_memory import enlarged, new_memory
from skyway.planner.hierarchy import Hierarchy
from skyway.planner.kernels.search import run
from skyway.planner.kernels.ways import lengths_from
from skyway.planner.pad_book import PadBook
from skyway.planner.pad_ledger import PadLedger
from skyway.planner.problem import PadReservation, Problem
from skyway.planner.trip_terms import TripTerms
from skyway.planner.trips import Trips

#: Three stations in a row, 6 km apart, and a drone that flies 10 km on a full battery.
STATIONS = tuple(StationId(name) for name in "abc")
MODEL = DroneModel(
    model_id=DroneModelId("warm"),
    empty_mass_kg=1.0,
    max_payload_kg=1.0,
    battery_j=100_000.0,
    speed_empty_mps=10.0,
    speed_full_mps=9.0,
    power_empty_w=100.0,
    stop_s=1.0,
    stop_j=10.0,
    charge_curve=(ChargePoint(0, 0), ChargePoint(600, 0.8), ChargePoint(1000, 1)),
)


def warm() -> None:
    """Compose small problems that need every part of the planner; takes long the first time."""
    network = line_network()
    booked = PadBook.of(network, [_taken("b", pad=1)])
    hierarchy = Hierarchy.of(network)
    for members in _problems():
        problem = Problem.model_validate({"network": network, **members})
        compose(problem, booked=booked)
        compose(problem, booked=booked, hierarchy=hierarchy)
    enlarged(new_memory(trees=1))
    _compose_many(network, booked)
    away = network.outgoing
    lengths_from(
        away.offsets, away.station, away.length_m, 0, np.array([2], np.int64), len(STATIONS)
    )


def is_on_disk() -> bool:
    """Whether the planner was compiled for these sources, so that `warm` takes about a second."""
    cache: Any = getattr(run, "_cache", None)  # numba has no types
    return cache is not None and bool(cache._cache_file._load_index())


def _compose_many(network: Network, booked: PadBook) -> None:
    ledger = PadLedger(TripTerms.of(network, [MODEL]), booked)
    trips = Trips.of(
        start_row=0,
        start_s=0.0,
        soc=0.7,
        source_row=0,
        package_offsets=[0, 1],
        destination_row=2,
        mass_kg=0.4,
    )
    sessions = compose_many(trips, ledger).sessions(0)
    ledger.reserve(sessions)
    ledger.release(sessions)


def _problems() -> Iterator[dict[str, Any]]:
    """With and without approach, closures, reservations, plan; under both recharge policies."""
    far = {"package_id": "p1", "mass_kg": 0.4, "destination": "c"}
    near = {"package_id": "p2", "mass_kg": 0.1, "destination": "b"}
    drone = {"model": MODEL, "soc": 1.0}
    plain = {"drone": drone, "source": "a", "packages": [far]}
    beset = {
        "drone": {**drone, "soc": 0.7, "station_id": "b"},
        "source": "a",
        "packages": [far, near],
        "pad_reservations": [_taken("a", pad=0), _taken("b", pad=0)],
        "closures": [
            {"from": "a", "to": "b", "start_s": 0.0, "end_s": 300.0},
            {"station_id": "c", "start_s": 0.0, "end_s": 400.0},
        ],
        "loading_s": 1.0,
        "dropoff_s": 1.0,
    }
    for policy in ("partial", "full"):
        yield {**plain, "recharge_policy": policy}
        yield {**beset, "recharge_policy": policy}
        yield {**beset, "recharge_policy": policy, "latest_delivery_s": 1.0}
    yield {**plain, "source": "c", "finish": "stay"}


def _taken(station: str, *, pad: int) -> PadReservation:
    return PadReservation(station_id=StationId(station), pad=pad, start_s=0.0, end_s=900.0)


def line_network() -> Network:
    """Three stations in a row with two pads each."""
    stations = {
        name: Station(name, Position(0.05 * number, 0.0), pads=2)
        for number, name in enumerate(STATIONS)
    }
    ways = [(0, 1), (1, 0), (1, 2), (2, 1)]
    segments = [Segment(STATIONS[start], STATIONS[end], 6_000.0) for start, end in ways]
    return Network(stations, segments)


if __name__ == "__main__":
    warm()
