"""Small random fleets whose every order is planned: what the search finds beside the best order.

Eight stations, of which about a quarter has no pad and the others one. Requests have one or two
packages; most may share a trip, some may be picked up at another station, some have a deadline.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations, combinations_with_replacement, pairwise, permutations
from random import Random
from typing import Any, Final

from skyway_lab.benchmarks.planner.table import Table

from skyway.dispatch.optimise import searched
from skyway.dispatch.planned_trip import Pool
from skyway.dispatch.problem import FleetProblem, read_fleet_problem
from skyway.dispatch.schedule import Sequences

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


def all_sequences(
    requests: int, drones: int, *, allows: Callable[[Pool], bool]
) -> Iterator[Sequences]:
    """Every way to group the requests into trips that are allowed, and to order them for drones."""
    for pools in _groupings(tuple(range(requests)), allows):
        for order in permutations(pools):
            for cuts in combinations_with_replacement(range(len(order) + 1), drones - 1):
                ends = (0, *cuts, len(order))
                yield tuple(order[one:other] for one, other in pairwise(ends))


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

    @property
    def worse(self) -> float:
        """How much worse the search is, as a share; below 0 if it is better than all orders."""
        return self.found_s / self.best_s - 1.0


def compared(
    problem: FleetProblem, *, budget_s: float = 0.0, rounds: int | None = None, seed: int = 1
) -> Compared:
    """Search, and plan every order by the rule "who is free first is planned first"."""
    search = searched(problem, budget_s=budget_s, rounds=rounds, seed=seed)
    scheduler = search.scheduler
    orders = all_sequences(
        len(problem.requests), len(problem.drones), allows=scheduler.planner.sharing.allows
    )
    kept = [
        each.costs for each in map(scheduler.planned, orders) if search.limits.are_kept(each.costs)
    ]
    best = min(kept, key=lambda each: each.total_s, default=search.best.costs)
    least = min((each.unserved for each in kept), default=best.unserved)
    costs = search.best.costs
    return Compared(costs.total_s, best.total_s, costs.unserved, least)


def small(fleets: int, *, budget_s: float) -> Iterator[Table]:
    """How far the search is from the best order, over this many fleets."""
    found = [compared(small_fleet(seed), budget_s=budget_s) for seed in range(1, fleets + 1)]
    table = Table(
        "small",
        f"{fleets} fleets of 2 drones and 4 requests, {budget_s:g} s each, beside every order",
        ("within 0.1 %", "better than every order", "worst", "left unserved in vain"),
    )
    table.rows.append(
        (
            str(sum(each.worse <= 0.001 for each in found)),
            str(sum(each.worse < -1e-6 for each in found)),
            f"{max(each.worse for each in found):.1%}",
            str(sum(max(0, each.unserved - each.least_unserved) for each in found)),
        )
    )
    yield table
