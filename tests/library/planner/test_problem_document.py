"""Every field of a problem, wrong in every way, is refused with its name and its limit."""

import copy
import time
from collections.abc import Callable
from typing import Any

import pytest

from skyway.errors import FieldFault, InvalidProblem
from skyway.planner import compose
from skyway.planner.problem import MAX_FAULTS
from skyway.planner.problem_document import read_problem
from tests.library.planner.outcomes import infeasibility

#: Seconds of processor time for one refusal of a huge document; one second is due.
_SOON_S = 2.0
_MANY = 10**6


def refusal(document: Any) -> InvalidProblem:
    """What the library says of a document, at the latest when asked for a plan."""
    with pytest.raises(InvalidProblem) as refused:
        compose(read_problem(document))
    return refused.value


def test_a_problem_with_every_field_is_accepted(good_problem):
    assert compose(read_problem(good_problem)).delivery_time_s is not None


def test_an_error_names_the_field_and_its_limit(bad_problems, subtests):
    for bad in bad_problems:
        with subtests.test(bad.name):
            error = refusal(bad.document)

            assert error.field.startswith(bad.field)
            assert bad.message in error.detail
            assert str(error).isprintable()


def test_all_faults_are_named_in_one_answer(good_problem):
    document = copy.deepcopy(good_problem)
    document["surprise"] = 1
    document["network"]["features"][0]["properties"]["pads"] = -1
    document["drone"]["soc"] = 2
    del document["source"]
    document["packages"][1]["mass_kg"] = "heavy"

    faults = refusal(document).faults

    assert faults == (
        FieldFault("surprise", "is not a known field"),
        FieldFault("network.features.0.properties.pads", "-1 is below 0"),
        FieldFault("drone.soc", "must be at most 1, not 2"),
        FieldFault("source", "is missing"),
        FieldFault("packages.1.mass_kg", "must be a number, not 'heavy'"),
    )


def test_all_contradictions_are_named_in_one_answer(good_problem):
    document = copy.deepcopy(good_problem)
    document["drone"]["soc"] = 0.01
    document["packages"][1] |= {"package_id": "p1", "destination": "x"}
    document["closures"][1]["to"] = "y"

    fields = [fault.field for fault in refusal(document).faults]

    assert fields == [
        "drone.soc",
        "packages.1.package_id",
        "packages.1.destination",
        "closures.1.to",
    ]


def test_thirteen_destinations_are_one_too_many(make_problem):
    names = [f"b{number}" for number in range(13)]
    make_problem(" ".join(f"a-{name}:1" for name in names), *names[:12])

    with pytest.raises(InvalidProblem) as refused:
        make_problem(" ".join(f"a-{name}:1" for name in names), *names)

    assert refused.value.faults == (
        FieldFault("packages", "13 distinct destinations exceed the limit of 12"),
    )


@pytest.mark.parametrize(
    "reservations",
    [
        [("b", 0, 0, 10), ("b", 0, 10, 20)],  # they touch
        [("b", 0, 10, 20), ("b", 0, 0, 10)],
        [("b", 0, 0, 0.1 + 0.2), ("b", 0, 0.3, 20)],  # they touch, apart from rounding
        [("b", 0, 0, 10), ("b", 1, 5, 20)],  # another pad
        [("b", 0, 0, 10), ("c", 0, 5, 20)],  # another station
    ],
)
def test_reservations_may_touch(make_problem, reservations: list[tuple[Any, ...]]):
    names = ("station_id", "pad", "start_s", "end_s")
    given = [dict(zip(names, each, strict=True)) for each in reservations]

    assert len(make_problem("a-b:1 b-c:1", "b", pad_reservations=given).pad_reservations) == 2


@pytest.mark.parametrize(
    ("reservations", "field"),
    [
        ([(0, 10), (5, 20)], "pad_reservations.1"),
        ([(5, 20), (0, 10)], "pad_reservations.1"),
        ([(0, 10), (0, 10)], "pad_reservations.1"),
        ([(0, None), (5, 20)], "pad_reservations.1"),
        ([(0, 100), (1, 2), (3, 4)], "pad_reservations.1"),
        ([(3, 4), (50, 60), (0, 100)], "pad_reservations.2"),
        ([(0, 10), (10, 20), (19.999, None)], "pad_reservations.2"),
    ],
)
def test_overlapping_reservations_of_one_pad_are_refused(
    make_problem, reservations: list[tuple[float, float | None]], field: str
):
    given = [
        {"station_id": "b", "pad": 0, "start_s": start_s, "end_s": end_s}
        for start_s, end_s in reservations
    ]

    with pytest.raises(InvalidProblem, match=r"overlaps pad_reservations\.\d: pad 0") as refused:
        make_problem("a-b:1", "b", pad_reservations=given)

    assert refused.value.field == field


def many_packages(document: dict[str, Any]) -> None:
    document["packages"] = [document["packages"][0]] * _MANY


def many_bad_packages(document: dict[str, Any]) -> None:
    document["packages"] = [{"mass_kg": -1}] * _MANY


