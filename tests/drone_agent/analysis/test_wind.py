"""The wind as a drone feels it, and what it does to a flight."""

import math
import random
from datetime import UTC, datetime, timedelta

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skyway_drone_agent.analysis.wind import WindEstimate, ground_speed_mps
from skyway_drone_agent.vehicle import Reading

from skyway.geo import Position

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
    chance, estimate = random.Random(seed), WindEstimate()
    found = None

    for at_s in range(300):
        felt = (east + chance.gauss(0.0, 1.0), north + chance.gauss(0.0, 1.0))
        found = estimate.update(make_reading(at_s, wind_mps=felt), is_flying=True)

    assert found is not None
    assert math.dist(found, (east, north)) < 0.8


def test_the_wind_is_followed_when_it_turns() -> None:
    estimate = WindEstimate()
    for at_s in range(300):
        estimate.update(make_reading(at_s, wind_mps=(8.0, 0.0)), is_flying=True)

    for at_s in range(300, 600):
        found = estimate.update(make_reading(at_s, wind_mps=(0.0, 8.0)), is_flying=True)

    assert found == pytest.approx((0.0, 8.0), abs=0.1)


def test_readings_on_the_ground_or_without_gps_do_not_change_the_wind() -> None:
    estimate = WindEstimate()

    standing = estimate.update(make_reading(0, wind_mps=(5.0, 0.0)), is_flying=False)
    blind = estimate.update(make_reading(1, wind_mps=(5.0, 0.0), has_gps=False), is_flying=True)

    assert (standing, blind) == (None, None)


def test_an_old_wind_estimate_is_dropped() -> None:
    estimate = WindEstimate()
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
