"""The estimated charge: exact without errors, and honest about how wrong it may be with them."""

import random
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skyway_drone_agent.analysis.battery_charge import BatteryEstimate
from skyway_drone_agent.vehicle import BatteryPack, Reading

from skyway.geo import Position

START = datetime(2026, 3, 1, 12, tzinfo=UTC)
PACK = BatteryPack()
CAPACITY_J = 1_000_000.0
FLYING_W = 600.0


def make_reading(
    at_s: float,
    soc: float,
    *,
    power_w: float = 0.0,
    gain: float = 1.0,
    noise_v: float = 0.0,
    resistance_ohm: float = PACK.resistance_ohm,
) -> Reading:
    """What a battery with this charge shows; its counter errs by `gain`."""
    current_a = PACK.current_a(soc, power_w)
    voltage_v = PACK.open_voltage_v(soc) - current_a * resistance_ohm + noise_v
    return Reading(
        at=START + timedelta(seconds=at_s),
        position=Position(-98.0, 30.0),
        ground_mps=(0.0, 0.0),
        air_mps=(0.0, 0.0),
        voltage_v=voltage_v,
        current_a=current_a * gain,
        consumed_j=(1.0 - soc) * CAPACITY_J * gain,
        cell_low_v=voltage_v / 6,
        cell_high_v=voltage_v / 6,
        temperature_c=25.0,
    )


def flight(seconds: int) -> Iterator[tuple[int, float, float]]:
    """Each second's charge and power: a minute's rest, then a flight."""
    soc = 1.0
    for at_s in range(seconds):
        power_w = FLYING_W if at_s >= 60 else 0.0
        yield at_s, soc, power_w
        soc -= power_w / CAPACITY_J


def update(estimate: BatteryEstimate, reading: Reading) -> None:
    estimate.update(reading, capacity_j=CAPACITY_J, capacity_error=0.0)


def test_without_errors_the_estimate_is_the_charge() -> None:
    estimate = BatteryEstimate(PACK, soc=1.0, error=0.02)

    wrong = []
    for at_s, soc, power_w in flight(1_200):
        update(estimate, make_reading(at_s, soc, power_w=power_w))
        wrong.append(abs(estimate.soc - soc))

    assert max(wrong) < 1e-9


@settings(max_examples=60)
@given(soc=st.floats(0.03, 1.0), believed=st.floats(0.0, 1.0))
def test_at_rest_the_estimate_finds_the_charge_from_any_start(soc: float, believed: float) -> None:
    estimate = BatteryEstimate(PACK, soc=believed, error=0.3)

    for at_s in range(0, 14_400, 30):
        update(estimate, make_reading(at_s, soc))

    assert estimate.soc == pytest.approx(soc, abs=0.01)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32), gain=st.floats(0.95, 1.05), start=st.floats(-0.05, 0.05))
def test_the_charge_stays_within_three_deviations_of_the_estimate(
    seed: int, gain: float, start: float
) -> None:
    chance = random.Random(seed)
    estimate = BatteryEstimate(PACK, soc=min(1.0, 1.0 + start), error=0.03)

    for at_s, soc, power_w in flight(1_300):
        noise_v = chance.gauss(0.0, 0.1)
        reading = make_reading(
            at_s, soc, power_w=power_w, gain=gain, noise_v=noise_v, resistance_ohm=0.03
        )
        update(estimate, reading)
        assert abs(estimate.soc - soc) <= 3 * estimate.error


def test_a_wrong_counter_is_corrected_once_the_drone_rests() -> None:
    estimate = BatteryEstimate(PACK, soc=1.0, error=0.02)
    soc = 1.0
    for at_s, soc, power_w in flight(600):
        update(estimate, make_reading(at_s, soc, power_w=power_w, gain=0.9))
    after_flight = abs(estimate.soc - soc)

    for at_s in range(600, 7_800, 30):
        update(estimate, make_reading(at_s, soc, gain=0.9))

    assert after_flight > 0.02
    assert abs(estimate.soc - soc) < 0.005


def test_a_counter_reset_raises_the_error_and_uses_no_charge() -> None:
    estimate = BatteryEstimate(PACK, soc=0.5, error=0.01)
    update(estimate, make_reading(0, 0.5))
    away = make_reading(1, 0.5)

    update(
        estimate,
        Reading(
            **{name: getattr(away, name) for name in Reading.__slots__}
            | {
                "consumed_j": 3 * CAPACITY_J,
            }
        ),
    )

    assert estimate.soc == pytest.approx(0.5)
    assert estimate.error > 0.1


def test_the_resistance_shows_when_the_load_changes() -> None:
    estimate = BatteryEstimate(PACK, soc=1.0, error=0.02)

    for at_s, soc, power_w in flight(120):
        update(estimate, make_reading(at_s, soc, power_w=power_w, resistance_ohm=0.06))

    assert estimate.resistance_ohm == pytest.approx(0.06, rel=0.1)
