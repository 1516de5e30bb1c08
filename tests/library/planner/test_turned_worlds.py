"""A world that is turned to any longitude has the same plans: no meridian is special."""

import math
from random import Random
from typing import Any

import pytest

from skyway.delivery.plan import PlanStatus
from skyway.planner import compose
from skyway.planner.problem import Problem
from skyway.planner.problem_document import read_problem
from skyway.planner.verify import verify
from tests.library.planner.oracles.instances import as_json

#: Steps of degrees that floats hold exactly, so that a turn changes no distance between longitudes.
STEPS_PER_DEGREE = 1024

FLIGHT: dict[str, Any] = {
    "drone": {
        "model": {
            "model_id": "m",
            "empty_mass_kg": 5,
            "max_payload_kg": 5,
            "battery_j": 1_000_000,
            "reserve_soc": 0.1,
            "speed_empty_mps": 10,
            "speed_full_mps": 10,
            "power_empty_w": 400,
            "charge_curve": [[0, 0], [5400, 1]],
        },
        "soc": 1.0,
    },
    "source": "west",
    "packages": [{"package_id": "p1", "mass_kg": 1, "destination": "east"}],
}


def turned(coordinates: Any, by_deg: float) -> Any:
    """The coordinates of any geometry, on whole steps, turned to the east."""
    if not isinstance(coordinates[0], list):
        # The lattice has 1,000 places for each degree.
        longitude, latitude = (round(each * 1000) / STEPS_PER_DEGREE for each in coordinates)
        return [math.remainder(longitude + by_deg, 360.0), latitude]
    return [turned(each, by_deg) for each in coordinates]


def turned_problem(document: dict[str, Any], by_deg: float) -> Problem:
    features = [
        {**each, "geometry": {**geometry, "coordinates": turned(geometry["coordinates"], by_deg)}}
        for each in document["network"]["features"]
        if (geometry := each["geometry"])
    ]
    network = {"type": "FeatureCollection", "features": features}
    return Problem.model_validate({**document, "network": network})


def some_turn_deg(chance: Random) -> float:
    """A turn after which longitude 180 often crosses the world, which is 0.1 degrees wide."""
    around_180 = 180 * STEPS_PER_DEGREE - chance.randint(0, 100)
    anywhere = chance.randint(-180 * STEPS_PER_DEGREE, 180 * STEPS_PER_DEGREE)
    return chance.choice([around_180, around_180, anywhere]) / STEPS_PER_DEGREE


@pytest.mark.parametrize("seed", range(60))
def test_a_turned_world_has_the_same_plan(seed: int) -> None:
    document = as_json(seed)
    here = turned_problem(document, 0.0)
    elsewhere = turned_problem(document, some_turn_deg(Random(seed)))

    plan, same = compose(here), compose(elsewhere)

    assert (same.status, same.steps) == (plan.status, plan.steps)
    assert not verify(here, same)
    assert not verify(elsewhere, plan)
    assert same.infeasibility == plan.infeasibility


def feature(shape: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    geometry = {"type": shape, "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def zone(*ring: tuple[float, float], zone_id: str = "z1") -> dict[str, Any]:
    corners = [list(corner) for corner in (*ring, ring[0])]
    return feature("Polygon", [corners], kind="zone", zone_id=zone_id)


def over_the_pacific(*zones: dict[str, Any]) -> Problem:
    """A flight over 8.5 km from longitude 179.96 to longitude -179.96."""
    west, east = [179.96, -17.0], [-179.96, -17.0]
    features = [
        feature("Point", west, kind="station", station_id="west"),
        feature("Point", east, kind="station", station_id="east"),
        feature("LineString", [west, east], **{"kind": "segment", "from": "west", "to": "east"}),
        *zones,
    ]
    return read_problem({**FLIGHT, "network": {"type": "FeatureCollection", "features": features}})


@pytest.mark.parametrize(
    "zones",
    [
        pytest.param(
            [
                zone((179.98, -17.1), (180, -17.1), (180, -16.9), (179.98, -16.9)),
                zone(
                    (-180, -17.1), (-179.98, -17.1), (-179.98, -16.9), (-180, -16.9), zone_id="z2"
                ),
            ],
            id="cut in two at 180",
        ),
        pytest.param(
            [zone((179.98, -17.1), (-179.98, -17.1), (-179.98, -16.9), (179.98, -16.9))],
            id="with edges from 179.98 to -179.98",
        ),
        pytest.param(
            [zone((179.98, -17.1), (180, -17.1), (180, -16.9), (179.98, -16.9))],
            id="only west of 180",
        ),
        pytest.param(
            [zone((-180, -17.1), (-179.98, -17.1), (-179.98, -16.9), (-180, -16.9))],
            id="only east of 180",
        ),
        pytest.param(
            [zone((0, -10), (90, -10), (180, -10), (-90, -10))], id="around the south pole"
        ),
    ],
)
def test_a_zone_across_longitude_180_blocks_a_flight(zones: list[dict[str, Any]]) -> None:
    open_sky, closed = over_the_pacific(), over_the_pacific(*zones)

    flown = compose(open_sky)

    assert flown.status is PlanStatus.OPTIMAL
    assert compose(closed).status is PlanStatus.INFEASIBLE
    assert [each.rule for each in verify(closed, flown)]


@pytest.mark.parametrize(
    "far",
    [
        pytest.param(
            zone((-0.1, -17.1), (0.1, -17.1), (0.1, -16.9), (-0.1, -16.9)), id="at longitude 0"
        ),
        pytest.param(zone((-170, -18), (170, -18), (170, -17.5), (-170, -17.5)), id="south of it"),
        pytest.param(zone((0, 80), (90, 80), (180, 80), (-90, 80)), id="around the north pole"),
    ],
)
def test_a_zone_elsewhere_blocks_no_flight_across_longitude_180(far: dict[str, Any]) -> None:
    problem = over_the_pacific(far)

    plan = compose(problem)

    assert plan.status is PlanStatus.OPTIMAL
    assert not verify(problem, plan)
