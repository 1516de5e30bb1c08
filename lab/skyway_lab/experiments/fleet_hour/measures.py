"""Simulates one hour of requests under a policy, and measures its delays, time and energy."""

import heapq
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from skyway.units import hours_to_s, minutes_to_s
from skyway_lab.experiments.fleet_hour.calendars import Calendars, HourMission, Policy
from skyway_lab.experiments.fleet_hour.cases import Case, HourRequest, Load, Place, draw_case
from skyway_lab.experiments.fleet_hour.find_mission import MissionFinder
from skyway_lab.experiments.fleet_hour.utilisation import USES, StepTime, Use, spent_ms
from skyway_lab.experiments.report import Row

#: A customer gives up when no drone is booked within this time, as by the services' default.
LONGEST_WAIT_MS: Final = round(hours_to_s(1) * 1000)


_MS_PER_MINUTE: Final = minutes_to_s(1) * 1000


_MS_PER_HOUR: Final = hours_to_s(1) * 1000


_J_PER_KWH: Final = 3.6e6


@dataclass(frozen=True, slots=True)
class FlownHour:
    """What came of an hour: the missions of each drone, and the requests that were not served."""

    calendars: Calendars
    unserved: tuple[HourRequest, ...]

    @property
    def missions(self) -> Sequence[HourMission]:
        """The missions of all drones."""
        return [each for calendar in self.calendars.missions for each in calendar]


def simulate(case: Case, policy: Policy, *, longest_wait_ms: int | None = None) -> FlownHour:
    """Book the requests of a case in the order of asking, and fly them as planned.

    Parameters
    ----------
    longest_wait_ms
        A request that is not booked within this time is given up. None means that it waits.
    """
    calendars, finder = Calendars(case, policy), MissionFinder.of(case.network)
    moments = [request.asked_ms for request in case.requests]
    coming, waiting, lost = [*reversed(case.requests)], [], []
    while moments:
        now_ms = heapq.heappop(moments)
        while coming and coming[-1].asked_ms <= now_ms:
            waiting.append(coming.pop())
        still_waiting = []
        for request in waiting:
            if longest_wait_ms is not None and now_ms > request.asked_ms + longest_wait_ms:
                lost.append(request)
                continue
            mission = finder.first_mission(calendars, request, now_ms=now_ms)
            if mission is None:
                still_waiting.append(request)
                continue
            calendars.book(mission)
            heapq.heappush(moments, calendars.free_ms(mission.drone))
        waiting = still_waiting
    return FlownHour(calendars, (*lost, *waiting))


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
        The share of requests that are served when customers give up after `LONGEST_WAIT_MS`.
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
    until_given_up = simulate(case, trial.policy, longest_wait_ms=LONGEST_WAIT_MS)
    return HourMeasures(
        served_share=len(until_given_up.missions) / len(case.requests),
        delays_min=delays_min(hour),
        held_h=sum(_held_ms(hour.calendars, each) for each in hour.missions) / _MS_PER_HOUR,
        energy_kwh=sum(each.energy_j for each in hour.missions) / _J_PER_KWH,
        shares=_shares(hour.missions, drones=trial.load.drones),
    )


def delays_min(hour: FlownHour) -> tuple[float, ...]:
    """Minutes from each request to its last delivery; infinite for those without a plan."""
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
