"""The wind as a drone feels it, and consumption against plan, and how long both are believed."""

import math
import random
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skyway_drone_agent.analysis.flight_estimates import (
    AHEAD_SMOOTHED_OVER_S,
    GUSTS_SMOOTHED_OVER_S,
    EnergyUseMonitor,
    WindEstimate,
    ground_speed_mps,
)
from skyway_drone_agent.analysis.leg import Leg, leg_of
from skyway_drone_agent.vehicle import Reading

from skyway.geo import Position, point_between
from skyway.ids import MissionId

START = datetime(2026, 3, 1, 12, tzinfo=UTC)

components = st.floats(-12.0, 12.0)


def make_reading(
    at_s: float,
    *,
    air_mps: tuple[float, float] = (20.0, 0.0),
    wind_mps: tuple[float, float] = (0.0, 0.0),
    has_gps: bool = True,
) -> Reading:
    return Reading(
        at=START + timedelta(seconds=at_s),
        position=Position(-98.0, 30.0),
        ground_mps=(air_mps[0] + wind_mps[0], air_mps[1] + wind_mps[1]),
        air_mps=air_mps,
        voltage_v=23.0,
        current_a=26.0,
        consumed_j=0.0,
        cell_low_v=3.8,
        cell_high_v=3.8,
        temperature_c=25.0,
        has_gps=has_gps,
    )


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32), east=components, north=components)
def test_a_steady_wind_is_found_through_noise(seed: int, east: float, north: float) -> None:
    chance, estimate = random.Random(seed), WindEstimate(smoothed_over_s=45.0)
    found = None

    for at_s in range(300):
        felt = (east + chance.gauss(0.0, 1.0), north + chance.gauss(0.0, 1.0))
        found = estimate.update(make_reading(at_s, wind_mps=felt), is_flying=True)

    assert found is not None
    assert math.dist(found, (east, north)) < 0.8


def test_the_wind_is_followed_when_it_turns() -> None:
    estimate = WindEstimate(smoothed_over_s=45.0)
    for at_s in range(300):
        estimate.update(make_reading(at_s, wind_mps=(8.0, 0.0)), is_flying=True)

    for at_s in range(300, 600):
        found = estimate.update(make_reading(at_s, wind_mps=(0.0, 8.0)), is_flying=True)

    assert found == pytest.approx((0.0, 8.0), abs=0.1)


def test_a_gust_of_a_minute_hardly_counts_for_the_flights_ahead() -> None:
    now, ahead = (
        WindEstimate(smoothed_over_s=each)
        for each in (GUSTS_SMOOTHED_OVER_S, AHEAD_SMOOTHED_OVER_S)
    )

    for at_s in range(660):
        east_mps = 8.0 if at_s >= 600 else 3.0
        reading = make_reading(at_s, wind_mps=(east_mps, 0.0))
        felt, lasting = (each.update(reading, is_flying=True) for each in (now, ahead))

    assert felt is not None
    assert lasting is not None
    assert felt[0] > 6.5
    assert lasting[0] < 4.3


def test_readings_on_the_ground_or_without_gps_do_not_change_the_wind() -> None:
    estimate = WindEstimate(smoothed_over_s=45.0)

    standing = estimate.update(make_reading(0, wind_mps=(5.0, 0.0)), is_flying=False)
    blind = estimate.update(make_reading(1, wind_mps=(5.0, 0.0), has_gps=False), is_flying=True)

    assert (standing, blind) == (None, None)


def test_an_old_wind_estimate_is_dropped() -> None:
    estimate = WindEstimate(smoothed_over_s=45.0)
    estimate.update(make_reading(0, wind_mps=(5.0, 0.0)), is_flying=True)

    soon = estimate.update(make_reading(1_700), is_flying=False)
    late = estimate.update(make_reading(1_900), is_flying=False)

    assert (soon, late) == ((5.0, 0.0), None)


@settings(max_examples=100)
@given(east=components, north=components, bearing_rad=st.floats(0.0, math.tau))
def test_air_speed_and_wind_add_up_to_the_ground_speed(
    east: float, north: float, bearing_rad: float
) -> None:
    ground = ground_speed_mps(20.0, bearing_rad, (east, north))

    air = (ground * math.sin(bearing_rad) - east, ground * math.cos(bearing_rad) - north)
    assert math.hypot(*air) == pytest.approx(20.0)


def test_against_a_storm_a_drone_still_counts_as_moving() -> None:
    assert ground_speed_mps(20.0, 0.0, (0.0, -50.0)) == 2.0
    assert ground_speed_mps(20.0, 0.0, (30.0, 0.0)) == 2.0


