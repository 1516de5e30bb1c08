"""Margins that follow from a risk keep to this risk, if errors are as the model states."""

import pytest
from skyway_lab.benchmarks.reserve_risk import STRETCHES, share_below_reserve

from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.planner.energy_risk import EnergyRisk

MODEL = DJI_MATRICE_300_RTK


@pytest.mark.parametrize("use", [0.08, 0.04])
@pytest.mark.parametrize("name", STRETCHES)
def test_landings_below_the_reserve_are_about_as_rare_as_accepted(name: str, use: float) -> None:
    risk = EnergyRisk(0.02, use)

    share = share_below_reserve(STRETCHES[name], risk, MODEL, draws=100_000, seed=1)

    assert share <= 1.1 * risk.reserve_risk
    # For one flight that has no tail wind, the margin is not much too large either.
    if "with" not in name and "three" not in name:
        assert share >= 0.4 * risk.reserve_risk
