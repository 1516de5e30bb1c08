import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skyway.drone.charging import (
    cold_charging_factor,
    fastest_s_per_soc,
    model_in_cold,
    model_on_pad,
    recharge_time_s,
    soc_after_recharge,
)
from skyway.drone.model import ChargePoint, DroneModel
from skyway.drone.models import DJI_MATRICE_300_RTK, PAPER_MATRICE_300
from skyway.errors import InvalidStateOfCharge

HOUR_S = 3600.0
KINKED = DJI_MATRICE_300_RTK.model_copy(
    update={
        "reserve_soc": 0.2,
        "charge_curve": (ChargePoint(0, 0.2), ChargePoint(100, 0.6), ChargePoint(300, 0.8)),
    }
)


@pytest.mark.parametrize(
    ("soc_from", "soc_to", "expected_s"),
    [(0.2, 0.6, 100.0), (0.2, 0.8, 300.0), (0.4, 0.7, 150.0), (0.5, 0.5, 0.0)],
)
def test_recharge_time_follows_the_charge_curve(soc_from: float, soc_to: float, expected_s: float):
    assert recharge_time_s(KINKED, soc_from, soc_to) == pytest.approx(expected_s)


@pytest.mark.parametrize(("soc_from", "soc_to"), [(0.1, 0.5), (0.3, 0.9), (0.5, 0.4), (1.1, 1.2)])
def test_charges_off_the_curve_or_reversed_are_refused(soc_from: float, soc_to: float):
    with pytest.raises(InvalidStateOfCharge):
        recharge_time_s(KINKED, soc_from, soc_to)


def test_a_charge_that_rounding_left_just_below_the_curve_counts_as_its_first():
    assert recharge_time_s(KINKED, 0.2 - 1e-12, 0.6) == pytest.approx(100.0)


def test_no_pad_charges_beyond_the_top_of_the_curve():
    assert soc_after_recharge(KINKED, 0.7, 10_000.0) == 0.8


def test_a_drone_charged_above_the_top_keeps_its_charge():
    assert soc_after_recharge(KINKED, 0.95, 10.0) == 0.95


def test_the_fastest_rate_is_the_one_just_above_the_reserve():
    assert fastest_s_per_soc(KINKED) == pytest.approx(250.0)
    slow_reserve = KINKED.model_copy(update={"reserve_soc": 0.6})
    assert fastest_s_per_soc(slow_reserve) == pytest.approx(1000.0)


def test_the_paper_s_drone_recharges_fully_in_2_15_hours():
    assert recharge_time_s(PAPER_MATRICE_300, 0.0, 1.0) == pytest.approx(2.15 * HOUR_S)


def test_the_maker_s_drone_takes_57_percent_of_its_recharge_to_the_knee():
    to_knee_s = recharge_time_s(DJI_MATRICE_300_RTK, 0.0, 0.8)

    assert to_knee_s == pytest.approx(1.23 * HOUR_S)
    assert to_knee_s / recharge_time_s(DJI_MATRICE_300_RTK, 0.0, 0.99) == pytest.approx(0.57, 0.01)


@given(soc_from=st.floats(0.0, 0.99), soc_to=st.floats(0.0, 0.99))
@settings(max_examples=50)
def test_reading_the_curve_forth_and_back_gives_the_same_charge(soc_from: float, soc_to: float):
    model: DroneModel = DJI_MATRICE_300_RTK
    soc_from, soc_to = sorted((soc_from, soc_to))

    duration_s = recharge_time_s(model, soc_from, soc_to)

    assert soc_after_recharge(model, soc_from, duration_s) == pytest.approx(soc_to, abs=1e-12)


@settings(max_examples=50)
@given(power_w=st.floats(10, 2_000))
def test_a_pad_slows_each_piece_of_the_curve_that_needs_more_power(power_w: float):
    model, battery_j = DJI_MATRICE_300_RTK, DJI_MATRICE_300_RTK.battery_j

    slowed = model_on_pad(model, power_w)

    assert DroneModel.model_validate(slowed.model_dump()) == slowed
    for before, after in zip(model.charge_curve, model.charge_curve[1:], strict=False):
        own_s = after.time_s - before.time_s
        pad_s = (after.soc - before.soc) * battery_j / power_w
        assert recharge_time_s(slowed, before.soc, after.soc) == pytest.approx(max(own_s, pad_s))


def test_a_pad_with_power_enough_leaves_the_model_as_it_is():
    assert model_on_pad(KINKED, None) is KINKED
    assert model_on_pad(KINKED, KINKED.battery_j) is KINKED


def test_charging_in_the_cold_takes_longer() -> None:
    frost = model_in_cold(DJI_MATRICE_300_RTK, -8.0)

    mild_s, cold_s = (recharge_time_s(model, 0.2, 0.7) for model in (DJI_MATRICE_300_RTK, frost))
    assert cold_s == pytest.approx(mild_s / 0.712)
    assert model_in_cold(DJI_MATRICE_300_RTK, 10.0) is DJI_MATRICE_300_RTK
    assert model_in_cold(DJI_MATRICE_300_RTK, None) is DJI_MATRICE_300_RTK
    assert cold_charging_factor(-80.0) == 4.0
