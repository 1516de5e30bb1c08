"""A route: the segments that a drone flies for one order of destinations, and where it hands over.

A route has no times: the itinerary decides when to wait and where to recharge. The shortest route
on which pads are never too far apart is found by label setting (A*) over (stretch, station): a
label holds the flight time so far and the energy used since the last pad, as if every pad filled
the battery to the top. Where all stations have pads this is the plain shortest path; where some
have none it finds the detour.
"""

import heapq
import math
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from itertools import count

from skyway.drone.flight import flight_energy_j, speed_mps
from skyway.ids import StationId
from skyway.network.network import Segment
from skyway.planner.airspace import SegmentEnds
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort
from skyway.planner.subnetwork import Subnetwork
from skyway.units import CHARGE_TOLERANCE

#: Segments not to fly and stations not to recharge at.
Avoided = AbstractSet[SegmentEnds | StationId]


@dataclass(frozen=True, slots=True)
class Stretch:
    """A flight without segments yet: its target, its load, and the part of the network to use.

    `keep_off` are destinations whose packages are on board: flying there would deliver them.
    """

    target: StationId
    load_kg: float
    subnetwork: Subnetwork
    keep_off: frozenset[StationId] = frozenset()


@dataclass(frozen=True, slots=True)
class Leg:
    """A stretch whose segments are chosen."""

    target: StationId
    load_kg: float
    segments: tuple[Segment, ...]


Route = tuple[Leg, ...]


def stretches(
    situation: Situation,
    order: Sequence[StationId],
    *,
    subnetwork: Subnetwork,
    approach: Subnetwork,
) -> tuple[Stretch, ...]:
    """What has to be flown for this order: the approach if there is one, then each destination."""
    problem = situation.problem
    flights = []
    if problem.start_station_id != problem.source:
        flights.append(Stretch(problem.source, 0.0, approach))
    for number, target in enumerate(order):
        undelivered = frozenset(order[number:])
        flights.append(
            Stretch(target, situation.load_kg(undelivered), subnetwork, undelivered - {target})
        )
    return tuple(flights)


@dataclass(frozen=True, slots=True)
class _Label:
    """A partial route: its place, its cost, and the label and segment before."""

    stretch: int
    here: StationId
    flown_s: float
    used_j: float
    before: "_Label | None" = None
    segment: Segment | None = None


def find_route(
    situation: Situation, flights: Sequence[Stretch], *, avoided: Avoided, effort: Effort
) -> Route | None:
    """The route of least flight time through these stretches, or None."""
    return _RouteSearch(situation, flights, avoided).run(effort)


class _RouteSearch:
    def __init__(self, situation: Situation, flights: Sequence[Stretch], avoided: Avoided) -> None:
        self._situation = situation
        self._flights = flights
        self._avoided = avoided
        model = situation.model
        self._limit_j = situation.capacity_j + CHARGE_TOLERANCE * model.battery_j
        self._speeds = [speed_mps(model, flight.load_kg) for flight in flights]
        self._j_per_m = [
            flight_energy_j(model, length_m=1.0, load_kg=flight.load_kg) for flight in flights
        ]
        self._lengths_to = [flight.subnetwork.lengths_to_m(flight.target) for flight in flights]
        self._after_s = self._times_after_each_stretch()

    def run(self, effort: Effort) -> Route | None:
        """Settle labels in the order of their least total time until one is through."""
        tie_breaker = count()
        heap: list[tuple[float, int, _Label]] = []
        least_used_j: dict[tuple[int, StationId], float] = {}

        def push(label: _Label) -> None:
            total_s = label.flown_s + self._still_takes_s(label)
            if total_s < math.inf and label.used_j <= self._limit_j:
                heapq.heappush(heap, (total_s, next(tie_breaker), label))

        push(self._first_label())
        while heap and not effort.is_spent():
            _, _, label = heapq.heappop(heap)
            if label.stretch == len(self._flights):
                return self._traced(label)
            place = (label.stretch, label.here)
            if label.used_j >= least_used_j.get(place, math.inf):
                continue
            least_used_j[place] = label.used_j
            for segment in self._flights[label.stretch].subnetwork.segments_from(label.here):
                if self._is_allowed(label, segment):
                    push(self._flown(label, segment))
        return None

    def _first_label(self) -> _Label:
        situation = self._situation
        start, model = situation.problem.start_station_id, situation.model
        used_j = (model.top_soc - situation.problem.drone.soc) * model.battery_j
        if situation.has_free_pad(start) and start not in self._avoided:
            used_j = min(used_j, 0.0)
        return _Label(0, start, 0.0, used_j)

    def _is_allowed(self, label: _Label, segment: Segment) -> bool:
        return (
            segment.to_id not in self._flights[label.stretch].keep_off
            and (segment.from_id, segment.to_id) not in self._avoided
        )

    def _flown(self, label: _Label, segment: Segment) -> _Label:
        """The label at the end of this segment; its energy exceeds the limit if it is too far."""
        situation, number, here = self._situation, label.stretch, segment.to_id
        flown_s = label.flown_s + segment.length_m / self._speeds[number]
        used_j = label.used_j + segment.length_m * self._j_per_m[number]
        stop_j = situation.model.stop_j
        if here == self._flights[number].target:
            number += 1
            used_j += stop_j
            can_fill = used_j <= self._limit_j
            if number == len(self._flights):
                return _Label(
                    number, here, flown_s, used_j + situation.finish_j(here), label, segment
                )
        else:
            can_fill = used_j + stop_j <= self._limit_j
        if can_fill and here not in self._avoided and situation.can_land_to_recharge(here):
            used_j = min(used_j, 0.0)
        return _Label(number, here, flown_s, used_j, label, segment)

    def _still_takes_s(self, label: _Label) -> float:
        if label.stretch == len(self._flights):
            return 0.0
        length_m = self._lengths_to[label.stretch].get(label.here, math.inf)
        return length_m / self._speeds[label.stretch] + self._after_s[label.stretch]

    def _times_after_each_stretch(self) -> list[float]:
        """Least flight time of all stretches after each one."""
        after_s = [0.0] * len(self._flights)
        for number in range(len(self._flights) - 1, 0, -1):
            start = self._flights[number - 1].target
            length_m = self._lengths_to[number].get(start, math.inf)
            after_s[number - 1] = after_s[number] + length_m / self._speeds[number]
        return after_s

    def _traced(self, label: _Label) -> Route:
        segments: list[list[Segment]] = [[] for _ in self._flights]
        while label.before is not None and label.segment is not None:
            segments[label.before.stretch].append(label.segment)
            label = label.before
        return tuple(
            Leg(flight.target, flight.load_kg, tuple(reversed(flown)))
            for flight, flown in zip(self._flights, segments, strict=True)
        )
