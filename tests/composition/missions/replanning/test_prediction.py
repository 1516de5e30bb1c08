"""Predictions from a drone's last position and charge."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.missions.replanning.prediction import Load, PredictedStep, predict
from skyway_composition.missions.replanning.situation import Whereabouts
from skyway_composition.planning.problem_for import with_margin

from skyway.contracts.flight_step import DeliverStep, FlightStep, FlyStep, RechargeStep, WaitStep
from skyway.drone.models import DRONE_MODELS
from skyway.geo import Position
from skyway.ids import DroneModelId, PackageId, StationId
from skyway.units import ms_to_moment

MODEL = DRONE_MODELS[DroneModelId("paper-scenario")]
START_MS = 1_772_000_000_000
P1 = PackageId("p1")
LOAD = Load({P1: 0.4}, frozenset({P1}))
#: 23 m/s, so that 2,300 m take 100 s; the battery is empty after 33 km.
FLIGHT_S = 100.0


def at(second: float) -> Any:
    return ms_to_moment(START_MS) + timedelta(seconds=second)


def fly(step_id: int, start_s: float, *, lands: bool = True) -> FlyStep:
    return FlyStep(
        step_id=step_id,
        planned_start_at=at(start_s),
        planned_end_at=at(start_s + FLIGHT_S),
        from_id=StationId("a"),
        to_id=StationId("b"),
        from_position=Position(0.0, 0.0),
        to_position=Position(0.0206844, 0.0),
        length_m=2_300.0,
        lands=lands,
    )


def recharge(step_id: int, start_s: float, end_s: float, *, until_soc: float) -> RechargeStep:
    return RechargeStep(
        step_id=step_id,
        planned_start_at=at(start_s),
        planned_end_at=at(end_s),
        station_id=StationId("b"),
        pad=0,
        not_before_at=at(start_s),
        until_soc=until_soc,
        not_after_at=at(end_s),
    )


def where(
    *, at_s: float, next_step: int = 1, released: int = 0, soc: float = 0.9, done: float = 0.0
) -> Whereabouts:
    return Whereabouts(
        at_ms=START_MS + round(at_s * 1000),
        soc=soc,
        position=Position(0.0206844 * done, 0.0),
        station_id=None if released else StationId("a"),
        next_step=next_step,
        released_through=released,
        free_ms=START_MS + round(at_s * 1000),
    )


def predicted(steps: list[FlightStep], now: Whereabouts, now_s: float) -> list[PredictedStep]:
    now_ms = START_MS + round(now_s * 1000)
    return list(predict(steps, now, model=MODEL, load=LOAD, now_ms=now_ms))


def seconds(step: PredictedStep) -> tuple[float, float]:
    return (step.start_ms - START_MS) / 1000, (step.end_ms - START_MS) / 1000


def test_a_standing_drone_begins_no_step_before_its_planned_time() -> None:
    (flight,) = predicted([fly(1, 50.0)], where(at_s=0.0), 10.0)

    assert seconds(flight) == (50.0, 150.0)


def test_a_late_drone_begins_its_next_step_now() -> None:
    (flight,) = predicted([fly(1, 50.0)], where(at_s=0.0), 80.0)

    assert seconds(flight) == (80.0, 180.0)


def test_a_flight_under_way_takes_the_time_for_its_remaining_length() -> None:
    half = where(at_s=60.0, released=1, done=0.5)

    (flight,) = predicted([fly(1, 0.0)], half, 60.0)

    assert seconds(flight)[1] == pytest.approx(110.0, abs=0.1)
    whole = predicted([fly(1, 0.0)], where(at_s=0.0), 0.0)[0]
    assert 0.9 - flight.soc_end == pytest.approx((0.9 - whole.soc_end) / 2, rel=1e-3)


def test_a_flight_under_way_has_not_ended_before_now() -> None:
    (flight,) = predicted([fly(1, 0.0)], where(at_s=0.0, released=1), 130.0)

    assert seconds(flight)[1] == 130.0


def test_after_flying_over_a_station_the_next_flight_begins_immediately() -> None:
    over, landing = predicted(
        [fly(1, 0.0, lands=False), fly(2, 500.0)], where(at_s=0.0, released=2), 0.0
    )

    assert over.end_ms == landing.start_ms


def test_a_recharge_ends_at_its_planned_charge() -> None:
    (charged,) = predicted([recharge(1, 0.0, 2_000.0, until_soc=1.0)], where(at_s=0.0), 0.0)

    assert seconds(charged)[1] == pytest.approx(774.0)
    assert (charged.soc_end, charged.is_short) == (1.0, False)


def test_a_recharge_takes_as_long_as_its_pad_needs() -> None:
    step = recharge(1, 0.0, 2_000.0, until_soc=1.0)
    slow = step.model_copy(update={"power_w": 0.1 * MODEL.battery_j / 1_548.0})

    (charged,) = predicted([slow], where(at_s=0.0), 0.0)

    assert seconds(charged)[1] == pytest.approx(1_548.0)


def test_a_late_recharge_is_short() -> None:
    (charged,) = predicted([recharge(1, 0.0, 774.0, until_soc=1.0)], where(at_s=0.0), 387.0)

    assert charged.is_short
    assert not charged.is_lost
    assert charged.soc_end == pytest.approx(0.95)


def test_a_recharge_whose_session_is_over_is_lost() -> None:
    (charged,) = predicted([recharge(1, 0.0, 774.0, until_soc=1.0)], where(at_s=0.0), 774.0)

    assert charged.is_lost
    assert charged.soc_end == 0.9


def test_a_wait_reduces_a_delay() -> None:
    wait = WaitStep(
        step_id=1,
        planned_start_at=at(0.0),
        planned_end_at=at(100.0),
        station_id=StationId("a"),
        until_at=at(100.0),
    )

    _, flight = predicted([wait, fly(2, 100.0)], where(at_s=0.0), 60.0)

    assert seconds(flight)[0] == 100.0


def test_a_delivered_package_is_no_longer_on_board() -> None:
    deliver = DeliverStep(
        step_id=1,
        planned_start_at=at(0.0),
        planned_end_at=at(30.0),
        station_id=StationId("a"),
        package_ids=(P1,),
        dropoff_s=30.0,
    )

    handed_over, flight = predicted([deliver, fly(2, 30.0)], where(at_s=0.0), 0.0)

    assert handed_over.load.carried == frozenset()
    assert flight.load.mass_kg == 0.0


def test_a_flight_beyond_the_charge_ends_below_zero() -> None:
    (flight,) = predicted([fly(1, 0.0)], where(at_s=0.0, soc=0.01), 0.0)

    assert flight.soc_end < 0.0


def test_flights_after_the_next_recharge_have_their_own_energy_use() -> None:
    steps: list[FlightStep] = [
        fly(1, 0.0),
        recharge(2, 100.0, 900.0, until_soc=0.9),
        fly(3, 1_000.0),
    ]
    much, little = with_margin(MODEL, 1.0), with_margin(MODEL, 0.1)

    first, charged, later = predict(
        steps, where(at_s=0.0), model=much, load=LOAD, now_ms=START_MS, later=little
    )

    used, used_later = 0.9 - first.soc_end, charged.soc_end - later.soc_end
    assert used / used_later == pytest.approx(2.0 / 1.1)
