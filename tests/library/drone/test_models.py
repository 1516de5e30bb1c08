import subprocess
import sys

import pytest

from skyway.drone.flight import flight_energy_j
from skyway.drone.model import DroneModel
from skyway.drone.models import (
    DJI_MATRICE_300_RTK,
    DRONE_MODELS,
    PAPER_MATRICE_300,
    PAPER_SCENARIO,
)


def range_km(model: DroneModel, load_kg: float) -> float:
    return model.battery_j / flight_energy_j(model, length_m=1000.0, load_kg=load_kg)


def test_three_models_are_named():
    assert list(DRONE_MODELS) == ["dji-matrice-300-rtk", "paper-matrice-300", "paper-scenario"]


def test_the_paper_s_drone_flies_75_9_km_empty_and_about_12_km_full():
    assert range_km(PAPER_MATRICE_300, 0.0) == pytest.approx(75.9)
    assert range_km(PAPER_MATRICE_300, 15.3) == pytest.approx(12, abs=0.1)


def test_the_scenario_s_drone_flies_33_km_empty_and_about_5_km_full():
    assert range_km(PAPER_SCENARIO, 0.0) == pytest.approx(33.0)
    assert range_km(PAPER_SCENARIO, 15.3) == pytest.approx(5, abs=0.25)


def test_the_maker_s_drone_is_the_one_of_the_planner_s_formats():
    model = DJI_MATRICE_300_RTK

    assert (model.empty_mass_kg, model.max_payload_kg, model.battery_j) == (6.3, 2.7, 1_972_800)
    assert (model.reserve_soc, model.power_empty_w, model.top_soc) == (0.1, 598.0, 0.99)
    assert model.speed_empty_mps == pytest.approx(23.0)
    assert model.charge_curve[:2] == ((0.0, 0.0), (4428.0, 0.8))
    assert model.charge_curve[-1].time_s == pytest.approx(7740.0)


def test_the_physics_stay_light_enough_for_a_drone():
    heavy = "{'networkx', 'numpy', 'numba', 'sqlalchemy', 'fastapi', 'skyway.planner'}"
    code = (
        f"import sys, skyway.drone.models, skyway.drone.charging; print({heavy} & {{*sys.modules}})"
    )

    imported = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)

    assert imported.stdout.strip() == b"set()"
