import pytest
from pydantic import ValidationError

from skyway.errors import InvalidNetwork, InvalidProblem
from skyway.planner.problem import Problem

DATED_ZONE = {
    "type": "Feature",
    "geometry": {"type": "Polygon", "coordinates": [[[1, 1], [2, 1], [2, 2], [1, 1]]]},
    "properties": {"kind": "zone", "zone_id": "z1", "active_from": "2026-01-01T00:00:00Z"},
}


@pytest.mark.parametrize(
    ("fields", "field", "reason"),
    [
        ({"source": "x"}, "source", "'x'"),
        ({"station": "x"}, "drone.station_id", "'x'"),
        ({"destinations": ("b", "x")}, "packages.1.destination", "'x'"),
        ({"destinations": ()}, "packages", "at least 1"),
        (
            {"pad_reservations": [{"station_id": "x", "pad": 0, "start_s": 0, "end_s": 1}]},
            "pad_reservations.0.station_id",
            "'x'",
        ),
        (
            {"pad_reservations": [{"station_id": "b", "pad": 4, "start_s": 0, "end_s": 1}]},
            "pad_reservations.0.pad",
            "4",
        ),
        (
            {"pad_reservations": [{"station_id": "b", "pad": 0, "start_s": 1, "end_s": 1}]},
            "pad_reservations.0.end_s",
            "after start_s",
        ),
        (
            {"closures": [{"from": "a", "to": "c", "start_s": 0}]},
            "closures.0",
            "no segment from 'a' to 'c'",
        ),
        ({"closures": [{"station_id": "x", "start_s": 0}]}, "closures.0.station_id", "'x'"),
    ],
)
def test_a_contradiction_with_the_network_is_named_with_its_field(
    make_problem, fields, field, reason
):
    destinations = fields.pop("destinations", ("b",))

    with pytest.raises(InvalidProblem) as refused:
        make_problem("a-b:1 b-c:1", *destinations, **fields)

    assert refused.value.field == field
    assert reason in refused.value.detail


def test_a_charge_below_the_reserve_is_refused(make_problem, model):
    model = model.model_copy(update={"reserve_soc": 0.2})

    with pytest.raises(InvalidProblem, match=r"drone.soc: 0.19 is below reserve_soc 0.2"):
        make_problem("a-b:1", "b", soc=0.19, model=model)


def test_a_second_package_with_the_same_id_is_refused(make_problem):
    packages = [{"package_id": "p", "mass_kg": 0, "destination": "b"}] * 2

    with pytest.raises(InvalidProblem, match=r"packages.1.package_id: .*'p'"):
        make_problem("a-b:1", packages=packages)


def test_thirteen_destinations_are_one_too_many(make_problem):
    names = [f"b{number}" for number in range(13)]
    network = " ".join(f"a-{name}:1" for name in names)
    make_problem(network, *names[:12])

    with pytest.raises(InvalidProblem, match="13 distinct destinations exceed the limit of 12"):
        make_problem(network, *names)


@pytest.mark.parametrize(
    ("fields", "where"),
    [
        ({"soc": 1.1}, ("drone", "soc")),
        ({"soc": float("nan")}, ("drone", "soc")),
        ({"mass_kg": -0.1}, ("packages", 0, "mass_kg")),
        ({"loading_s": -1}, ("loading_s",)),
        ({"label_limit": 0}, ("label_limit",)),
        ({"time_limit_s": 0}, ("time_limit_s",)),
        ({"finish": "home"}, ("finish",)),
        ({"recharge_polcy": "full"}, ("recharge_polcy",)),
        ({"start_at": "2026-01-01T00:00:00"}, ("start_at",)),
    ],
)
def test_a_field_that_breaks_its_limit_is_named(make_problem, fields, where):
    with pytest.raises(ValidationError) as refused:
        make_problem("a-b:1", "b", **fields)

    assert [fault["loc"] for fault in refused.value.errors()] == [where]


def test_a_hundred_and_one_packages_are_one_too_many(make_problem):
    make_problem("a-b:1", *["b"] * 100)

    with pytest.raises(ValidationError, match="101 packages exceed the limit of 100"):
        make_problem("a-b:1", *["b"] * 101)


def test_a_fault_of_the_network_is_named_by_its_path(make_problem):
    document = make_problem("a-b:1", "b").model_dump(mode="json", by_alias=True)
    document["network"]["features"][1]["properties"]["pads"] = -1

    with pytest.raises(InvalidNetwork) as refused:
        Problem.model_validate(document)

    assert refused.value.field == "network.features.1.properties.pads"


def test_a_dated_zone_requires_the_start(make_problem):
    document = make_problem("a-b:1", "b").model_dump(mode="json", by_alias=True)
    document["network"]["features"].append(DATED_ZONE)

    with pytest.raises(InvalidProblem, match="start_at: is required: zone 'z1' has dates"):
        Problem.model_validate(document)
    Problem.model_validate(document | {"start_at": "2026-01-01T00:00:00Z"})


def test_a_problem_written_as_json_reads_back_the_same(make_problem):
    problem = make_problem(
        "a-b:1 b>c:2",
        "c",
        start_at="2026-01-01T00:00:00Z",
        closures=[{"from": "b", "to": "c", "start_s": 1}, {"station_id": "b", "start_s": 2}],
        pad_reservations=[{"station_id": "b", "pad": 0, "start_s": 0, "end_s": None}],
    )

    assert Problem.model_validate_json(problem.model_dump_json()) == problem


def test_without_a_station_the_drone_stands_at_the_source(make_problem):
    assert make_problem("a-b:1", "b").start_station_id == "a"
    assert make_problem("a-b:1", "b", station="b").start_station_id == "b"
