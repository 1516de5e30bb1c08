"""What an hour of requests costs under a policy: delays, time and energy of the drones."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from skyway.experiments.fleet_hour.calendars import Calendars
from skyway.experiments.fleet_hour.cases import Load, Place, draw_case
from skyway.experiments.fleet_hour.mission import HourMission
from skyway.experiments.fleet_hour.policy import Policy
from skyway.experiments.fleet_hour.simulate import FlownHour, simulate
from skyway.experiments.report import Row
from skyway.scheduling.utilisation import USES, StepTime, Use, spent_ms
from skyway.units import hours_to_s, minutes_to_s

#: A customer gives up when no drone is booked within this time, as by the services' default.
PATIENCE_MS: Final = round(hours_to_s(1) * 1000)

_MS_PER_MINUTE: Final = minutes_to_s(1) * 1000
_MS_PER_HOUR: Final = hours_to_s(1) * 1000
_J_PER_KWH: Final = 3.6e6


@dataclass(frozen=True, slots=True)
class HourTrial:
    """One policy in one seeded case."""

    place: Place
    load: Load
    policy: Policy
    seed: int


@dataclass(frozen=True, slots=True)
class HourMeasures:
    """The measures of one trial.

    Parameters
    ----------
    served_share
        The share of requests that are served when customers give up after `PATIENCE_MS`.
    delays_min
        Minutes from each request to its last delivery, when nobody gives up; infinite without a
        plan. All following measures are of this run too.
    held_h
        Drone-hours from the start of each mission until its drone is free for another one.
    energy_kwh
        The energy of all flights, with the margin of the plans.
    shares
        The share of the drones' time until the last delivery, by use.
    """

    served_share: float
    delays_min: tuple[float, ...]
    held_h: float
    energy_kwh: float
    shares: Mapping[Use, float]

    @property
    def idle_share(self) -> float:
        """The share of the drones' time without a mission."""
        return 1.0 - sum(self.shares.values())

    def row(self, trial: HourTrial) -> Row:
        """The row of a trial in the CSV file."""
        return {
            "place": trial.place,
            "drones": trial.load.drones,
            "requests": trial.load.requests,
            "policy": trial.policy.name,
            "seed": trial.seed,
            "served_share": self.served_share,
            "mean_min": round(sum(self.delays_min) / len(self.delays_min), 3),
            "held_h": round(self.held_h, 3),
            "energy_kwh": round(self.energy_kwh, 3),
            **{each: round(self.shares[each], 4) for each in USES},
            "idle": round(self.idle_share, 4),
        }


def measure(trial: HourTrial) -> HourMeasures:
    """Simulate a trial with and without customers that give up."""
    case = draw_case(trial.place, trial.load, seed=trial.seed)
    hour = simulate(case, trial.policy)
    with_patience = simulate(case, trial.policy, patience_ms=PATIENCE_MS)
    return HourMeasures(
        served_share=len(with_patience.missions) / len(case.requests),
        delays_min=_delays_min(hour),
        held_h=sum(_held_ms(hour.calendars, each) for each in hour.missions) / _MS_PER_HOUR,
        energy_kwh=sum(each.energy_j for each in hour.missions) / _J_PER_KWH,
        shares=_shares(hour.missions, drones=trial.load.drones),
    )


def _delays_min(hour: FlownHour) -> tuple[float, ...]:
    served = [(each.served_ms - each.request.asked_ms) / _MS_PER_MINUTE for each in hour.missions]
    return (*served, *(math.inf for _ in hour.unserved))


def _held_ms(calendars: Calendars, mission: HourMission) -> int:
    return calendars.policy.usable(mission.stays)[0].from_ms - mission.trip.start_ms


def _shares(missions: Sequence[HourMission], *, drones: int) -> Mapping[Use, float]:
    end_ms = max((each.served_ms for each in missions), default=1)
    spent = dict.fromkeys(USES, 0)
    for mission in missions:
        steps = [StepTime(each.step.kind, each.start_ms, each.end_ms) for each in mission.steps()]
        of_mission = spent_ms(steps, served_ms=mission.served_ms, from_ms=0, until_ms=end_ms)
        for use in USES:
            spent[use] += of_mission[use]
    return {use: spent[use] / (drones * end_ms) for use in USES}
