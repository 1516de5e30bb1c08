"""The capacity of a battery, learned from precise charges at rest, and how fast it charges."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skyway_drone_agent.analysis.battery_health import BatteryHealth, ChargeRate
from skyway_drone_agent.vehicle import BatteryPack, Reading, StepRun

from skyway.contracts.flight_step import RechargeStep
from skyway.drone.charging import soc_after_recharge
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.geo import Position
from skyway.ids import StationId

START = datetime(2026, 3, 1, 12, tzinfo=UTC)
PACK = BatteryPack()
RATED_J = 1_000_000.0


def make_reading(at_s: float, soc: float, *, capacity: float, current_a: float = 0.0) -> Reading:
    open_v = PACK.open_voltage_v(soc)
    return Reading(
        at=START + timedelta(seconds=at_s),
        position=Position(-98.0, 30.0),
        ground_mps=(0.0, 0.0),
        air_mps=(0.0, 0.0),
        voltage_v=open_v - current_a * PACK.resistance_ohm,
        current_a=current_a,
        consumed_j=(1.0 - soc) * RATED_J * capacity,
        cell_low_v=open_v / 6 - 0.05,
        cell_high_v=open_v / 6 + 0.05,
        temperature_c=25.0,
    )


def cycle(health: BatteryHealth, *, capacity: float, low: float, from_s: float) -> None:
    """A rest when full, a flight, a rest, a charge, and a rest."""
    for at_s, soc, current_a in (
        (0, 1.0, 0.0),
        (30, 1.0, 0.0),
        (60, 0.95, 30.0),
        (600, low + 0.01, 30.0),
        (660, low, 0.0),
        (690, low, 0.0),
        (700, low + 0.01, -20.0),
        (3_600, 0.99, -20.0),
    ):
        reading = make_reading(from_s + at_s, soc, capacity=capacity, current_a=current_a)
        health.update(reading, resistance_ohm=PACK.resistance_ohm)


def test_a_new_battery_has_full_health() -> None:
    health = BatteryHealth(PACK, rated_j=RATED_J)

    for count in range(3):
        cycle(health, capacity=1.0, low=0.65, from_s=4_000 * count)

    assert health.state_of_health == pytest.approx(1.0, abs=1e-9)


@settings(max_examples=30)
@given(capacity=st.floats(0.5, 0.98))
def test_the_health_comes_nearer_to_the_capacity_with_every_cycle(capacity: float) -> None:
    health = BatteryHealth(PACK, rated_j=RATED_J)
    wrong = [1.0 - capacity]

    for count in range(12):
        cycle(health, capacity=capacity, low=0.62, from_s=4_000 * count)
        wrong.append(abs(health.state_of_health - capacity))

    assert all(after <= before + 1e-9 for before, after in pairwise(wrong))
    assert wrong[1] > 0.05 * wrong[0]
    assert wrong[-1] < 0.02 + 0.1 * wrong[0]


def test_charges_on_the_flat_part_of_the_curve_are_ignored() -> None:
    health = BatteryHealth(PACK, rated_j=RATED_J)

    for count in range(5):
        cycle(health, capacity=0.7, low=0.4, from_s=4_000 * count)

    assert health.state_of_health == 1.0


def test_the_difference_of_the_cells_is_smoothed() -> None:
    health = BatteryHealth(PACK, rated_j=RATED_J)

    health.update(make_reading(0, 0.9, capacity=1.0), resistance_ohm=0.02)

    assert health.cell_spread_v == pytest.approx(0.1)


def recharged(
    *,
    factor: float,
    free_after_s: float = 0.0,
    until_soc: float = 0.8,
    power_w: float | None = None,
) -> ChargeRate:
    """A recharge from 0.2 at so many times the model's rate, beside an occupied pad at first."""
    rate = ChargeRate(DJI_MATRICE_300_RTK)
    run = make_recharge(power_w)
    for at_s in range(0, 20_000, 30):
        charged_s = max(0.0, at_s - free_after_s) * factor
        soc = soc_after_recharge(DJI_MATRICE_300_RTK, 0.2, charged_s)
        if soc >= until_soc:
            break
        reading = replace(make_reading(at_s, soc, capacity=1.0), pad_is_free=at_s >= free_after_s)
        rate.update(reading, run, soc=soc)
    rate.update(make_reading(30_000, until_soc, capacity=1.0), None, soc=until_soc)
    return rate


def make_recharge(power_w: float | None) -> StepRun:
    until_at = START + timedelta(days=1)
    step = RechargeStep(
        step_id=1,
        station_id=StationId("a"),
        pad=0,
        until_soc=1.0,
        not_before_at=START,
        not_after_at=until_at,
        planned_start_at=START,
        planned_end_at=until_at,
        power_w=power_w,
    )
    return StepRun(step, START, soc=0.2, load_kg=0.0, position=Position(-98.0, 30.0))


@pytest.mark.parametrize("factor", [0.5, 0.8, 1.0, 1.1])
def test_the_charge_rate_is_measured_against_the_curve(factor: float) -> None:
    assert recharged(factor=factor).factor == pytest.approx(factor, rel=1e-6)
    assert recharged(factor=factor, until_soc=0.95).factor == pytest.approx(factor, rel=1e-6)


def test_time_beside_an_occupied_pad_does_not_count_as_slow_charging() -> None:
    assert recharged(factor=0.9, free_after_s=2_000.0).factor == pytest.approx(0.9, rel=1e-6)


def test_a_short_recharge_is_not_measured() -> None:
    assert recharged(factor=0.9, until_soc=0.25).factor is None


def test_a_recharge_on_a_pad_that_slows_the_drone_is_not_measured() -> None:
    assert recharged(factor=0.5, power_w=200.0).factor is None
    assert recharged(factor=0.8, power_w=1_000.0).factor == pytest.approx(0.8, rel=1e-6)
