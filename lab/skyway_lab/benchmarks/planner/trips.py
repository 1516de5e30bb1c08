"""One table: how many trips `compose_many` plans in a second, beside `compose`."""

import random
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from skyway_lab.benchmarks.planner.cell import LOCAL_REACH_M
from skyway_lab.benchmarks.planner.cities import SEED, city, distances_m
from skyway_lab.benchmarks.planner.congestion import Congestion, book
from skyway_lab.benchmarks.planner.extent import Extent
from skyway_lab.benchmarks.planner.requests import drone_model
from skyway_lab.benchmarks.planner.table import Table

from skyway.network.network import Network
from skyway.planner import PadLedger, Trips, TripTerms, compose, compose_many

_STATIONS = 1_000
_DAY_S = 86_400.0
#: The trips begin within so many seconds.
_SPREAD_S = 6 * 3_600.0
#: All packages of a trip together, kg: most of what the model carries.
_LOAD_KG = 2.4
#: Trips that are planned again one by one with `compose`.
_ALONE = 50


@dataclass(frozen=True, slots=True)
class _Speed:
    """Trips a second, labels a trip, and milliseconds of one `compose`."""

    per_second: float
    labels: float
    alone_ms: float


def trips(extent: Extent) -> Table:
    """Local trips of 1 or 2 packages on 1,000 stations, by the share of pad time taken."""
    table = Table(
        "trips",
        f"**Many trips in one call**, {_STATIONS:,} stations, 1 or 2 packages to destinations "
        f"within {LOCAL_REACH_M / 1000:g} km of the source: trips a second on one core.",
        ("the drone stands", "taken", "trips a second", "labels", "compose alone", "ratio"),
    )
    for at_source in (True, False):
        where = "at the source, charged" if at_source else "within 45 km, 40 to 99 % charged"
        for taken in extent.trip_shares:
            speed = _measured(city(_STATIONS), taken, at_source=at_source, extent=extent)
            ratio = speed.alone_ms * speed.per_second / 1000
            table.rows.append(
                (
                    where,
                    f"{taken:.0%}",
                    f"{speed.per_second:,.0f}",
                    f"{speed.labels:,.0f}",
                    f"{speed.alone_ms:.2f} ms",
                    f"{ratio:.0f}",
                )
            )
            table.numbers.append({"at_source": at_source, "taken": taken, "ratio": ratio})
    table.remarks = [
        f"{extent.trips:,} trips a call, seconds of CPU of one thread, the least of five calls.",
        "The call before, which grows the trees of the destinations, does not count.",
        f"compose alone: a plan with steps, verified; the mean over {_ALONE}, the least of three.",
    ]
    return table


def _measured(network: Network, taken: float, *, at_source: bool, extent: Extent) -> _Speed:
    model = drone_model(_STATIONS)
    terms = TripTerms.of(network, [model], loading_s=60.0, dropoff_s=30.0)
    booked = book(network, Congestion(taken, _DAY_S), sources=[])
    ledger = PadLedger(terms, booked)
    drawn = _drawn(network, extent.trips, at_source=at_source)
    planned = compose_many(drawn, ledger)
    took_s = min(_seconds(lambda: compose_many(drawn, ledger)) for _ in range(5))
    problems = [planned.problem(trip) for trip in range(_ALONE)]
    books = [
        booked.seen_from(booked.zero_ms + round(1000 * start_s))
        for start_s in drawn.start_s[:_ALONE].tolist()
    ]

    def alone() -> None:
        for problem, seen in zip(problems, books, strict=True):
            compose(problem, airspace=terms.airspace, booked=seen)

    alone_s = min(_seconds(alone) for _ in range(3))
    return _Speed(len(drawn) / took_s, float(planned.labels.mean()), 1000 * alone_s / _ALONE)


def _seconds(work: Callable[[], object]) -> float:
    started = time.thread_time()
    work()
    return time.thread_time() - started


def _drawn(network: Network, count: int, *, at_source: bool) -> Trips:
    """So many trips at random, the same for the same seed."""
    chance = random.Random(f"{SEED}-trips")
    near: dict[int, list[int]] = {}
    start, source, destination, mass_kg, offsets = [], [], [], [], [0]
    for _ in range(count):
        row = chance.randrange(_STATIONS)
        if row not in near:
            reach = np.flatnonzero(distances_m(network, row) <= LOCAL_REACH_M).tolist()
            near[row] = [one for one in reach if one != row]
        packages = chance.choice((1, 2))
        source.append(row)
        start.append(row if at_source else chance.choice(near[row]))
        destination += chance.sample(near[row], packages)
        mass_kg += [_LOAD_KG / packages * chance.uniform(0.5, 1.0) for _ in range(packages)]
        offsets.append(len(destination))
    full = drone_model(_STATIONS).top_soc
    return Trips.of(
        start_row=start,
        start_s=[chance.uniform(0.0, _SPREAD_S) for _ in range(count)],
        soc=full if at_source else [chance.uniform(0.4, full) for _ in range(count)],
        source_row=source,
        package_offsets=offsets,
        destination_row=destination,
        mass_kg=mass_kg,
    )
