"""Simulates one hour of requests: each is booked when it comes, or waits until a drone is free."""

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

from skyway.experiments.fleet_hour.calendars import Calendars
from skyway.experiments.fleet_hour.cases import Case, HourRequest
from skyway.experiments.fleet_hour.find_mission import MissionFinder
from skyway.experiments.fleet_hour.mission import HourMission
from skyway.experiments.fleet_hour.policy import Policy


@dataclass(frozen=True, slots=True)
class FlownHour:
    """What came of an hour: the missions of each drone, and the requests that were not served."""

    calendars: Calendars
    unserved: tuple[HourRequest, ...]

    @property
    def missions(self) -> Sequence[HourMission]:
        """The missions of all drones."""
        return [each for calendar in self.calendars.missions for each in calendar]


def simulate(case: Case, policy: Policy, *, patience_ms: int | None = None) -> FlownHour:
    """Book the requests of a case in the order of asking, and fly them as planned.

    Parameters
    ----------
    patience_ms
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
            if patience_ms is not None and now_ms > request.asked_ms + patience_ms:
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
