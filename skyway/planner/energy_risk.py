"""The energy margin of a flight that follows from an accepted risk.

Three things make the energy of a flight uncertain: the wind is not as forecast, the drone's energy
use changes from flight to flight, and the model of a drone is simple. Each has a standard
deviation. The margin covers as many deviations as the accepted risk allows.

All flights up to a recharge count as if they met the same errors: a wind that is stronger than
forecast is stronger for all of them. So their margins add up. In truth the errors of flights
differ. Then they cancel out in part, and the risk is smaller.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from statistics import NormalDist
from typing import Final

import numpy as np

from skyway.drone.learned_values import UNKNOWN_USE
from skyway.drone.model import DroneModel
from skyway.planner.kernels.memory import Floats

#: The smallest and the largest margin, as shares of the energy. The smallest covers what nobody has
#: thought of. With more than the largest a drone would hardly fly: a plan with a flight that needs
#: more does not keep to the risk, and says so. Our own choices, as are the next numbers.
LEAST_MARGIN: Final = 0.05
MOST_MARGIN: Final = 0.40

#: Standard deviation of the energy of flights from that of a drone's model, as a share: how power
#: depends on load, air density, climbs and turns.
MODEL_DEVIATION: Final = 0.04

#: Standard deviation of the wind in each direction, metres per second: without a forecast, with a
#: mean wind of 3.8 m/s from anywhere; and of a forecast that states no error.
CLIMATE_MPS: Final = 3.0
FORECAST_ERROR_MPS: Final = 1.5

#: Margins are rounded up to whole multiples of this.
_STEP: Final = 0.01


# Without slots: the number of deviations is computed once, and cached.
@dataclass(frozen=True)
class EnergyRisk:
    """How likely a landing below the reserve may be, and how much a drone's energy use varies.

    Parameters
    ----------
    reserve_risk
        The accepted share of stretches up to a recharge after which a drone has less than its
        reserve; above 0, below 0.5.
    use_deviation
        Standard deviation of the drone's energy use in still air, as a share.
    """

    reserve_risk: float
    use_deviation: float = UNKNOWN_USE

    @cached_property
    def deviations(self) -> float:
        """How many standard deviations a margin covers: 3.09 for one landing in a thousand."""
        return NormalDist().inv_cdf(1 - self.reserve_risk)

    def margins(self, in_wind: Floats) -> Floats:
        """The margins of flights, as shares of their energy.

        Parameters
        ----------
        in_wind
            Any shape: the logarithm of how many times more energy each flight needs if the wind
            is wrong by `deviations` against the drone; inf if it could not fly then.

        Notes
        -----
        The logarithm of the energy counts as normally distributed. It is convex in the wind, so the
        straight line from no error to this error lies above it: the margin is rather too large.
        """
        own = self.deviations * math.hypot(self.use_deviation, MODEL_DEVIATION)
        margins: Floats = np.clip(np.expm1(np.hypot(in_wind, own)), LEAST_MARGIN, MOST_MARGIN)
        return margins

    @cached_property
    def own_margin(self) -> float:
        """The margin of a flight in a wind that is exactly known: no flight has less."""
        return self._margin(0.0)

    def climate_margin(self, model: DroneModel) -> float:
        """The margin of all flights without a forecast."""
        return self._margin(self.in_climate(model))

    def in_climate(self, model: DroneModel) -> float:
        """`in_wind` of a flight without a forecast, with the load that the wind hinders more."""
        slowest_mps = min(model.speed_empty_mps, model.speed_full_mps)
        left_mps = slowest_mps - self.deviations * CLIMATE_MPS
        return math.log(slowest_mps / left_mps) if left_mps > 0 else math.inf

    def _margin(self, in_wind: float) -> float:
        # A little less first, so that sums of floats do not lift a whole step by one.
        steps = math.ceil(float(self.margins(np.array(in_wind))) / _STEP - 1e-6)
        return round(steps * _STEP, 2)
