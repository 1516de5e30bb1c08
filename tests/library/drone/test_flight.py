import pytest

from skyway.drone.flight import (
    flight_energy_j,
    flight_power_w,
    flight_time_s,
    soc_after_use,
    speed_mps,
)
from skyway.drone.model import ChargePoint, DroneModel
from skyway.drone.models import DJI_MATRICE_300_RTK, PAPER_MATRICE_300
from skyway.ids import DroneModelId

SLOWING = DroneModel(
    model_id=DroneModelId("slowing"),
    empty_mass_kg=4.0,
    max_payload_kg=5.0,
    battery_j=1_000_000.0,
    speed_empty_mps=20.0,
    speed_full_mps=10.0,
    power_empty_w=100.0,
    charge_curve=(ChargePoint(0, 0), ChargePoint(3600, 1)),
)


@pytest.mark.parametrize(("load_kg", "expected_mps"), [(0.0, 20.0), (2.5, 15.0), (5.0, 10.0)])
def test_speed_falls_linearly_with_the_load(load_kg: float, expected_mps: float):
    assert speed_mps(SLOWING, load_kg) == pytest.approx(expected_mps)


def test_a_loaded_flight_takes_longer_and_more_energy():
    assert flight_time_s(SLOWING, length_m=3_000.0, load_kg=2.5) == pytest.approx(200.0)
    energy_j = flight_energy_j(SLOWING, length_m=3_000.0, load_kg=2.5)
    assert energy_j == pytest.approx(200.0 * 100.0 * (6.5 / 4.0) ** 1.5)


def test_use_lowers_the_charge_by_its_share_of_the_battery():
    assert soc_after_use(SLOWING, 0.9, energy_j=250_000.0) == pytest.approx(0.65)


def test_the_charge_of_a_battery_is_never_below_zero():
    assert soc_after_use(SLOWING, 0.1, energy_j=100_000.0000001) == 0.0


def test_the_makers_drone_flies_about_32_minutes_with_full_payload():
    model = DJI_MATRICE_300_RTK

    j_per_s = flight_energy_j(model, length_m=23.0, load_kg=2.7)

    assert model.battery_j / j_per_s / 60 == pytest.approx(32, abs=0.5)


def test_without_load_the_power_is_the_models_own():
    assert flight_power_w(DJI_MATRICE_300_RTK, 0.0) == 598.0


def test_full_payload_of_the_makers_drone_takes_about_1021_w():
    assert flight_power_w(DJI_MATRICE_300_RTK, 2.7) == pytest.approx(1021, abs=1)


def test_power_rises_as_the_total_mass_to_the_power_of_one_and_a_half():
    ratio = flight_power_w(PAPER_MATRICE_300, 15.3) / flight_power_w(PAPER_MATRICE_300, 0.0)

    assert ratio == pytest.approx(((6.3 + 15.3) / 6.3) ** 1.5)
