"""The itinerary of a route: when a drone flies, waits, recharges and hands over.

The paper's rule (docs/reference/planner-problem.md): the drone recharges where the next segment,
and then a pad, is not in reach, to the policy's amount; elsewhere it flies over without landing.
A station where it would have to wait for a pad is left out if recharging earlier is faster.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from skyway.drone.charging import model_on_pad, recharge_time_s
from skyway.ids import StationId
from skyway.network.network import Segment
from skyway.planner.airspace import SegmentEnds
from skyway.planner.closures import Use
from skyway.planner.flight_log import Flight, FlightLog, StepFields
from skyway.planner.route import Route
from skyway.planner.situation import Situation
from skyway.units import CHARGE_TOLERANCE, time_tolerance_s


@dataclass(frozen=True, slots=True)
class Itinerary:
    """The steps of a route, or the reason why it cannot be flown.

    `delivered_s` is the end of the last delivery, infinite when the drone gets stuck. `hindrances`
    are the stations where it waited for a pad and what it found closed, in the order met.
    """

    delivered_s: float
    steps: tuple[StepFields, ...]
    hindrances: tuple[SegmentEnds | StationId, ...]

    @property
    def is_stuck(self) -> bool:
        """Whether the route cannot be flown to its end."""
        return self.delivered_s == math.inf


@dataclass(frozen=True, slots=True)
class _Passage:
    """One segment of the route, flown with the load of its leg."""

    segment: Segment
    load_kg: float
    duration_s: float
    energy_j: float


def fly(situation: Situation, route: Route) -> Itinerary:
    """The itinerary of this route, by the rule above."""
    left_out: frozenset[StationId] = frozenset()
    best = _RouteFlight(situation, route, left_out).fly()
    tried: set[StationId] = set()
    while True:
        congested = next(
            (
                station
                for station in best.hindrances
                if isinstance(station, str) and station not in tried
            ),
            None,
        )
        if congested is None:
            return best
        tried.add(congested)
        other = _RouteFlight(situation, route, left_out | {congested}).fly()
        if other.delivered_s < best.delivered_s:
            best, left_out = other, left_out | {congested}


class _Stuck(Exception):
    """The route cannot be continued; caught in this file."""


class _RouteFlight:
    """One flight along a route that does not recharge at the stations left out.

    Places on the route are numbered from 0, the start; passage i leads from place i to i + 1.
    """

    def __init__(self, situation: Situation, route: Route, left_out: frozenset[StationId]) -> None:
        self._situation = situation
        self._log = FlightLog(situation)
        self._hindrances: list[SegmentEnds | StationId] = []
        self._passages = [
            _Passage(
                segment,
                leg.load_kg,
                situation.flight_s(segment, leg.load_kg),
                situation.flight_j(segment, leg.load_kg),
            )
            for leg in route
            for segment in leg.segments
        ]
        ends = [passage.segment.to_id for passage in self._passages]
        self._stations = [situation.problem.start_station_id, *ends]
        self._hand_overs = _places_of_hand_over(route)
        self._can_recharge = [
            situation.has_free_pad(self._stations[0]),
            *(situation.can_land_to_recharge(station) for station in ends),
        ]
        for place, station in enumerate(self._stations):
            if station in left_out:
                self._can_recharge[place] = False
        self._needs_j = self._energy_to_next_pad_j()

    def fly(self) -> Itinerary:
        """Fly it from the start to the last delivery, or until stuck."""
        try:
            self._fly_all_passages()
        except _Stuck:
            return Itinerary(math.inf, (), tuple(self._hindrances))
        return Itinerary(self._log.now_s, tuple(self._log.steps), tuple(self._hindrances))

    def _fly_all_passages(self) -> None:
        if self._stations[0] == self._situation.problem.source:
            self._wait_for_window()
            self._log.pick_up()
        here, last = 0, len(self._passages)
        while here < last:
            if not self._is_in_reach(here, self._log.soc):
                self._recharge(here)
            landing = self._next_landing(here)
            self._fly_hop(here, landing)
            here = landing
            if here in self._hand_overs:
                self._wait_for_window()
                self._log.hand_over()
        if not self._is_in_reach(last, self._log.soc):
            raise _Stuck

    def _wait_for_window(self) -> None:
        """Wait until packages may change hands here."""
        for from_s, until_s in self._situation.windows.starts_at(self._log.here):
            if self._log.now_s <= until_s + time_tolerance_s(until_s) / 2:
                self._log.wait(until_s=from_s)
                return
        raise _Stuck

    def _energy_to_next_pad_j(self) -> list[float]:
        """For every place: the energy to fly on, and down to the next pad (or the finish)."""
        last, stop_j = len(self._passages), self._situation.model.stop_j
        needs_j = [0.0] * last + [self._situation.finish_j(self._stations[last])]
        for place in range(last - 1, -1, -1):
            reached = place + 1
            beyond_j = needs_j[reached]
            if reached in self._hand_overs:
                is_filled = self._can_recharge[reached] and reached < last
                beyond_j = stop_j + (0.0 if is_filled else beyond_j)
            elif self._can_recharge[reached]:
                beyond_j = min(stop_j, beyond_j)
            needs_j[place] = self._passages[place].energy_j + beyond_j
        return needs_j

    def _is_in_reach(self, place: int, soc: float) -> bool:
        left_soc = soc - self._needs_j[place] / self._situation.model.battery_j
        return left_soc >= self._situation.model.reserve_soc - CHARGE_TOLERANCE

    def _next_landing(self, here: int) -> int:
        """The first place ahead where packages are handed over or a recharge is due."""
        soc = self._log.soc
        for place in range(here + 1, len(self._passages)):
            soc -= self._passages[place - 1].energy_j / self._situation.model.battery_j
            if place in self._hand_overs:
                return place
            if self._can_recharge[place] and not self._is_in_reach(place, soc):
                return place
        return len(self._passages)

    def _recharge(self, place: int) -> None:
        """Recharge here by the policy, waiting for a pad if necessary."""
        model, station = self._situation.model, self._stations[place]
        until_soc = model.top_soc
        if self._situation.problem.recharge_policy == "partial":
            until_soc = model.reserve_soc + self._needs_j[place] / model.battery_j
        until_soc = min(until_soc, model.top_soc)
        is_enough = self._can_recharge[place] and self._is_in_reach(place, until_soc)
        if not is_enough or until_soc <= self._log.soc:
            raise _Stuck
        power_w = self._situation.pad_power_w(station)
        duration_s = recharge_time_s(model_on_pad(model, power_w), self._log.soc, until_soc)
        session = self._situation.pads.earliest_session(
            station, not_before_s=self._log.now_s, duration_s=duration_s
        )
        if session is None or session.start_s > self._log.now_s:
            self._hindrances.append(station)
        if session is None:
            raise _Stuck
        self._log.wait(until_s=session.start_s)
        self._log.recharge(
            pad=session.pad, power_w=power_w, until_soc=until_soc, duration_s=duration_s
        )

    def _fly_hop(self, here: int, landing: int) -> None:
        """Fly from one landing to the next, leaving when all of it is open."""
        hop = self._passages[here:landing]
        departure = self._situation.closures.earliest_departure(
            self._uses(hop), not_before_s=self._log.now_s
        )
        if departure.because_of is not None:
            self._hindrances.append(departure.because_of)
        if departure.at_s == math.inf:
            raise _Stuck
        self._log.wait(until_s=departure.at_s)
        flights = [Flight(one.segment.to_id, one.duration_s, one.energy_j) for one in hop]
        self._log.fly(flights, load_kg=hop[0].load_kg)

    def _uses(self, hop: Sequence[_Passage]) -> list[Use]:
        """The segments that a hop flies, and the station where it lands."""
        uses: list[Use] = []
        after_s = 0.0
        for passage in hop:
            segment = passage.segment
            ends: SegmentEnds = (segment.from_id, segment.to_id)
            uses.append(Use(ends, after_s, passage.duration_s))
            after_s += passage.duration_s
        uses.append(Use(hop[-1].segment.to_id, after_s, self._situation.model.stop_s))
        return uses


def _places_of_hand_over(route: Route) -> frozenset[int]:
    """The numbers of the places where legs end."""
    lengths = [len(leg.segments) for leg in route]
    return frozenset(sum(lengths[: number + 1]) for number in range(len(lengths)))
