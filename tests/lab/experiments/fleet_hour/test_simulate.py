"""The calendars of a simulated hour, checked against a simple grid of minutes."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from statistics import mean
from typing import Final

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skyway_lab.experiments.fleet_hour.calendars import (
    CHAINED,
    MODEL,
    ONE_AT_A_TIME,
    POLICIES,
    HourMission,
    Policy,
)
from skyway_lab.experiments.fleet_hour.cases import HOUR_MS, PLACES, Load, Place, draw_case
from skyway_lab.experiments.fleet_hour.measures import FlownHour, simulate

from skyway.delivery.plan import Fly, Recharge
from skyway.ids import StationId
from skyway.scheduling.trip import PlacedStep

MINUTE_MS: Final = 60_000
#: More than a drone charges in a few milliseconds: slots are rounded to whole milliseconds.
CHARGE_ROUNDING: Final = 1e-6
LOAD: Final = Load(drones=3, requests=10)

places = st.sampled_from(PLACES)
policies = st.sampled_from(POLICIES)
loads = st.builds(Load, drones=st.integers(1, 5), requests=st.integers(1, 10))
seeds = st.integers(0, 2**32)


def flown(place: Place, load: Load, policy: Policy, seed: int) -> FlownHour:
    return simulate(draw_case(place, load, seed=seed), policy)


def mean_delay_ms(hour: FlownHour) -> float:
    return mean(each.served_ms - each.request.asked_ms for each in hour.missions)


def steps_of(calendar: Sequence[HourMission]) -> list[PlacedStep]:
    return [step for mission in calendar for step in mission.steps()]


def minutes(calendars: Sequence[Sequence[HourMission]]) -> Iterator[int]:
    ends_ms = [step.end_ms for calendar in calendars for step in steps_of(calendar)]
    yield from range(0, max(ends_ms, default=0), MINUTE_MS)


def at(steps: Sequence[PlacedStep], moment_ms: int) -> list[PlacedStep]:
    """The steps under way at a moment."""
    return [each for each in steps if each.start_ms <= moment_ms < each.end_ms]


def begins_at(step: PlacedStep) -> StationId:
    return step.step.from_id if isinstance(step.step, Fly) else step.step.station_id


def ends_at(step: PlacedStep) -> StationId:
    return step.step.to_id if isinstance(step.step, Fly) else step.step.station_id


@settings(max_examples=25, deadline=None)
@given(places, loads, policies, seeds)
def test_no_drone_is_in_two_places(place: Place, load: Load, policy: Policy, seed: int) -> None:
    calendars = flown(place, load, policy, seed).calendars

    for home, calendar in zip(calendars.case.homes, calendars.missions, strict=True):
        steps = steps_of(calendar)
        assert all(len(at(steps, minute)) <= 1 for minute in minutes([calendar]))
        assert all(one.end_ms <= other.start_ms + 1 for one, other in pairwise(steps))
        assert all(ends_at(one) == begins_at(other) for one, other in pairwise(steps))
        assert not steps or begins_at(steps[0]) == home


@settings(max_examples=25, deadline=None)
@given(places, loads, policies, seeds)
def test_no_pad_is_used_or_reserved_by_two_drones(
    place: Place, load: Load, policy: Policy, seed: int
) -> None:
    calendars = flown(place, load, policy, seed).calendars.missions

    for minute in minutes(calendars):
        used = [
            (step.step.station_id, step.step.pad)
            for calendar in calendars
            for step in at(steps_of(calendar), minute)
            if isinstance(step.step, Recharge)
        ]
        reserved = [
            (pad.station_id, pad.pad)
            for calendar in calendars
            for mission in calendar
            for pad in mission.pads
            if pad.start_ms <= minute < pad.end_ms
        ]
        assert len(used) == len(set(used))
        assert len(reserved) == len(set(reserved))
        assert set(used) <= set(reserved)


@settings(max_examples=25, deadline=None)
@given(places, loads, policies, seeds)
def test_no_mission_begins_with_more_charge_than_its_drone_has(
    place: Place, load: Load, policy: Policy, seed: int
) -> None:
    calendars = flown(place, load, policy, seed).calendars.missions

    for calendar in calendars:
        soc = MODEL.top_soc
        for mission in calendar:
            assert mission.slot.soc <= soc + CHARGE_ROUNDING
            for placed in mission.steps():
                if isinstance(placed.step, Recharge):
                    assert placed.step.soc_start <= soc + CHARGE_ROUNDING
                if isinstance(placed.step, Fly | Recharge):
                    soc = placed.step.soc_end


@pytest.mark.parametrize("policy", POLICIES, ids=lambda policy: policy.name)
def test_the_same_seed_gives_the_same_hour(policy: Policy) -> None:
    one, other = (flown("city", LOAD, policy, seed=1) for _ in range(2))

    for calendar, again in zip(one.calendars.missions, other.calendars.missions, strict=True):
        assert steps_of(calendar) == steps_of(again)
        assert [each.pads for each in calendar] == [each.pads for each in again]
    assert one.unserved == other.unserved


@pytest.mark.parametrize("place", PLACES)
def test_a_chained_fleet_serves_everybody_and_sooner_than_one_mission_at_a_time(
    place: Place,
) -> None:
    case = draw_case(place, LOAD, seed=1)
    chained = simulate(case, CHAINED, longest_wait_ms=HOUR_MS)
    before = simulate(case, ONE_AT_A_TIME, longest_wait_ms=HOUR_MS)
    before_without_limit = simulate(case, ONE_AT_A_TIME)

    assert not chained.unserved
    assert before.unserved
    assert not before_without_limit.unserved
    assert mean_delay_ms(chained) < mean_delay_ms(before_without_limit)


def test_a_request_is_booked_when_it_comes_if_it_can_be_booked_behind_a_busy_drone() -> None:
    chained = simulate(draw_case("city", Load(1, 5), seed=1), CHAINED, longest_wait_ms=0)

    assert not chained.unserved
    assert [each.request.number for each in chained.missions] == [0, 1, 2, 3, 4]
