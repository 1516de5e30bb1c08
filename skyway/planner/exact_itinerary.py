"""The itinerary of the best plan that the exact search found: its acts as steps with times.

The acts are flown one after another. Pads are chosen at the end, for all sessions together.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import filterfalse
from typing import Final

import numpy as np

from skyway.drone.charging import model_on_pad, recharge_time_s, soc_after_recharge
from skyway.drone.flight import flight_power_w, speed_mps
from skyway.ids import StationId
from skyway.planner.closures import Use
from skyway.planner.exact_acts import Act
from skyway.planner.flight_log import Flight, FlightLog, StepFields
from skyway.planner.itinerary import Itinerary
from skyway.planner.kernels import memory
from skyway.planner.pad_book import booked_from_ms, booked_until_ms
from skyway.planner.pad_calendar import FreeWindow, windows_on_end
from skyway.planner.situation import Situation
from skyway.planner.weather import STILL_AIR
from skyway.units import time_tolerance_s

# Ints of Python are compared faster than those of numpy.
_START: Final = int(memory.START)
_FLOWN: Final = int(memory.FLOWN)
_LANDED: Final = int(memory.LANDED)
_SESSION: Final = int(memory.SESSION)
_HANDED_OVER: Final = int(memory.HANDED_OVER)
_STAYED: Final = int(memory.STAYED)

#: The pad of a session until the pads are chosen.
_ANY_PAD: Final = -1

#: Charges closer than this are equal here. This is far below the tolerance of a plan, so that many
#: recharges left out together stay below the tolerance too.
_SAME_SOC = 1e-12


def itinerary_of(situation: Situation, acts: Sequence[Act]) -> Itinerary:
    """The steps of these acts, as early as charges and closures allow."""
    flight = _Flight(situation, acts)
    is_hand_over_next = [*(act.kind == _STAYED for act in acts[1:]), False]
    for act, is_followed in zip(acts, is_hand_over_next, strict=True):
        if act.segment >= 0:
            flight.take_off(act)
        if act.kind != _FLOWN:
            flight.do(act, is_followed_by_hand_over=is_followed)
    steps = tuple(_with_pads(situation, flight.log.steps, flight.sessions))
    return Itinerary(flight.log.now_s, steps, ())


class _Flight:
    """A drone that does act after act; flights are written when the drone lands.

    No drone waits in the air. If a segment is still closed, the drone leaves the ground later.
    """

    def __init__(self, situation: Situation, acts: Sequence[Act]) -> None:
        self.log = FlightLog(situation)
        #: The station of each recharge, and the milliseconds from which and until which it lasts.
        self.sessions: list[tuple[StationId, int, int]] = []
        self._situation = situation
        columns = situation.network.columns
        flown = np.array([act.segment for act in acts if act.segment >= 0], np.int64)
        to_ids = (columns.station_ids[row] for row in columns.to_row[flown].tolist())
        #: The metres of each segment still to be flown, and the station at its end.
        self._flown = zip(columns.length_m[flown].tolist(), to_ids, strict=True)
        self._model = situation.model
        self._battery_j, self._top_soc = self._model.battery_j, self._model.top_soc
        self._weather = situation.problem.weather
        self._undelivered = set(situation.destinations)
        self._in_air: list[Flight] = []
        self._set_load(0.0)

    def take_off(self, act: Act) -> None:
        """Add the act's segment to the flights that end with the next act on the ground."""
        row, (length_m, to_id) = act.segment, next(self._flown)
        air = STILL_AIR if self._weather is None else self._weather.air(row, act.period)
        flight_s = length_m * air.time_factor / self._speed_mps
        flight_j = self._power_w * flight_s * air.energy_factor
        self._in_air.append(Flight(to_id, flight_s, flight_j, air, row, act.not_before_s))

    def do(self, act: Act, *, is_followed_by_hand_over: bool) -> None:
        """Do one act on the ground; a drone that hands over next shows its landing by that."""
        if act.kind == _SESSION:
            self._recharge(act)
        elif act.kind == _HANDED_OVER:
            self._land()
            self._hand_over()
        elif act.kind == _LANDED:
            self._land(not_before_s=act.not_before_s)
            if not is_followed_by_hand_over:
                self.log.stand()
        elif act.kind == _STAYED:
            self._land()
            self.log.wait(until_s=act.not_before_s)
            self._hand_over()
        elif act.kind == _START and self._loads_immediately():
            self._hand_over()

    def _loads_immediately(self) -> bool:
        is_at_source = self.log.here == self._situation.problem.source
        return is_at_source and not self._situation.windows.may_pass

    def _hand_over(self) -> None:
        self.log.hand_over()
        self._undelivered.discard(self.log.here)
        self._set_load(self._situation.load_kg(self._undelivered))

    def _set_load(self, load_kg: float) -> None:
        self._load_kg = load_kg
        self._speed_mps = speed_mps(self._model, load_kg)
        self._power_w = flight_power_w(self._model, load_kg)

    def _recharge(self, act: Act) -> None:
        self._land()
        log, power_w = self.log, self._situation.pad_power_w(self.log.here)
        until_soc = min(act.level_j / self._battery_j, self._top_soc)
        log.wait(until_s=act.not_before_s)
        if until_soc <= log.soc + _SAME_SOC:
            log.stand()
            return
        duration_s = recharge_time_s(model_on_pad(self._model, power_w), log.soc, until_soc)
        from_ms, until_ms = booked_from_ms(log.now_s), booked_until_ms(log.now_s + duration_s)
        if from_ms < until_ms:
            self.sessions.append((log.here, from_ms, until_ms))
            log.recharge(pad=_ANY_PAD, power_w=power_w, until_soc=until_soc, duration_s=duration_s)

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
                (n for n, each in enumerate(flights, 1) if self._is_free(each.to_id)),
                len(flights),
            )
            part, flights = flights[:count], flights[count:]
            self._fly(part, self._leave_s(part, -math.inf if flights else not_before_s))

    def _leave_s(self, flights: Sequence[Flight], touch_s: float) -> float:
        """When to leave for these flights, to touch down at this moment or later."""
        after_s, leave_s = 0.0, self.log.now_s
        for each in flights:
            # Comparing is faster than `max`, and this is done for each flight of a plan.
            if each.not_before_s - after_s > leave_s:
                leave_s = each.not_before_s - after_s
            after_s += each.flight_s
        return max(leave_s, touch_s - after_s)

    def _meets_nothing(self, flights: Sequence[Flight], leave_s: float) -> bool:
        """Whether flights from this moment on meet no closure, and the air that they are for."""
        here, after_s, uses = self.log.here, 0.0, []
        for each in flights:
            start_s = leave_s + after_s
            if self._weather is not None and not self._weather.has_air(
                each.row,
                each.air,
                start_s=start_s,
                end_s=start_s + each.flight_s,
                within_s=time_tolerance_s(start_s) / 2,
            ):
                return False
            uses.append(Use((here, each.to_id), after_s, each.flight_s))
            here, after_s = each.to_id, after_s + each.flight_s
        departure = self._situation.closures.earliest_departure(uses, not_before_s=leave_s)
        return departure.at_s <= leave_s + time_tolerance_s(leave_s)

    def _fly(self, flights: Sequence[Flight], leave_s: float) -> None:
        self.log.wait(until_s=leave_s)
        self.log.fly(flights, load_kg=self._load_kg)

    def _is_free(self, station_id: StationId) -> bool:
        """Whether a landing costs nothing there, and no closure forbids it."""
        is_closed = station_id in self._situation.closures.intervals()
        return self._model.stop_s == 0 and self._model.stop_j == 0 and not is_closed


