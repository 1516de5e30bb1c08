"""A few dozen good plans that use all features of a problem."""

import math
import random
from functools import cache
from typing import Any

from skyway.drone.model import ChargePoint, DroneModel
from skyway.ids import DroneModelId
from skyway.planner import compose
from skyway.planner.problem import Problem
from tests.library.planner.damages.good_plan import GoodPlan

#: Flies about 10 km; slower and with more power when loaded; landings cost; never quite full.
MODEL = DroneModel(
    model_id=DroneModelId("all-features"),
    empty_mass_kg=5.0,
    max_payload_kg=4.0,
    battery_j=100_000.0,
    reserve_soc=0.1,
    speed_empty_mps=12.0,
    speed_full_mps=9.0,
    power_empty_w=90.0,
    stop_s=7.0,
    stop_j=150.0,
    charge_curve=(ChargePoint(0, 0), ChargePoint(1000, 0.8), ChargePoint(2000, 0.97)),
)


def random_problem(seed: int) -> dict[str, Any]:
    """A problem that uses all features, on six to eight stations a few kilometres apart."""
    chance = random.Random(seed)
    names = [f"s{number}" for number in range(chance.randint(6, 8))]
    places = {name: (chance.uniform(0, 0.12), chance.uniform(0, 0.08)) for name in names}
    features: list[dict[str, Any]] = [
        _feature("Point", places[name], kind="station", station_id=name, pads=chance.choice((1, 2)))
        for name in names
    ]
    for number, name in enumerate(names):
        for other in names[:number]:
            away = math.dist(places[name], places[other])
            if other == names[number - 1] or away < 0.05:
                line = [places[name], places[other]]
                length_m = min(away * 80_000, 6_000)
                ends = {"from": name, "to": other}
                features.append(
                    _feature("LineString", line, kind="segment", length_m=length_m, **ends)
                )
    west, south = chance.uniform(0, 0.1), chance.uniform(0, 0.06)
    ring = [[west, south], [west + 0.01, south], [west, south + 0.01], [west, south]]
    until = f"2026-01-01T00:{chance.randint(2, 30):02}:00Z"
    features.append(_feature("Polygon", [ring], kind="zone", zone_id="z", active_until=until))
    source, *others = chance.sample(names, 5)
    destinations = [*others[: chance.randint(1, 3)], *([source] if seed % 5 == 0 else [])]
    return {
        "network": {"type": "FeatureCollection", "features": features},
        "start_at": "2026-01-01T00:00:00Z",
        "drone": {
            "model": MODEL,
            "soc": chance.uniform(0.5, 1.0),
            "station_id": others[3] if seed % 3 == 0 else None,
        },
        "source": source,
        "packages": [
            {"package_id": f"p{number}", "mass_kg": chance.uniform(0, 0.9), "destination": name}
            for number, name in enumerate([*destinations, destinations[0]])
        ],
        "pad_reservations": [
            {"station_id": name, "pad": 0, "start_s": start_s, "end_s": start_s + 900}
            for name in names
            for start_s in (chance.uniform(0, 500), chance.uniform(1500, 2500))
        ],
        "closures": [
            {"station_id": names[0], "start_s": 0, "end_s": 400},
            {"from": names[1], "to": names[0], "start_s": 100, "end_s": 800},
        ],
        "strategy": (None, "heuristic")[seed % 2],
        "recharge_policy": chance.choice(("partial", "full")),
        "finish": chance.choice(("recharge", "stay")),
        "loading_s": chance.choice((0.0, 45.0)),
        "dropoff_s": chance.choice((0.0, 20.0)),
    }


def _feature(shape: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": {"type": shape, "coordinates": coordinates},
        "properties": properties,
    }


@cache
def good_plans() -> tuple[GoodPlan, ...]:
    """A few dozen plans that the planner made and `verify` accepted."""
    made = []
    for seed in range(60):
        problem = Problem.model_validate(random_problem(seed))
        plan = compose(problem)
        if plan.is_flyable:
            made.append(GoodPlan(f"plan {seed}", problem, plan))
    return tuple(made)
