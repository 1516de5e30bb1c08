"""One exact search: its arrays, made larger when full, and its runs."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from skyway.ids import StationId
from skyway.planner.exact_memory import AMPLE, Room, enlarged, new_memory
from skyway.planner.exact_task import (
    Legs,
    Method,
    Weights,
    book_of,
    closed_of,
    curve_of,
    latest_s,
    legs_of,
    required_before,
    rounding_j,
    weights_of,
)
from skyway.planner.kernels import bounds, hierarchy, memory, places, search, trees
from skyway.planner.kernels.handles import handle_of
from skyway.planner.kernels.memory import Floats, Ints
from skyway.planner.kernels.records import Search, Task
from skyway.planner.network_rows import rows_of
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort

_NO_LABEL = -1

#: Labels between two looks at the effort: some 10 ms of search.
_LABELS_PER_RUN = 1 << 14


class Ending(Enum):
    """How a run of the search ended."""

    PROVEN = search.PROVEN
    EXHAUSTED = search.EXHAUSTED
    PAUSED = search.PAUSED


class ExactSearch:
    """A search that can be run on, label by label, until it is proven.

    Parameters
    ----------
    order
        The destinations in the order in which they must be delivered; None leaves it open.
    weight
        At least 1, by which the bound is multiplied in the queue. Above 1 the search ends with the
        first plan, which it finds sooner and which may be later than the best.
    room
        How much its memory holds before it is made larger for the first time.
    """

    def __init__(
        self,
        situation: Situation,
        *,
        method: Method,
        order: Sequence[StationId] | None = None,
        weight: float = 1.0,
        room: Room = AMPLE,
    ) -> None:
        self._situation = situation
        self._method = method
        self._weight = weight
        row_of = situation.network.row_of
        self._destinations = np.array([row_of[each] for each in situation.destinations], np.int32)
        self._source = row_of[situation.problem.source]
        self._start = row_of[situation.problem.start_station_id]
        rows = rows_of(situation.network)
        if situation.hierarchy is not None:
            rows = situation.hierarchy.added_to(rows)
        self._skyway = handle_of(rows)
        self._closed = handle_of(closed_of(situation))
        self._books = [handle_of(book_of(book)) for book in situation.books]
        trees_needed = len(self._destinations) + (self._start != self._source)
        ranks = 0 if situation.hierarchy is None else len(situation.hierarchy.rank)
        self._memory = new_memory(trees_needed, ranks, room=room)
        self._notes = handle_of(self._memory)
        self._plant_trees()
        record = self._make_task(required_before(situation, order))
        #: Whether there is an order of the destinations with a path through all of them.
        self.has_order = len(self._destinations) == 0 or bool(
            np.isfinite(record.flight_after[0]).any()
        )
        self._task = handle_of(record)
        while not search.begin(*self._search()):
            self._enlarge()

    @property
    def labels(self) -> int:
        """How many labels there are."""
        return int(self._memory.counts[memory.LABELS])

    @property
    def stations_searched(self) -> int:
        """At how many stations there are labels."""
        return int(self._memory.counts[memory.SEARCHED])

    @property
    def lower_bound_s(self) -> float:
        """No plan delivers earlier than this; inf when there is none."""
        least_s = float(self._memory.best_s[0])
        if self._memory.counts[memory.QUEUE] > 0:
            least_s = min(least_s, float(self._memory.queue_key[0]))
        return least_s

    @property
    def missing_path(self) -> tuple[StationId, StationId] | None:
        """The first two places, in the order of a plan, between which there is no path."""
        problem, destinations = self._situation.problem, self._situation.destinations
        count = len(destinations)
        if self._start != self._source and self._distance_m(self._start, count) == math.inf:
            return problem.start_station_id, problem.source
        for tree, destination in enumerate(destinations):
            if self._distance_m(self._source, tree) == math.inf:
                return problem.source, destination
        return None

    def run(self, effort: Effort, *, most_labels: int) -> Ending:
        """Search until it is proven, so many labels are made, or the effort has to end."""
        end = self.labels + most_labels
        while True:
            before = self.labels
            ended = search.run(*self._search(), min(end, before + _LABELS_PER_RUN))
            is_over = effort.has_made(self.labels - before)
            if ended == search.OUT_OF_MEMORY:
                self._enlarge()
            elif ended != search.PAUSED or self.labels >= end:
                return Ending(ended)
            if is_over:
                return Ending.PAUSED

    def improve_on(self, delivered_s: float) -> None:
        """Look only for plans that deliver earlier than this."""
        self._memory.best_s[0] = min(self._memory.best_s[0], delivered_s)

    def best_acts(self) -> list["Act"] | None:
        """What the drone of the best plan so far does, from the start on; None without a plan."""
        label = int(self._memory.counts[memory.BEST])
        if label == _NO_LABEL:
            return None
        links, values = self._memory.link, self._memory.label
        chain = []
        left_with_j = float(values[label, memory.LEVEL])
        while label != _NO_LABEL:
            kind, parent = int(links[label, memory.KIND]), int(links[label, memory.PARENT])
            segment = _NO_LABEL
            level_j = math.nan
            if kind in (memory.FLOWN, memory.HANDED_OVER):
                segment = int(self._memory.arc_segment[links[label, memory.DETAIL]])
            elif kind == memory.SESSION:
                own_j = float(values[label, memory.LEVEL])
                # Only a lazy session's own level is where it starts, not where it ends.
                level_j = left_with_j if self._is_lazy else own_j
                left_with_j = own_j + float(values[parent, memory.USED])
            chain.append(Act(kind, segment, level_j, float(values[label, memory.NOT_BEFORE])))
            label = parent
        return chain[::-1]

    @property
    def _is_lazy(self) -> bool:
        is_full = self._situation.problem.recharge_policy == "full"
        return not is_full and self._method.charging == "lazy"

    def _search(self) -> Search:
        given, known = self._books
        return Search(self._skyway, self._task, self._closed, given, known, self._notes)

    def _distance_m(self, row: int, tree: int) -> float:
        place = places.place_of(self._notes, row)
        return float(self._memory.distance[tree, place])

    def _plant_trees(self) -> None:
        roots = self._destinations
        if self._start != self._source:
            roots = np.append(roots, np.int32(self._source))
        if self._situation.hierarchy is not None:
            hierarchy.root_all(self._skyway, self._notes, roots)
            self._memory.radius[:] = math.inf
            return
        while not trees.plant_all(
            self._skyway, self._closed, self._notes, roots, self._start, self._source
        ):
            self._enlarge()

    def _enlarge(self) -> None:
        self._memory = enlarged(self._memory)
        self._notes = handle_of(self._memory)

    def _make_task(self, required: Ints) -> Task:
        situation, method = self._situation, self._method
        problem, model = situation.problem, situation.model
        legs = legs_of(situation)
        finish_j = np.array([situation.finish_j(each) for each in situation.destinations])
        loading_s = problem.loading_s
        if situation.packages_for(problem.source):
            loading_s += problem.dropoff_s
        curve_s, curve_j = curve_of(model)
        flight, need = (
            self._bound(legs, weights, required, finish_j)
            for weights in weights_of(model, problem.recharge_policy, method)
        )
        first_stop_s = model.stop_s + loading_s
        return Task(
            destinations=self._destinations,
            source=self._source,
            start=self._start,
            s_per_m=legs.s_per_m,
            j_per_m=legs.j_per_m,
            flight_s_per_m=flight.per_m,
            need_per_m=need.per_m,
            flight_after=flight.after,
            need_after=need.after,
            approach_flight_after=flight.weights.of(first_stop_s, model.stop_j) + flight.least,
            approach_need_after=need.weights.of(first_stop_s, model.stop_j) + need.least,
            finish_j=finish_j,
            finish_j_at_source=0.0
            if situation.destinations
            else situation.finish_j(problem.source),
            curve_s=curve_s,
            curve_j=curve_j,
            start_j=problem.drone.soc * model.battery_j,
            reserve_j=model.reserve_soc * model.battery_j,
            rounding_j=rounding_j(model),
            s_per_j=need.weights.per_joule,
            stop_s=model.stop_s,
            stop_j=model.stop_j,
            loading_s=loading_s,
            dropoff_s=problem.dropoff_s,
            latest_s=latest_s(situation),
            recharges_fully=problem.recharge_policy == "full",
            prunes=method.dominance == "full",
            levels=0 if method.charging == "lazy" else method.charging,
            weight=self._weight,
        )

    def _bound(self, legs: Legs, weights: Weights, required: Ints, finish_j: Floats) -> "_Bound":
        """What is still to come at least, counted by these weights."""
        model, count = self._situation.model, len(self._destinations)
        per_m = weights.of(legs.s_per_m, legs.j_per_m)
        after = np.empty((1 << count, count))
        least = bounds.fill_orders(
            trees.distances(self._skyway, self._notes, self._destinations, self._source, count),
            required,
            per_m,
            weights.of(model.stop_s + self._situation.problem.dropoff_s, model.stop_j),
            weights.of(0.0, 1.0) * np.where(np.isinf(finish_j), 0.0, finish_j)
            + np.where(np.isinf(finish_j), np.inf, 0.0),
            after,
        )
        return _Bound(weights, per_m, after, least)


@dataclass(frozen=True, slots=True)
class Act:
    """One thing that the drone of a plan does: a kind of label.

    `segment` is the row of the segment flown, -1 without one; `level_j` the level with which it
    leaves the pad; `not_before_s` the moment before which the flight, landing or session may not
    begin.
    """

    kind: int
    segment: int
    level_j: float
    not_before_s: float


@dataclass(frozen=True, slots=True)
class _Bound:
    """A bound as `Task` holds it, and the least of all from the source."""

    weights: Weights
    per_m: Floats
    after: Floats
    least: float
