"""What must not change an exact plan's time: repeating, renaming, reordering."""

from random import Random
from typing import Any

import pytest

from skyway.planner import compose
from skyway.planner.problem import Problem
from tests.library.planner.oracles.instances import as_json, make_problem
from tests.long_cases import sampled


@pytest.mark.parametrize("first", [100, 200])
def test_the_same_problem_gets_the_same_plan(first: int) -> None:
    for seed in range(first, first + 20):
        plans = [compose(make_problem(seed)) for _ in range(2)]

        once, again = (plan.model_dump(exclude={"stats"}) for plan in plans)
        labels = [plan.stats["labels"] for plan in plans]
        assert once == again, seed
        assert labels[0] == labels[1], seed


@pytest.mark.parametrize("first", sampled(range(2000, 2120, 30), every=4))
def test_other_names_and_another_order_of_everything_keep_the_time(first: int) -> None:
    for seed in range(first, first + 30):
        fields = as_json(seed)
        plan = compose(Problem.model_validate(fields))
        other = compose(Problem.model_validate(_disguised(fields, Random(seed))))

        assert other.status == plan.status, seed
        assert other.delivery_time_s == pytest.approx(plan.delivery_time_s, abs=1e-6), seed


def _disguised(fields: dict[str, Any], rng: Random) -> dict[str, Any]:
    """The same problem with other station names and pad numbers, its lists in another order."""
    features = fields["network"]["features"]
    pads = {
        one["properties"]["station_id"]: one["properties"]["pads"]
        for one in features
        if one["properties"]["kind"] == "station"
    }
    new_names = [f"n{number}" for number in range(len(pads))]
    rng.shuffle(new_names)
    name_of = dict(zip(pads, new_names, strict=True))

    def renamed(value: Any) -> Any:
        if isinstance(value, dict):
            changed = {key: renamed(one) for key, one in value.items()}
            if "pad" in changed:
                changed["pad"] = pads[value["station_id"]] - 1 - value["pad"]
            return changed
        if isinstance(value, list):
            return [renamed(one) for one in value]
        return name_of.get(value, value) if isinstance(value, str) else value

    made: dict[str, Any] = renamed(fields)
    for listed in (
        made["network"]["features"],
        made["packages"],
        made["pad_reservations"],
        made["closures"],
    ):
        rng.shuffle(listed)
    return made
