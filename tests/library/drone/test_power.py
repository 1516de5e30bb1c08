import pytest

from skyway.drone.models import DJI_MATRICE_300_RTK, PAPER_MATRICE_300
from skyway.drone.power import flight_power_w


def test_without_load_the_power_is_the_models_own():
    assert flight_power_w(DJI_MATRICE_300_RTK, 0.0) == 598.0


def test_full_payload_of_the_makers_drone_takes_about_1021_w():
    assert flight_power_w(DJI_MATRICE_300_RTK, 2.7) == pytest.approx(1021, abs=1)


def test_power_rises_as_the_total_mass_to_the_power_of_one_and_a_half():
    ratio = flight_power_w(PAPER_MATRICE_300, 15.3) / flight_power_w(PAPER_MATRICE_300, 0.0)

    assert ratio == pytest.approx(((6.3 + 15.3) / 6.3) ** 1.5)
