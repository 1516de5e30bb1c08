"""The words for a plan's proof."""

from skyway.cli.delivery import proof_of


def test_an_optimal_plan_is_proven():
    plan = {"status": "optimal", "delivery_time_s": 10.0, "lower_bound_s": 10.0}

    assert proof_of(plan) == "proven optimal: no plan delivers earlier"


def test_a_plan_that_a_limit_ended_tells_how_much_earlier_another_could_be():
    plan = {"status": "feasible", "delivery_time_s": 1510.0, "lower_bound_s": 10.0}

    assert proof_of(plan).endswith("up to 1,500 s earlier")


def test_a_plan_without_bound_is_not_proven():
    plan = {"status": "feasible", "delivery_time_s": 10.0, "lower_bound_s": None}

    assert proof_of(plan) == "not proven optimal"
