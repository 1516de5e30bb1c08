"""A battery's curve, read both ways."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skyway_drone_agent.vehicle import BatteryPack

PACK = BatteryPack(cells=6, resistance_ohm=0.02)


@settings(max_examples=100)
@given(soc=st.floats(0.0, 1.0))
def test_the_voltage_at_rest_shows_the_charge(soc: float) -> None:
    assert PACK.soc_at_rest(PACK.open_voltage_v(soc)) == pytest.approx(soc, abs=1e-9)


@settings(max_examples=100)
@given(soc=st.floats(0.001, 0.999))
def test_the_steepness_is_that_of_the_curve(soc: float) -> None:
    # Not across a point of the curve, where it has two.
    if min(abs(soc - known) for known, _ in PACK.curve) < 2e-6:
        return
    rise_v = PACK.open_voltage_v(soc + 1e-6) - PACK.open_voltage_v(soc - 1e-6)

    assert PACK.volts_per_soc(soc) == pytest.approx(rise_v / 2e-6, rel=1e-4)


@pytest.mark.parametrize("power_w", [-500.0, 0.0, 598.0, 2_000.0])
def test_the_current_gives_the_power(power_w: float) -> None:
    current_a = PACK.current_a(0.6, power_w)

    voltage_v = PACK.open_voltage_v(0.6) - current_a * PACK.resistance_ohm
    assert voltage_v * current_a == pytest.approx(power_w)
