import pytest

from skyway.delivery.plan import Deliver, Fly, PickUp, Plan, PlanStatus, Recharge, Wait
from skyway.ids import PackageId, StationId
from skyway.scheduling.trip import (
    NOTHING_TO_DELIVER,
    BookedPad,
    Trip,
    merged,
    shortened_plan,
    shortened_step,
    soc_after,
)

A, B = StationId("a"), StationId("b")


def recharge(start_s: float, end_s: float, pad: int = 0) -> Recharge:
    return Recharge(station_id=A, pad=pad, start_s=start_s, end_s=end_s, soc_start=0.1, soc_end=0.6)


def make_trip(*steps: Recharge, home_recharge: Recharge | None = None) -> Trip:
    plan = Plan(status=PlanStatus.FEASIBLE, delivery_time_s=10.0, steps=steps)
    return Trip(
        start_ms=1_000_000,
        plan=plan,
        home_start_ms=1_010_000,
        home_plan=NOTHING_TO_DELIVER,
        home_recharge=home_recharge,
    )


def test_sessions_are_rounded_outward_to_whole_milliseconds() -> None:
    trip = make_trip(recharge(0.0015, 4.0001))

    assert trip.booked_pads == (BookedPad(A, 0, 1_000_001, 1_004_001),)


def test_a_moment_within_rounding_of_a_millisecond_is_that_millisecond() -> None:
    trip = make_trip(recharge(1.001, 4.0009999999999994))

    assert trip.booked_pads == (BookedPad(A, 0, 1_001_001, 1_004_001),)


def test_sessions_that_touch_within_a_millisecond_are_booked_as_one() -> None:
    trip = make_trip(recharge(1.0, 2.0005), recharge(2.0005, 3.0))

    assert trip.booked_pads == (BookedPad(A, 0, 1_001_000, 1_003_000),)


def test_a_session_without_length_is_not_booked() -> None:
    assert make_trip(recharge(1.0, 1.0)).booked_pads == ()


def test_the_drone_is_released_when_it_is_charged_at_home() -> None:
    trip = make_trip(recharge(1.0, 2.0), home_recharge=recharge(5.0, 6.5))

    assert trip.released_ms == 1_016_500


def test_the_way_home_has_no_pick_up_and_no_deliver_step() -> None:
    home = Plan(
        status=PlanStatus.FEASIBLE,
        delivery_time_s=3.0,
        steps=(
            PickUp(station_id=A, package_ids=(PackageId("home"),), start_s=0, end_s=0),
            Fly(from_id=A, to_id=B, start_s=0, end_s=3, load_kg=0, energy_j=9, soc_end=0.4),
            Deliver(station_id=B, package_ids=(PackageId("home"),), start_s=3, end_s=3),
        ),
    )
    trip = Trip(
        start_ms=0, plan=NOTHING_TO_DELIVER, home_start_ms=5, home_plan=home, home_recharge=None
    )

    assert [placed.step.kind for placed in trip.steps()] == ["FLY"]
    assert trip.released_ms == 3_005
    assert soc_after(home, 0.9) == 0.4


def held(station: str, pad: int, start_ms: int, end_ms: int) -> BookedPad:
    return BookedPad(StationId(station), pad, start_ms, end_ms)


def test_sessions_that_touch_on_one_pad_are_one_reservation() -> None:
    sessions = [held("a", 0, 10, 20), held("a", 0, 0, 10), held("a", 0, 19, 30)]

    assert merged(sessions) == (held("a", 0, 0, 30),)


def test_sessions_with_a_gap_or_on_different_pads_stay_separate() -> None:
    sessions = [
        held("b", 0, 0, 10),
        held("a", 1, 10, 20),
        held("a", 0, 0, 10),
        held("a", 0, 11, 12),
    ]

    assert merged(sessions) == tuple(sorted(sessions))


def test_a_session_within_another_adds_nothing() -> None:
    assert merged([held("a", 0, 0, 30), held("a", 0, 5, 10)]) == (held("a", 0, 0, 30),)


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
TO_HOME = Plan(status=PlanStatus.OPTIMAL, delivery_time_s=350.0, steps=(FLIGHT, PAUSE, CHARGE))


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
    plan = shortened_plan(TO_HOME, 120.0)

    assert [each.end_s for each in plan.steps] == [100.0, 120.0]
    assert plan.delivery_time_s == 120.0
    assert (plan.energy_j, plan.flight_s) == (5.0, 100.0)
    assert (plan.waiting_s, plan.recharging_s) == (20.0, 0.0)


def test_a_plan_that_ends_before_its_start_is_empty() -> None:
    plan = shortened_plan(TO_HOME, 0.0)

    assert (plan.steps, plan.delivery_time_s, plan.energy_j) == ((), 0.0, 0)
