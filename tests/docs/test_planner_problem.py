"""docs/reference/planner-problem.md: its example is run, and it names every field."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from skyway.delivery.plan import Infeasibility, PackageDelivery, Plan, Step
from skyway.drone.model import DroneModel
from skyway.drone.models import DRONE_MODELS
from skyway.json_model import JsonModel
from skyway.planner.compose import STRATEGIES, compose
from skyway.planner.problem import (
    DroneAtStart,
    PackageToDeliver,
    PadReservation,
    Problem,
    SegmentClosure,
    StationClosure,
)
from skyway.planner.problem_document import read_problem
from skyway.planner.weather_document import WeatherDocument, WeatherPeriod

PAGE = (Path(__file__).parents[2] / "docs/reference/planner-problem.md").read_text()
PROBLEM, PLAN = (json.loads(block) for block in re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL))
STEPS: tuple[type[JsonModel], ...] = Step.__args__[0].__args__
MODELS: tuple[type[JsonModel], ...] = (
    Problem,
    DroneAtStart,
    PackageToDeliver,
    PadReservation,
    StationClosure,
    SegmentClosure,
    WeatherDocument,
    WeatherPeriod,
    DroneModel,
    Plan,
    PackageDelivery,
    Infeasibility,
    *STEPS,
)


def numbers_apart(value: Any, path: str = "") -> tuple[dict[str, float], Any]:
    """The numbers of a JSON value by their path, and the value without them."""
    if isinstance(value, float | int) and not isinstance(value, bool):
        return {path: float(value)}, None
    if isinstance(value, dict):
        parts = {key: numbers_apart(inner, f"{path}.{key}") for key, inner in value.items()}
        rest = {key: inner for key, (_, inner) in parts.items()}
        return {p: n for numbers, _ in parts.values() for p, n in numbers.items()}, rest
    if isinstance(value, list):
        listed = [numbers_apart(inner, f"{path}.{index}") for index, inner in enumerate(value)]
        numbers = {p: n for found, _ in listed for p, n in found.items()}
        return numbers, [inner for _, inner in listed]
    return {}, value


def test_the_example_gives_the_plan_on_the_page() -> None:
    plan = json.loads(compose(read_problem(PROBLEM)).model_dump_json())

    for document in (plan, PLAN):
        assert document["stats"].pop("elapsed_s") > 0
    numbers, words = numbers_apart(plan)
    numbers_on_page, words_on_page = numbers_apart(PLAN)
    assert words == words_on_page
    assert numbers == pytest.approx(numbers_on_page, abs=1e-5)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.__name__)
def test_the_page_names_every_field(model: type[JsonModel]) -> None:
    fields = {info.alias or name for name, info in model.model_fields.items()}

    assert {name for name in fields if f"`{name}`" not in PAGE} == set()


def test_the_page_names_every_infeasibility_code_strategy_and_model() -> None:
    codes = Infeasibility.model_json_schema()["properties"]["code"]["enum"]

    assert all(f"| {code} |" in PAGE for code in codes)
    assert all(f"| `{name}` |" in PAGE for name in (*STRATEGIES, *DRONE_MODELS))


def test_the_limits_on_the_page_are_those_of_the_problem() -> None:
    rows = dict(re.findall(r"^\| `(\w+)` \| (.*)$", PAGE, re.MULTILINE))

    schema = DroneModel.model_json_schema()["properties"]
    for name in ("empty_mass_kg", "battery_j", "speed_full_mps", "power_empty_w", "stop_s"):
        low, high = schema[name]["minimum"], schema[name]["maximum"]
        given = re.search(r"([\d.,e]+) to ([\d.,e]+)", rows[name])
        assert given is not None
        assert [float(number.replace(",", "")) for number in given.groups()] == [low, high]
