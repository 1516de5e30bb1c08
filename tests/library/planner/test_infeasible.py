import pytest

from skyway.planner import compose

FOR_GOOD = {"start_s": 0, "end_s": None}


@pytest.mark.parametrize("strategy", ["heuristic", "exhaustive"])
@pytest.mark.parametrize(
    ("network", "destinations", "fields", "code"),
    [
        ("a-b:1", ["b", "b"], {"mass_kg": 0.6}, "OVERWEIGHT"),
        ("a-b:1 c-b:1 d-e:1", ["d"], {}, "DESTINATION_UNREACHABLE"),
        (
            "a-b:1",
            ["b"],
            {"closures": [{"station_id": "b", **FOR_GOOD}]},
            "DESTINATION_UNREACHABLE",
        ),
        (
            "a-b:1",
            ["b"],
            {"closures": [{"from": "a", "to": "b", **FOR_GOOD}]},
            "DESTINATION_UNREACHABLE",
        ),
        ("b>a:1 a-c:1", ["c"], {"station": "c", "source": "b"}, "DESTINATION_UNREACHABLE"),
        ("a>b:1 a>c:1", ["b", "c"], {}, "DESTINATION_UNREACHABLE"),
        ("a-b:11", ["b"], {}, "OUT_OF_RANGE"),
        ("a-b:6 b-c:6", ["c"], {"pads": {"b": 0}}, "OUT_OF_RANGE"),
        ("a-b:6", ["b"], {"pads": {"b": 0}}, "OUT_OF_RANGE"),
        ("a-b:6", ["b"], {"pads": {"a": 0}, "soc": 0.5}, "OUT_OF_RANGE"),
        ("a-b:8 b-c:5", ["c"], {"latest_delivery_s": 1599.0}, "TOO_LATE"),
    ],
)
def test_what_is_provably_impossible_is_named(
    make_problem, strategy, network, destinations, fields, code
):
    plan = compose(make_problem(network, *destinations, strategy=strategy, **fields))

    assert plan.status == "infeasible"
    assert plan.infeasibility.code == code
    assert (plan.delivery_time_s, plan.energy_j, plan.steps) == (None, None, ())


def test_the_numbers_that_overweigh_are_told(make_problem):
    plan = compose(make_problem("a-b:1", "b", "b", mass_kg=0.75))

    assert plan.infeasibility.detail == (
        "payload 1.5 kg exceeds the 1 kg limit of drone model round"
    )


def test_pads_that_are_all_reserved_prove_nothing(make_problem, taken):
    plan = compose(make_problem("a-b:8 b-c:5", "c", pad_reservations=taken("b", 0, None)))

    assert plan.status == "unknown"


def test_the_least_time_counts_recharging_at_the_curve_s_fastest(make_problem):
    problem = make_problem("a-b:8 b-c:5", "c", latest_delivery_s=1600.0)

    assert compose(problem).status == "feasible"
