"""What the exact search does when its labels or its time run out before the proof."""

from collections.abc import Callable, Iterator
from itertools import chain, repeat
from random import Random
from typing import Any

import pytest

from skyway.drone.model import ChargePoint, DroneModel
from skyway.network.synthetic import synthetic_city
from skyway.planner import compose
from skyway.planner.compose import compose_with
from skyway.planner.exact import exact_with
from skyway.planner.exact_task import Method
from skyway.planner.problem import Problem
from skyway.units import TIME_TOLERANCE_S

#: After a 32nd of a limit the search looks for any plan in haste.
_LIMITS = (4000, 5000, 6000)


@pytest.fixture(scope="module")
def wide(make_problem: Callable[..., Problem], model: DroneModel) -> Problem:
    """Eleven packages all over a city with busy pads: proven after some 7,000 labels."""
    network = synthetic_city(stations=300, seed=4, spacing_m=2000.0, pads=1)
    names = network.columns.station_ids
    weak = model.model_copy(
        update={
            "battery_j": 120_000.0,
            "speed_full_mps": 8.0,
            "charge_curve": (ChargePoint(0, 0), ChargePoint(800, 0.8), ChargePoint(2500, 1)),
        }
    )
    random = Random(1)
    taken = [session for name in names for session in _sessions(name, random)]
    return make_problem(
        network,
        *names[10:285:25],
        source=names[0],
        model=weak,
        mass_kg=0.08,
        pad_reservations=taken,
    )


def _sessions(station_id: str, random: Random) -> Iterator[dict[str, Any]]:
    at_s = random.uniform(0, 1500)
    while at_s < 40_000:
        end_s = at_s + random.uniform(600, 4000)
        yield {"station_id": station_id, "pad": 0, "start_s": at_s, "end_s": end_s}
        at_s = end_s + random.uniform(200, 1500)


def _limited(problem: Problem, limit: int | None) -> Problem:
    return problem.model_copy(update={"label_limit": limit})


@pytest.mark.parametrize("limit", _LIMITS)
def test_a_limit_leaves_a_plan_with_a_lower_bound_and_a_gap(wide: Problem, limit: int) -> None:
    best_s = compose(wide).delivery_time_s

    plan = compose(_limited(wide, limit))

    assert plan.status == "feasible"
    assert plan.lower_bound_s is not None
    assert plan.delivery_time_s is not None
    assert best_s is not None
    assert 0 < plan.lower_bound_s <= best_s + TIME_TOLERANCE_S
    assert best_s <= plan.delivery_time_s


def test_a_label_limit_is_repeatable(wide: Problem) -> None:
    plans = [compose(_limited(wide, 4000)).model_dump(exclude={"stats"}) for _ in range(2)]

    assert plans[0] == plans[1]


def test_more_labels_raise_the_lower_bound(wide: Problem) -> None:
    bounds_s = [compose(_limited(wide, limit)).lower_bound_s or 0.0 for limit in _LIMITS]

    assert bounds_s == sorted(bounds_s)


def test_a_stop_ends_the_search_between_two_runs(wide: Problem) -> None:
    asked = chain((False,), repeat(True))

    plan = compose_with(
        exact_with(Method(bound="none")), wide, name="unguided", stop=lambda _: next(asked)
    )

    assert plan.status in ("feasible", "unknown")
    assert plan.lower_bound_s is None
