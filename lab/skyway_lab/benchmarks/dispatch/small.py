"""Small random fleets whose every order is planned: what the search finds beside the best order.

Eight stations, of which about a quarter has no pad and the others one. Requests have one or two
packages; most may share a trip, some may be picked up at another station, some have a deadline.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations
from random import Random
from statistics import mean
from typing import Any, Final

from skyway_lab.benchmarks.planner.table import Table

from skyway.dispatch.optimise import proven_s, searched
from skyway.dispatch.order_moves import Order
from skyway.dispatch.planned_trip import Pool
from skyway.dispatch.problem import FleetProblem, read_fleet_problem
from skyway.dispatch.schedule import Schedule
from skyway.dispatch.search import OrderSearch
from skyway.planner.stop import processor_stopwatch

_STATIONS: Final = 8
_DRONE: Final[dict[str, Any]] = {
    "model_id": "example",
    "empty_mass_kg": 5.0,
    "max_payload_kg": 2.0,
    "battery_j": 1_000_000,
    "reserve_soc": 0.1,
    "speed_empty_mps": 15.0,
    "speed_full_mps": 15.0,
    "power_empty_w": 400.0,
    "charge_curve": [[0, 0.0], [3600, 0.8], [5400, 1.0]],
}

#: Drones and requests of the fleets whose best order is proven, and the number of these fleets.
_SIZES: Final = ((2, 4), (3, 5), (3, 6), (4, 8))
_PROVEN_FLEETS: Final = 20

#: Metres of a degree of longitude and of latitude, about where the stations are.
_DEGREE_M: Final = (97_000.0, 111_000.0)


def small_fleet(seed: int, *, drones: int = 2, requests: int = 4) -> FleetProblem:
    """A random problem of this seed."""
    draws = Random(seed)
    at = [(draws.uniform(-98.5, -98.4), draws.uniform(29.3, 29.42)) for _ in range(_STATIONS)]
    ids = [f"s{number}" for number in range(_STATIONS)]
    features = [
        _feature("Point", each, kind="station", station_id=name, pads=int(draws.random() >= 0.25))
        for name, each in zip(ids, at, strict=True)
    ]
    for one, other in sorted(_links(at, draws)):
        length_m = round(_apart_m(at[one], at[other])) + 50
        ends = {"from": ids[one], "to": ids[other], "length_m": length_m}
        features.append(_feature("LineString", [at[one], at[other]], kind="segment", **ends))
    return read_fleet_problem(
        {
            "network": {"type": "FeatureCollection", "features": features},
            "drones": [
                {
                    "drone_id": f"d{number}",
                    "model": _DRONE,
                    "station_id": draws.choice(ids),
                    "soc": draws.choice((0.3, 0.6, 0.9)),
                    "free_s": draws.choice((0.0, 0.0, 300.0)),
                }
                for number in range(drones)
            ],
            "requests": [_request(number, ids, draws) for number in range(requests)],
            "loading_s": 60.0,
            "dropoff_s": 30.0,
            "hand_over_s": 30.0,
            "pad_gap_s": 60.0,
            "most_pooled": 3,
        }
    )


def _feature(geometry: str, coordinates: object, **properties: object) -> dict[str, object]:
    return {
        "type": "Feature",
        "geometry": {"type": geometry, "coordinates": coordinates},
        "properties": properties,
    }


def _apart_m(one: tuple[float, float], other: tuple[float, float]) -> float:
    away = (degree_m * (a - b) for degree_m, a, b in zip(_DEGREE_M, one, other, strict=True))
    return math.hypot(*away)


def _links(at: list[tuple[float, float]], draws: Random) -> set[tuple[int, int]]:
    """Each station and the nearest earlier one, and some random pairs."""
    found = {
        (min(range(number), key=lambda each: _apart_m(at[each], at[number])), number)
        for number in range(1, len(at))
    }
    for _ in range(len(at) // 2):
        one, other = sorted(draws.sample(range(len(at)), 2))
        found.add((one, other))
    return found


def _request(number: int, ids: list[str], draws: Random) -> dict[str, object]:
    source, other, *ends = draws.sample(ids, 4)
    request: dict[str, object] = {
        "request_id": f"r{number}",
        "source": source,
        "packages": [
            {
                "package_id": f"r{number}-{package}",
                "mass_kg": round(draws.uniform(0.3, 0.9), 2),
                "destination": end,
            }
            for package, end in enumerate(ends[: draws.choice((1, 1, 2))])
        ],
        "known_s": -draws.randrange(600),
        "pooling": draws.random() < 0.8,
    }
    if request["pooling"] and draws.random() < 0.3:
        request["pickups"] = [other]
    if draws.random() < 0.3:
        request["deadline_s"] = draws.randrange(2_000, 6_000)
    return request


def all_orders(requests: int, drones: int, *, allows: Callable[[Pool], bool]) -> Iterator[Order]:
    """Every way to group the requests into allowed trips, and to plan them for drones in turn."""
    for pools in _groupings(tuple(range(requests)), allows):
        yield from _orders(pools, drones)


def _orders(pools: tuple[Pool, ...], drones: int) -> Iterator[Order]:
    if not pools:
        yield ()
        return
    for number, pool in enumerate(pools):
        others = pools[:number] + pools[number + 1 :]
        for drone in range(drones):
            yield from (((drone, pool), *each) for each in _orders(others, drones))


def all_schedules(search: OrderSearch) -> Iterator[Schedule]:
    """The schedule of every order that keeps the limits of the search."""
    scheduler, last = search.scheduler, None
    requests, drones = len(scheduler.problem.requests), len(scheduler.problem.drones)
    for order in all_orders(requests, drones, allows=scheduler.planner.sharing.allows):
        last = scheduler.in_order(order, like=last)
        if search.limits.are_kept(last.costs):
            yield last


def _groupings(numbers: Pool, allows: Callable[[Pool], bool]) -> Iterator[tuple[Pool, ...]]:
    if not numbers:
        yield ()
        return
    first, *others = numbers
    for size in range(len(numbers)):
        for more in combinations(others, size):
            pool = (first, *more)
            if size == 0 or allows(pool):
                rest = tuple(each for each in others if each not in more)
                yield from ((pool, *each) for each in _groupings(rest, allows))


@dataclass(frozen=True, slots=True)
class Compared:
    """The objective that the search found, the best of all orders, and their unserved requests."""

    found_s: float
    best_s: float
    unserved: int
    least_unserved: int
    is_proven: bool

    @property
    def worse(self) -> float:
        """How much worse the search is, as a share."""
        return self.found_s / self.best_s - 1.0


def compared(
    problem: FleetProblem, *, budget_s: float = 0.0, rounds: int | None = None, seed: int = 1
) -> Compared:
    """Search, and plan every order."""
    search = searched(problem, budget_s=budget_s, rounds=rounds, seed=seed)
    kept = [each.costs for each in all_schedules(search)]
    found = search.best.costs
    best = min(kept, key=lambda each: each.total_s, default=found)
    least = min((each.unserved for each in kept), default=found.unserved)
    return Compared(found.total_s, best.total_s, found.unserved, least, search.is_proven)


def small(fleets: int, *, budget_s: float) -> Iterator[Table]:
    """How far the search and the bound are from the best order, and how many fleets are proven."""
    yield _beside_every_order(fleets, budget_s)
    table = Table(
        "small",
        f"fleets whose best order is proven within {budget_s:g} s, and within ten times as much",
        (
            *("drones, requests", "fleets", "proven", "mean, s", "proven in ten times", "mean, s"),
            *("lower bound below the best", "at most", "within 1 %"),
        ),
    )
    for drones, requests in _SIZES:
        row = [f"{drones}, {requests}", str(_PROVEN_FLEETS)]
        below: list[float] = []
        for most_s in (budget_s, 10 * budget_s):
            proven, used_s, below = 0, 0.0, []
            for seed in range(1, _PROVEN_FLEETS + 1):
                elapsed_s = processor_stopwatch()
                problem = small_fleet(seed, drones=drones, requests=requests)
                search = searched(problem, budget_s=most_s)
                proven += search.is_proven
                used_s += elapsed_s()
                below.append(1.0 - proven_s(search) / search.best.costs.total_s)
            row += [str(proven), f"{used_s / _PROVEN_FLEETS:.2f}"]
        row += [f"{mean(below):.1%}", f"{max(below):.1%}", str(sum(each <= 0.01 for each in below))]
        table.rows.append(tuple(row))
    yield table


def _beside_every_order(fleets: int, budget_s: float) -> Table:
    found = [compared(small_fleet(seed), budget_s=budget_s) for seed in range(1, fleets + 1)]
    table = Table(
        "small",
        f"{fleets} fleets of 2 drones and 4 requests, {budget_s:g} s each, beside every order",
        ("proven", "within 0.1 %", "worst", "left unserved in vain"),
    )
    table.rows.append(
        (
            str(sum(each.is_proven for each in found)),
            str(sum(each.worse <= 0.001 for each in found)),
            f"{max(each.worse for each in found):.1%}",
            str(sum(max(0, each.unserved - each.least_unserved) for each in found)),
        )
    )
    return table
