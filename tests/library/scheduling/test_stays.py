"""Where a drone stands after its last hand-over, and where and when its next mission begins."""

import pytest

from skyway.delivery.plan import Deliver, Fly, Plan, PlanStatus, Recharge, Step, Wait
from skyway.ids import PackageId, StationId
from skyway.scheduling.stays import (
    Slot,
    Stay,
    first_slot,
    read_stays,
    slot_after,
    stay_to_begin_at,
    stays_json,
    stays_of_standby,
)

A, B, C = map(StationId, "abc")
START_MS = 1_000_000


def fly(start: StationId, end: StationId, *, start_s: float, end_s: float, soc: float) -> Fly:
    return Fly.model_validate(
        {
            "from": start,
            "to": end,
            "start_s": start_s,
            "end_s": end_s,
            "load_kg": 0.0,
            "energy_j": 1.0,
            "soc_end": soc,
        }
    )


def plan_of(*steps: Step, lasts_s: float) -> Plan:
    return Plan(status=PlanStatus.OPTIMAL, delivery_time_s=lasts_s, steps=steps)


#: A flight from a to b in 100 s, and a hand-over of 20 s.
DELIVERY = plan_of(
    fly(A, B, start_s=0, end_s=100, soc=0.6),
    Deliver(station_id=B, package_ids=(PackageId("p"),), start_s=100, end_s=120),
    lasts_s=120,
)


def test_a_drone_without_standby_stays_where_it_has_delivered() -> None:
    assert stays_of_standby(DELIVERY, start_ms=START_MS, soc=0.9) == (
        Stay(B, START_MS + 120_000, None, 0.6, 0.6),
    )


def test_a_drone_can_begin_before_it_flies_home_and_while_it_charges_there() -> None:
    home = plan_of(fly(B, A, start_s=0, end_s=100, soc=0.4), lasts_s=100)
    charge = Recharge(station_id=A, pad=0, start_s=130, end_s=330, soc_start=0.4, soc_end=0.99)

    stays = stays_of_standby(
        DELIVERY, start_ms=START_MS, soc=0.9, home_plan=home, home_recharge=charge
    )

    served_ms = START_MS + 120_000
    assert stays == (
        Stay(B, served_ms, served_ms, 0.6, 0.6),
        Stay(A, served_ms + 100_000, served_ms + 130_000, 0.4, 0.4),
        Stay(A, served_ms + 130_000, served_ms + 330_000, 0.4, 0.99),
        Stay(A, served_ms + 330_000, None, 0.99, 0.99),
    )


def test_a_station_that_the_drone_flies_over_is_no_stay() -> None:
    home = plan_of(
        fly(B, C, start_s=0, end_s=50, soc=0.5),
        fly(C, A, start_s=50, end_s=100, soc=0.4),
        lasts_s=100,
    )

    stays = stays_of_standby(DELIVERY, start_ms=START_MS, soc=0.9, home_plan=home)

    assert [each.station_id for each in stays] == [B, A]


def test_a_landing_between_two_flights_is_a_stay() -> None:
    home = plan_of(
        fly(B, C, start_s=0, end_s=50, soc=0.5),
        Wait(station_id=C, start_s=50, end_s=60),
        fly(C, A, start_s=60, end_s=100, soc=0.4),
        lasts_s=100,
    )

    stays = stays_of_standby(DELIVERY, start_ms=START_MS, soc=0.9, home_plan=home)

    at_c = [each for each in stays if each.station_id == C]
    assert at_c[0] == Stay(C, START_MS + 170_000, START_MS + 180_000, 0.5, 0.5)


def test_without_a_known_charge_there_are_no_stays() -> None:
    nothing = plan_of(
        Deliver(station_id=B, package_ids=(PackageId("p"),), start_s=0, end_s=20), lasts_s=20
    )

    assert stays_of_standby(nothing, start_ms=START_MS, soc=None) == ()


@pytest.mark.parametrize(("moment_ms", "soc"), [(0, 0.2), (50, 0.4), (100, 0.6), (200, 0.6)])
def test_the_charge_rises_while_the_drone_charges(moment_ms: int, soc: float) -> None:
    assert Stay(A, 0, 100, 0.2, 0.6).soc_at(moment_ms) == pytest.approx(soc)


def test_stays_are_the_same_after_a_round_trip_through_json() -> None:
    stays = (Stay(A, 0, 100, 0.2, 0.6), Stay(B, 100, None, 0.6, 0.6))

    assert read_stays(stays_json(stays)) == stays


HOME = StationId("home")
#: The drone delivers at b at 100, leaves immediately, charges at home from 200 to 400.
STAYS = (
    Stay(B, 100, 100, 0.5, 0.5),
    Stay(HOME, 200, 400, 0.3, 0.9),
    Stay(HOME, 400, None, 0.9, 0.9),
)


@pytest.mark.parametrize(
    ("not_before_ms", "slot"),
    [
        (0, Slot(B, 100, 0.5)),
        (100, Slot(B, 100, 0.5)),
        (101, Slot(HOME, 200, 0.3)),
        (300, Slot(HOME, 300, 0.6)),
        (1_000, Slot(HOME, 1_000, 0.9)),
    ],
)
def test_the_first_slot_is_at_the_next_landing_or_within_a_stay(
    not_before_ms: int, slot: Slot
) -> None:
    found = first_slot(STAYS, not_before_ms=not_before_ms)

    assert found is not None
    assert (found.station_id, found.at_ms) == (slot.station_id, slot.at_ms)
    assert found.soc == pytest.approx(slot.soc)


def test_without_stays_there_is_no_slot() -> None:
    assert first_slot((), not_before_ms=0) is None
    assert slot_after((), not_before_ms=0, hand_over_ms=30) is None


def test_a_slot_after_a_mission_includes_the_hand_over() -> None:
    assert slot_after(STAYS, not_before_ms=0, hand_over_ms=30) == Slot(B, 130, 0.5)
    assert slot_after(STAYS, not_before_ms=1_000, hand_over_ms=30) == Slot(HOME, 1_000, 0.9)


@pytest.mark.parametrize(
    ("planned", "not_left_before_ms", "stay"),
    [
        (Slot(B, 100, 0.5), 50, STAYS[0]),
        (Slot(B, 130, 0.5), 50, STAYS[0]),  # it waits at b for its next mission
        (Slot(B, 130, 0.5), 101, None),  # it has left b
        (Slot(B, 90, 0.5), 50, None),  # it is not there yet
        (Slot(B, 100, 0.6), 50, None),  # it has too little charge
        (Slot(HOME, 300, 0.6), 50, STAYS[1]),
        (Slot(StationId("c"), 300, 0.1), 50, None),
    ],
)
def test_a_mission_fits_where_its_drone_stands_in_time_and_charged(
    planned: Slot, not_left_before_ms: int, stay: Stay | None
) -> None:
    assert stay_to_begin_at(STAYS, planned, not_left_before_ms=not_left_before_ms) == stay