def _with_pads(
    situation: Situation,
    steps: Iterable[StepFields],
    sessions: Sequence[tuple[StationId, int, int]],
) -> Iterator[StepFields]:
    """The steps, with a pad for each session; a session on several pads becomes several steps.

    A session for which there is no pad is left out.
    """
    taken = iter(situation.pads.taken_during(sessions))
    may_split = situation.problem.recharge_policy == "partial"
    for step in steps:
        if step["kind"] != "RECHARGE":
            yield step
            continue
        reserved = next(taken)
        pads = situation.pads.count(step["station_id"])
        pads_taken = {taken_pad for taken_pad, _, _ in reserved}
        step["pad"] = next(filterfalse(pads_taken.__contains__, range(pads)), _ANY_PAD)
        if step["pad"] != _ANY_PAD:
            yield step
        elif may_split:
            start_s, end_s = step["start_s"], step["end_s"]
            windows = windows_on_end(reserved, pads, from_s=start_s, until_s=end_s)
            yield from _on_pads(situation, step, windows)


def _on_pads(
    situation: Situation, session: StepFields, windows: Iterable[FreeWindow]
) -> Iterator[StepFields]:
    """The parts of the session, one in each of these windows."""
    now_s, soc = session["start_s"], session["soc_start"]
    model = model_on_pad(situation.model, session["power_w"])
    for window in windows:
        part = {**session, "pad": window.pad, "start_s": now_s, "soc_start": soc}
        reached_soc = soc_after_recharge(model, soc, window.end_s - now_s)
        if window.end_s >= session["end_s"] or reached_soc >= session["soc_end"]:
            yield part
            return
        until_s = now_s + recharge_time_s(model, soc, reached_soc)
        yield {**part, "end_s": until_s, "soc_end": reached_soc}
        now_s, soc = until_s, reached_soc
