"""A standby that ends early: the part of a plan before a moment."""

import pytest

from skyway.delivery.plan import Fly, Plan, PlanStatus, Recharge, Wait
from skyway.ids import StationId
from skyway.scheduling.standby import shortened_plan, shortened_step

A, B = StationId("a"), StationId("b")
FLIGHT = Fly.model_validate(
    {
        "from": B,
        "to": A,
        "start_s": 0.0,
        "end_s": 100.0,
        "load_kg": 0.0,
        "energy_j": 5.0,
        "soc_end": 0.3,
    }
)
PAUSE = Wait(station_id=A, start_s=100.0, end_s=150.0)
CHARGE = Recharge(station_id=A, pad=0, start_s=150.0, end_s=350.0, soc_start=0.3, soc_end=0.9)
HOME = Plan(status=PlanStatus.OPTIMAL, delivery_time_s=350.0, steps=(FLIGHT, PAUSE, CHARGE))


def test_a_recharge_that_ends_early_gives_its_share_of_the_charge() -> None:
    shortened = shortened_step(CHARGE, 250.0)

    assert isinstance(shortened, Recharge)
    assert shortened.end_s == 250.0
    assert shortened.soc_end == pytest.approx(0.6)


@pytest.mark.parametrize("until_s", [350.0, 349.999, 1_000.0])
def test_a_step_that_ends_before_the_moment_stays(until_s: float) -> None:
    assert shortened_step(CHARGE, until_s) == CHARGE


@pytest.mark.parametrize("until_s", [150.0, 150.001, 20.0])
def test_a_step_that_begins_at_the_moment_or_later_is_left_out(until_s: float) -> None:
    assert shortened_step(CHARGE, until_s) is None


def test_a_shortened_plan_counts_only_the_steps_that_are_left() -> None:
    plan = shortened_plan(HOME, 120.0)

    assert [each.end_s for each in plan.steps] == [100.0, 120.0]
    assert plan.delivery_time_s == 120.0
    assert (plan.energy_j, plan.flight_s) == (5.0, 100.0)
    assert (plan.waiting_s, plan.recharging_s) == (20.0, 0.0)


def test_a_plan_that_ends_before_its_start_is_empty() -> None:
    plan = shortened_plan(HOME, 0.0)

    assert (plan.steps, plan.delivery_time_s, plan.energy_j) == ((), 0.0, 0)