@pytest.fixture
def leg(drone: Any, steps: Any) -> Leg:
    """A straight leg of 9.6 km to the east."""
    (step,) = steps().fly("home", "over", length_m=9_630.0, duration_s=512).made
    return leg_of(step, model=drone.model, load_kg=0.0)


def on_the_leg(leg: Leg, at_s: float, *, factor: float, share: float) -> Reading:
    """A drone that has flown this share of the leg, for `factor` times the energy."""
    return Reading(
        at=leg.step.planned_start_at + timedelta(seconds=at_s),
        position=point_between(leg.step.from_position, leg.step.to_position, fraction=share),
        ground_mps=(20.0, 0.0),
        air_mps=(20.0, 0.0),
        voltage_v=22.0,
        current_a=5.0,
        consumed_j=factor * share * leg.flight_j,
        cell_low_v=3.7,
        cell_high_v=3.7,
        temperature_c=25.0,
    )


def flown(
    leg: Leg, *, factor: float, wind_mps: tuple[float, float] | None = None
) -> EnergyUseMonitor:
    """The monitor of a drone that has flown the leg so."""
    monitor = EnergyUseMonitor(power_w=100.0)
    monitor.begin(MissionId("msn_1"), leg.step.planned_start_at)
    for at_s in range(480):
        reading = on_the_leg(leg, at_s, factor=factor, share=at_s / 481)
        monitor.update(reading, leg, wind_mps=wind_mps)
    return monitor


def test_a_higher_energy_use_is_found_within_minutes(leg: Leg) -> None:
    landed_at = leg.step.planned_start_at + timedelta(seconds=480)

    assert flown(leg, factor=1.5).factor(landed_at) == pytest.approx(1.5, rel=0.02)


def test_the_energy_for_wind_does_not_change_the_factor(leg: Leg) -> None:
    landed_at = leg.step.planned_start_at + timedelta(seconds=480)

    monitor = flown(leg, factor=20.0 / 15.0, wind_mps=(-5.0, 0.0))

    assert monitor.factor(landed_at) == pytest.approx(1.0, abs=0.01)


def test_the_factor_fades_while_the_drone_stands(leg: Leg) -> None:
    monitor, landed_at = flown(leg, factor=1.5), leg.step.planned_start_at + timedelta(seconds=480)

    believed = [monitor.factor(landed_at + timedelta(hours=hours)) for hours in (0, 1, 12)]

    assert believed == sorted(believed, reverse=True)
    assert 1.3 < believed[1] < 1.49
    assert believed[2] < 1.05


def test_the_next_mission_starts_with_the_factor_of_the_last_one(leg: Leg) -> None:
    monitor, landed_at = flown(leg, factor=1.5), leg.step.planned_start_at + timedelta(seconds=480)
    before = monitor.factor(landed_at)

    monitor.begin(MissionId("msn_2"), landed_at)

    assert monitor.factor(landed_at) == pytest.approx(before)


def test_a_landing_does_not_count(leg: Leg) -> None:
    monitor, landed_at = flown(leg, factor=1.0), leg.step.planned_start_at + timedelta(seconds=480)
    before = monitor.factor(landed_at)

    monitor.update(on_the_leg(leg, 480, factor=5.0, share=1.0), leg, wind_mps=None)
    monitor.update(on_the_leg(leg, 481, factor=9.0, share=1.0), leg, wind_mps=None)

    assert monitor.factor(landed_at) == pytest.approx(before, abs=1e-9)


def test_a_flight_without_gps_does_not_count(leg: Leg) -> None:
    monitor, landed_at = flown(leg, factor=1.0), leg.step.planned_start_at + timedelta(seconds=480)
    before = monitor.factor(landed_at)
    lost = on_the_leg(leg, 480, factor=5.0, share=0.99)
    blind = {name: getattr(lost, name) for name in Reading.__slots__} | {"has_gps": False}

    monitor.update(Reading(**blind), leg, wind_mps=None)

    assert monitor.factor(landed_at) == pytest.approx(before, abs=1e-9)


def test_the_factor_of_a_drone_that_is_blown_back_is_limited(leg: Leg) -> None:
    monitor = EnergyUseMonitor(power_w=100.0)
    for at_s in range(400):
        share = 0.5 - at_s / 1_000
        reading = on_the_leg(leg, at_s, factor=1.0, share=share)
        used_j = 100.0 * at_s
        fields = {name: getattr(reading, name) for name in Reading.__slots__}
        monitor.update(Reading(**fields | {"consumed_j": used_j}), leg, wind_mps=None)

    assert monitor.factor(leg.step.planned_start_at) == 4.0
