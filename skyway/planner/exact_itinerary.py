"""The itinerary of the best plan that the exact search found.

`best_acts` reads the acts of the drone from the labels that lead to the plan; `itinerary_of` turns
the acts into steps with times and charges.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from skyway.drone.charging import recharge_time_s, soc_after_recharge
from skyway.ids import StationId
from skyway.network.network import Segment
from skyway.planner.closures import Use
from skyway.planner.flight_log import FlightLog
from skyway.planner.itinerary import Itinerary
from skyway.planner.kernels.memory import (
    BEST,
    DETAIL,
    FLOWN,
    FLOWN_IN,
    HANDED_OVER,
    KIND,
    LANDED,
    LEVEL,
    PARENT,
    SESSION,
    START,
    STAYED,
    USED,
    Memory,
)
from skyway.planner.situation import Situation
from skyway.planner.weather import STILL_AIR, Air
from skyway.units import TIME_TOLERANCE_S

_NONE: Final = -1


@dataclass(frozen=True, slots=True)
class Act:
    """One act of a plan's drone: a kind of label.

    `segment` is the row of the segment flown, -1 without one; `level_j` the level with which it
    leaves the pad; `not_before_s` the moment before which the flight, landing or session may not
    begin; `period` the period of the weather in which the flight begins.
    """

    kind: int
    segment: int
    level_j: float
    not_before_s: float
    period: int = 0


def best_acts(memory: Memory, *, is_lazy: bool) -> list[Act] | None:
    """The acts of the best plan so far, from the start on; None without a plan.

    With lazy charging a session's own level is where it starts; where it ends is what the first
    label behind it that settled the matter says.
    """
    label = int(memory.counts[BEST])
    if label == _NONE:
        return None
    links, values = memory.link, memory.label
    chain = []
    left_with_j = float(values[label, LEVEL])
    while label != _NONE:
        kind, parent = int(links[label, KIND]), int(links[label, PARENT])
        segment = _NONE
        period, level_j = 0, math.nan
        if kind in (FLOWN, HANDED_OVER):
            segment = int(memory.arc_segment[links[label, DETAIL]])
            if len(memory.period):
                period = int(memory.period[label, FLOWN_IN])
        elif kind == SESSION:
            own_j = float(values[label, LEVEL])
            level_j = left_with_j if is_lazy else own_j
            left_with_j = own_j + float(values[parent, USED])
        chain.append(Act(kind, segment, level_j, float(memory.not_before_s[label]), period))
        label = parent
    return chain[::-1]


#: Charges closer than this are equal here. This is far below the tolerance of a plan, so that many
#: recharges left out together stay below the tolerance too.
_SAME_SOC = 1e-12


def itinerary_of(situation: Situation, acts: Sequence[Act]) -> Itinerary:
    """The steps of these acts, as early as charges and closures allow."""
    flight = _Flight(situation)
    for act, following in zip(acts, [*acts[1:], None], strict=True):
        flight.do(act, is_followed_by_hand_over=following is not None and following.kind == STAYED)
    return Itinerary(flight.log.now_s, tuple(flight.log.steps), ())


@dataclass(frozen=True, slots=True)
class _Crossing:
    """A segment and its row, the air in which it is flown, and when this begins at the earliest."""

    segment: Segment
    row: int
    air: Air
    not_before_s: float


class _Flight:
    """A drone that does act after act; flights are written when the drone lands.

    No drone waits in the air. If a segment is still closed, the drone leaves the ground later.
    """

    def __init__(self, situation: Situation) -> None:
        self.log = FlightLog(situation)
        self._situation = situation
        self._undelivered = set(situation.destinations)
        self._in_air: list[_Crossing] = []
        self._load_kg = 0.0

    def do(self, act: Act, *, is_followed_by_hand_over: bool) -> None:
        """Do one act; a drone that hands over next shows its landing by that."""
        if act.segment >= 0:
            segment = self._situation.network.segments[act.segment]
            weather = self._situation.problem.weather
            air = STILL_AIR if weather is None else weather.air(act.segment, act.period)
            self._in_air.append(_Crossing(segment, act.segment, air, act.not_before_s))
        if act.kind == HANDED_OVER:
            self._land()
            self._hand_over()
        elif act.kind == LANDED:
            self._land(not_before_s=act.not_before_s)
            if not is_followed_by_hand_over:
                self.log.stand()
        elif act.kind == STAYED:
            self._land()
            self.log.wait(until_s=act.not_before_s)
            self._hand_over()
        elif act.kind == SESSION:
            self._recharge(act)
        elif act.kind == START and self._loads_immediately():
            self._hand_over()

    def _loads_immediately(self) -> bool:
        is_at_source = self.log.here == self._situation.problem.source
        return is_at_source and not self._situation.windows.may_pass

    def _hand_over(self) -> None:
        self.log.hand_over()
        self._undelivered.discard(self.log.here)
        self._load_kg = self._situation.load_kg(self._undelivered)

    def _recharge(self, act: Act) -> None:
        self._land()
        model = self._situation.model_at(self.log.here)
        until_soc = min(act.level_j / model.battery_j, model.top_soc)
        self.log.wait(until_s=act.not_before_s)
        if until_soc <= self.log.soc + _SAME_SOC:
            self.log.stand()
            return
        calendar, here = self._situation.pads, self.log.here
        duration_s = recharge_time_s(model, self.log.soc, until_soc)
        if self._situation.problem.recharge_policy == "full":
            session = calendar.earliest_session(
                here, not_before_s=self.log.now_s, duration_s=duration_s
            )
            if session is not None:
                self.log.recharge(pad=session.pad, until_soc=until_soc)
            return
        until_s = self.log.now_s + duration_s
        for window in calendar.windows_on_end(here, from_s=self.log.now_s, until_s=until_s):
            reached_soc = until_soc
            if window.end_s < until_s:
                reached_soc = soc_after_recharge(model, self.log.soc, window.end_s - self.log.now_s)
            self.log.recharge(pad=window.pad, until_soc=min(until_soc, reached_soc))
            if reached_soc >= until_soc:
                return

    def _land(self, *, not_before_s: float = -math.inf) -> None:
        """Fly all segments in the air, leaving so late that each may be flown and the landing is.

        `not_before_s` is the moment before which the drone may not touch down.
        """
        flights, self._in_air = self._in_air, []
        if not flights:
            return
        leave_s = self._leave_s(flights, not_before_s)
        if leave_s <= self.log.now_s or self._meets_nothing(flights, leave_s):
            self._fly(flights, leave_s)
            return
        # Leaving that late meets a closure, so the drone waits further on, where landing is free.
        while flights:
            count = next(
                (n for n, each in enumerate(flights, 1) if self._is_free(each.segment.to_id)),
                len(flights),
            )
            part, flights = flights[:count], flights[count:]
            self._fly(part, self._leave_s(part, -math.inf if flights else not_before_s))

    def _leave_s(self, flights: Sequence[_Crossing], touch_s: float) -> float:
        """When to leave for these flights, to touch down at this moment or later."""
        after_s, leave_s, load_kg = 0.0, self.log.now_s, self._load_kg
        for each in flights:
            leave_s = max(leave_s, each.not_before_s - after_s)
            after_s += self._situation.flight_s(each.segment, load_kg, air=each.air)
        return max(leave_s, touch_s - after_s)

    def _meets_nothing(self, flights: Sequence[_Crossing], leave_s: float) -> bool:
        """Whether flights from this moment on meet no closure, and the air that they are for."""
        weather = self._situation.problem.weather
        after_s, uses = 0.0, []
        for each in flights:
            segment, start_s = each.segment, leave_s + after_s
            flight_s = self._situation.flight_s(segment, self._load_kg, air=each.air)
            if weather is not None and not weather.has_air(
                each.row,
                each.air,
                start_s=start_s,
                end_s=start_s + flight_s,
                within_s=TIME_TOLERANCE_S / 2,
            ):
                return False
            uses.append(Use((segment.from_id, segment.to_id), after_s, flight_s))
            after_s += flight_s
        departure = self._situation.closures.earliest_departure(uses, not_before_s=leave_s)
        return departure.at_s <= leave_s + TIME_TOLERANCE_S

    def _fly(self, flights: Sequence[_Crossing], leave_s: float) -> None:
        load_kg = self._load_kg
        self.log.wait(until_s=leave_s)
        for number, each in enumerate(flights, 1):
            lands = number == len(flights)
            self.log.fly(each.segment, load_kg=load_kg, lands=lands, air=each.air)

    def _is_free(self, station_id: StationId) -> bool:
        """Whether a landing costs nothing there, and no closure forbids it."""
        model = self._situation.model
        is_closed = station_id in self._situation.closures.intervals()
        return model.stop_s == 0 and model.stop_j == 0 and not is_closed