def many_bad_reservations(document: dict[str, Any]) -> None:
    document["pad_reservations"] = [{"pad": -1}] * _MANY


def many_bad_closures(document: dict[str, Any]) -> None:
    document["closures"] = [7] * _MANY


def many_points(document: dict[str, Any]) -> None:
    document["drone"]["model"]["charge_curve"] = [[0, 0]] * _MANY


def many_bad_points(document: dict[str, Any]) -> None:
    document["drone"]["model"]["charge_curve"] = ["x"] * _MANY


def many_fields(document: dict[str, Any]) -> None:
    document.update((f"field{number}", 1) for number in range(_MANY))


def many_bad_features(document: dict[str, Any]) -> None:
    document["network"]["features"] = [{}] * _MANY


def many_periods(document: dict[str, Any]) -> None:
    period = {"start_s": 0, "end_s": 1, "time_factors": [1, 1]}
    document["weather"]["periods"] = [period] * _MANY


def many_factors(document: dict[str, Any]) -> None:
    document["weather"]["periods"][0]["time_factors"] = [1.0] * _MANY


def factors_in_many_periods(document: dict[str, Any]) -> None:
    period = {"start_s": 0, "end_s": 1, "time_factors": [1.0] * (_MANY // 100)}
    document["weather"]["periods"] = [period] * 100


def many_bad_segments(document: dict[str, Any]) -> None:
    document["weather"]["segments"] = [["x", "y"]] * (_MANY // 10)


def a_long_text(document: dict[str, Any]) -> None:
    document["source"] = "x" * _MANY


def a_long_name(document: dict[str, Any]) -> None:
    document["x\n" * _MANY] = 1


def a_long_number(document: dict[str, Any]) -> None:
    document["packages"][0]["mass_kg"] = 10**4000


def a_deep_value(document: dict[str, Any]) -> None:
    deep: list[Any] = []
    for _ in range(100_000):
        deep = [deep]
    document["packages"] = deep


@pytest.mark.parametrize(
    "flood",
    [
        many_packages,
        many_bad_packages,
        many_bad_reservations,
        many_bad_closures,
        many_points,
        many_bad_points,
        many_fields,
        many_bad_features,
        many_periods,
        many_factors,
        factors_in_many_periods,
        many_bad_segments,
        a_long_text,
        a_long_name,
        a_long_number,
        a_deep_value,
    ],
)
def test_a_flood_of_faults_is_refused_soon_and_with_a_short_answer(
    good_problem, flood: Callable[[Any], None]
):
    document = copy.deepcopy(good_problem)
    flood(document)
    began_s = time.thread_time()

    error = refusal(document)

    assert time.thread_time() - began_s < _SOON_S
    assert len(error.faults) <= MAX_FAULTS
    assert len(str(error)) < 5_000


def test_of_many_overlaps_the_first_are_named(good_problem):
    held = good_problem["pad_reservations"][1]

    error = refusal(good_problem | {"pad_reservations": [held] * 100_000})

    assert len(error.faults) == MAX_FAULTS


@pytest.mark.parametrize("document", [None, 7, "x", [], True, float("nan")])
def test_a_problem_that_is_not_an_object_is_refused(document: Any):
    assert "is not an object" in str(refusal(document))


EXTREMES: dict[str, dict[str, Any]] = {
    "a battery for ever": {"battery_j": 1e12},
    "a battery for nothing": {"battery_j": 1.0},
    "slower than a snail": {"speed_empty_mps": 0.01, "speed_full_mps": 0.01},
    "faster than sound": {"speed_empty_mps": 1000.0, "speed_full_mps": 0.01},
    "a feather": {"empty_mass_kg": 0.001, "max_payload_kg": 0.001},
    "a whale": {"empty_mass_kg": 10_000.0, "max_payload_kg": 10_000.0},
    "next to no power": {"power_empty_w": 0.001},
    "a power station": {"power_empty_w": 1e9},
    "long stops": {"stop_s": 1e6, "stop_j": 0.0},
    "costly stops": {"stop_j": 1e12},
    "a sudden charge": {"charge_curve": [[0, 0], [1e-9, 1.0]]},
    "an endless charge": {"charge_curve": [[0, 0], [1e9, 1.0]]},
    "a hair of charge": {"charge_curve": [[0, 0.1], [1, 0.1000000001]]},
}


@pytest.mark.parametrize("model", EXTREMES.values(), ids=EXTREMES)
@pytest.mark.parametrize("mass_kg", [0.0, 0.001])
def test_extremes_within_the_limits_are_planned(good_problem, model: Any, mass_kg: float):
    document = copy.deepcopy(good_problem)
    document["drone"]["model"] |= model
    document["packages"][0]["mass_kg"] = mass_kg
    for name in ("latest_delivery_s", "strategy"):
        del document[name]
    del document["packages"][1]

    assert compose(read_problem(document)).status


def test_an_enormous_mass_is_overweight(good_problem):
    document = copy.deepcopy(good_problem)
    for package in document["packages"]:
        package["mass_kg"] = 1e12

    assert infeasibility(compose(read_problem(document))).code == "OVERWEIGHT"
