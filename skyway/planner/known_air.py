"""What is known of the air on the flights of a plan, and how late it may make the plan.

A plan has the wind of its flights already: only the error of this wind makes it late.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist, fmean
from typing import Final

import numpy as np

from skyway.delivery.lateness import COVERED, Conditions, KnownAir, KnownBy
from skyway.delivery.plan import Fly, Plan
from skyway.drone.model import DroneModel
from skyway.planner.energy_risk import FORECAST_ERROR_MPS
from skyway.planner.forecast import Forecast
from skyway.planner.kernels.memory import Floats
from skyway.planner.weather import segment_rows
from skyway.planner.wind import SegmentWind

#: Nine of ten errors are at most so many standard deviations.
_DEVIATIONS: Final = NormalDist().inv_cdf(COVERED)
#: The largest share by which a flight counts as longer. Our own choice.
_MOST_LATE: Final = 1.0


@dataclass(frozen=True, slots=True)
class AirOfPlan:
    """The air that is known on a plan's flights; nine of ten plans are late by no more than this.

    `late_share` is a share of the planned time. Charging takes longer by the same share, because
    the energy of a flight is proportional to its time.
    """

    known: KnownAir
    late_share: float

    def conditions_of(self, plan: Plan) -> Conditions:
        """What is known about this plan."""
        return Conditions.of_plan(plan, self.known, self.late_share)


def air_in_forecast(
    forecast: Forecast,
    wind: SegmentWind,
    model: DroneModel,
    flights: Sequence[Fly],
    *,
    start_s: float,
    source: KnownBy = "FORECAST",
) -> AirOfPlan:
    """The air of a plan that begins at `start_s` of the forecast's clock and uses the forecast.

    `wind` is that of the forecast on all segments. `flights` has at least one flight.
    """
    segments = segment_rows(wind.network, [(each.from_id, each.to_id) for each in flights])
    at_s = start_s + np.array([each.start_s for each in flights])
    on_flights = wind.of_flights(segments, at_s, least_error_mps=FORECAST_ERROR_MPS)
    later = on_flights.in_error(model, _DEVIATIONS)
    known = KnownAir(
        source=source,
        wind_mps=_mean_mps(on_flights, flights),
        temperature_c=round(forecast.mean_temperature_c(start_s), 1),
    )
    return AirOfPlan(known, _late_share(later, flights))


def _mean_mps(wind: SegmentWind, flights: Sequence[Fly]) -> float:
    strength_mps = np.hypot(wind.along_mps, wind.across_mps)[0]
    return round(_mean(strength_mps, flights), 1)


def _late_share(logarithms: Floats, flights: Sequence[Fly]) -> float:
    longer = np.expm1(np.minimum(logarithms[0], math.log(1 + _MOST_LATE)))
    return round(_mean(longer, flights), 4)


def _mean(values: Floats, flights: Sequence[Fly]) -> float:
    """A mean in which longer flights count more."""
    lasting_s = [max(each.end_s - each.start_s, 1.0) for each in flights]
    return fmean(values.tolist(), weights=lasting_s)
