"""Cheap proofs that no plan exists; without such a proof the status is unknown.

The proof of OUT_OF_RANGE is a search without time, in which every pad is free. Its labels hold the
least energy used since a full battery, by station and remaining destinations. Time does not count,
so less energy is always better, and one label for each station and set is enough. If no label
reaches the last delivery, no plan does.
"""

import heapq
import math
from dataclasses import dataclass
from itertools import count

from skyway.delivery.plan import Infeasibility
from skyway.drone.cargo import misfit
from skyway.ids import StationId
from skyway.planner.matrix import TimeMatrix
from skyway.planner.problem import Problem
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort, LabelLimit, Stop, first_of
from skyway.planner.subnetwork import Subnetwork
from skyway.units import CHARGE_TOLERANCE, LOAD_TOLERANCE_KG, time_tolerance_s

#: Labels after which the proof of OUT_OF_RANGE is given up. Our own choice: about 1 s.
_MAX_LABELS = 50_000


def not_carried(problem: Problem) -> Infeasibility | None:
    """OVERWEIGHT, TOO_LARGE or HANDLING if the drone cannot carry all packages together."""
    mass_kg = math.fsum(package.mass_kg for package in problem.packages)
    model = problem.drone.model
    if mass_kg <= model.max_payload_kg + LOAD_TOLERANCE_KG:
        found = misfit(model, problem.packages)
        return None if found is None else Infeasibility(code=found.code, detail=found.detail)
    return Infeasibility(
        code="OVERWEIGHT",
        detail=f"payload {mass_kg:g} kg exceeds the {model.max_payload_kg:g} kg limit of drone "
        f"model {model.model_id}",
    )


def proof_of_infeasibility(situation: Situation, stop: Stop) -> Infeasibility | None:
    """Why no plan exists, if a search without pad times or a lower bound shows it."""
    whole = Subnetwork.whole(situation)
    unreachable = _unreachable(situation, whole)
    if unreachable is not None:
        return unreachable
    lower_bound_s = TimeMatrix(situation, whole, approach=whole).lower_bound_s()
    if lower_bound_s == math.inf:
        detail = "no order of the destinations has a path through all of them"
        return Infeasibility(code="DESTINATION_UNREACHABLE", detail=detail)
    effort = Effort(first_of(stop, LabelLimit(_MAX_LABELS)))
    # With windows a drone may fly over a destination, which this search does not know.
    if not situation.windows.may_pass and is_out_of_range(situation, whole, effort):
        return Infeasibility(
            code="OUT_OF_RANGE",
            detail="even with every pad free and every recharge to the top of the charge curve "
            f"the {situation.model.model_id} cannot fly to all destinations in turn",
        )
    latest_s = situation.problem.latest_delivery_s
    if latest_s is not None and lower_bound_s > latest_s + time_tolerance_s(latest_s):
        return Infeasibility(
            code="TOO_LATE",
            detail=f"no plan is over before {lower_bound_s:.3f} s, even with every pad free; "
            f"latest_delivery_s is {latest_s:g}",
        )
    return None


def _unreachable(situation: Situation, whole: Subnetwork) -> Infeasibility | None:
    """DESTINATION_UNREACHABLE for the first place to which no path leads, or that is closed."""
    problem = situation.problem
    flights = [(problem.source, station_id) for station_id in situation.destinations]
    if problem.start_station_id != problem.source:
        flights.insert(0, (problem.start_station_id, problem.source))
    for start, end in flights:
        detail = None
        if situation.closures.is_closed_for_good(end):
            detail = f"station {end!r} is closed for good"
        elif start not in whole.lengths_to_m(end):
            detail = f"no path leads from {start!r} to {end!r}"
        if detail is not None:
            return Infeasibility(code="DESTINATION_UNREACHABLE", detail=detail)
    return None


@dataclass(frozen=True, slots=True)
class _Place:
    """A station and the remaining destinations; None while the packages are not on board."""

    here: StationId
    waiting: frozenset[StationId] | None


def is_out_of_range(situation: Situation, whole: Subnetwork, effort: Effort) -> bool:
    """Whether it is proven that the drone cannot deliver everything, however it recharges."""
    search = _RangeSearch(situation)
    tie_breaker = count()
    place, used_j = search.start()
    heap = [(used_j, next(tie_breaker), place)]
    least_used_j: dict[_Place, float] = {}
    while heap:
        used_j, _, place = heapq.heappop(heap)
        if used_j >= least_used_j.get(place, math.inf):
            continue
        if search.is_done(place, used_j) or effort.is_spent():
            return False
        least_used_j[place] = used_j
        load_kg = situation.load_kg(place.waiting or frozenset())
        for segment in whole.segments_from(place.here):
            reached_j = used_j + situation.flight_j(segment, load_kg)
            reached, reached_j = search.arrive(segment.to_id, place.waiting, reached_j)
            if reached_j <= search.limit_j:
                heapq.heappush(heap, (reached_j, next(tie_breaker), reached))
    return True


class _RangeSearch:
    def __init__(self, situation: Situation) -> None:
        self._situation = situation
        self._all = frozenset(situation.destinations)
        rounding_j = CHARGE_TOLERANCE * situation.model.battery_j
        self.limit_j = situation.capacity_j + rounding_j

    def start(self) -> tuple[_Place, float]:
        """Where the drone stands at time 0, on a pad if there is one."""
        problem, model = self._situation.problem, self._situation.model
        start = problem.start_station_id
        used_j = (model.top_soc - problem.drone.soc) * model.battery_j
        if self._situation.network.stations[start].pads > 0:
            used_j = min(used_j, 0.0)
        return _Place(start, self._all if start == problem.source else None), used_j

    def is_done(self, place: _Place, used_j: float) -> bool:
        """Whether everything is delivered with enough left for the finish."""
        if place.waiting is None or place.waiting:
            return False
        return used_j + self._situation.finish_j(place.here) <= self.limit_j

    def arrive(
        self, here: StationId, waiting: frozenset[StationId] | None, used_j: float
    ) -> tuple[_Place, float]:
        """The place after a segment: landed there if packages change hands or a pad is in reach."""
        stop_j = self._situation.model.stop_j
        has_landed = True
        if waiting is None and here == self._situation.problem.source:
            waiting, used_j = self._all, used_j + stop_j
        elif waiting is not None and here in waiting:
            waiting, used_j = waiting - {here}, used_j + stop_j
        else:
            has_landed = False
        is_last = waiting is not None and not waiting
        landed_j = used_j if has_landed else used_j + stop_j
        if not is_last and landed_j <= self.limit_j and self._has_open_pad(here):
            used_j = min(used_j, 0.0)
        return _Place(here, waiting), used_j

    def _has_open_pad(self, station_id: StationId) -> bool:
        return self._situation.network.stations[
            station_id
        ].pads > 0 and not self._situation.closures.is_closed_for_good(station_id)
