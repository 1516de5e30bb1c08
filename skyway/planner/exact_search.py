"""One exact search: its arrays, made larger when full, and its runs."""

import math
from collections.abc import Sequence
from enum import Enum
from typing import Final

import numpy as np

from skyway.ids import StationId
from skyway.planner.exact_acts import Act, best_acts
from skyway.planner.exact_memory import AMPLE, Room, enlarged, new_memory
from skyway.planner.exact_task import (
    Method,
    book_handle,
    closed_handle,
    latest_s,
    required_before,
    task_of,
)
from skyway.planner.hierarchy import rows_in_weather, rows_of
from skyway.planner.kernels import hierarchy as distances
from skyway.planner.kernels import memory, places, search, trees
from skyway.planner.kernels.handles import handle_of
from skyway.planner.kernels.memory import Floats
from skyway.planner.kernels.records import Search
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort

#: Labels between two checks of the effort: about 10 ms of search.
_LABELS_PER_RUN = 1 << 14

#: A narrow search divides the time of the whole plan by this. Our own choice.
LAYERS: Final = 256


class Ending(Enum):
    """How a run of the search ended."""

    PROVEN = search.PROVEN
    EXHAUSTED = search.EXHAUSTED
    PAUSED = search.PAUSED


class ExactSearch:
    """A search that can be continued, label by label, until its result is proven.

    Parameters
    ----------
    order
        The destinations in the order in which they must be delivered; None leaves it open.
    weight
        At least 1, by which the bound is multiplied in the queue. Above 1 the search ends with the
        first plan, which it finds sooner and which may be later than the best.
    width
        A narrow search takes at most so many labels from the queue that need about as long until
        the last delivery, and drops the others. It finds good plans soon, and proves nothing.
    until_s
        Only plans that deliver everything by then count.
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
        width: int | None = None,
        until_s: float = math.inf,
        room: Room = AMPLE,
    ) -> None:
        self._situation = situation
        self._method = method
        row_of = situation.network.row_of
        self._destinations = np.array([row_of[each] for each in situation.destinations], np.int32)
        self._source = row_of[situation.problem.source]
        self._start = row_of[situation.problem.start_station_id]
        hierarchy, weather = situation.hierarchy, situation.problem.weather
        least_energy_factor = 1.0
        if weather is not None:
            until_s = min(until_s, latest_s(situation))
            rows = rows_in_weather(weather, until_s=until_s)
            self._skyway = handle_of(rows._replace(pads=situation.network.columns.pads))
            least_energy_factor = weather.least_energy_factor(until_s=until_s)
        elif hierarchy is None:
            self._skyway = handle_of(rows_of(situation.network))
        else:
            self._skyway = hierarchy.skyway
        self._closed = closed_handle(situation)
        self._books = [book_handle(book) for book in situation.books]
        #: Whether the search begins before the pickup, and so needs a tree of the source.
        self._approaches = self._start != self._source or situation.windows.may_pass
        trees_needed = len(self._destinations) + self._approaches
        ranks = 0 if hierarchy is None else len(hierarchy.rank)
        self._memory = new_memory(
            trees_needed,
            ranks,
            room=room,
            has_weather=weather is not None,
            layers=0 if width is None else LAYERS,
        )
        self._notes = handle_of(self._memory)
        self._plant_trees()
        record = task_of(
            situation,
            method,
            required=required_before(situation, order),
            apart_m=self._apart_m(),
            least_energy_factor=least_energy_factor,
            until_s=until_s,
            weight=weight,
        )
        #: Whether there is an order of the destinations with a path through all of them.
        self.has_order = not self._destinations.size or bool(
            np.isfinite(record.flight_after[0]).any()
        )
        self._task = handle_of(record)
        while not search.begin(*self._search()):
            self._enlarge()
        if width is not None and 0.0 < self.lower_bound_s < math.inf:
            self._memory.layer_size[:] = self.lower_bound_s / LAYERS, width

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

    def narrow_to(self, width: int) -> None:
        """From now on take at most so many labels that need about as long, as a narrow search."""
        self._memory.layer_size[1] = width

    def best_acts(self) -> list[Act] | None:
        """The acts of the best plan so far, from the start on; None without a plan."""
        is_full = self._situation.problem.recharge_policy == "full"
        return best_acts(self._memory, is_lazy=not is_full and self._method.charging == "lazy")

    def _search(self) -> Search:
        given, known = self._books
        return Search(self._skyway, self._task, self._closed, given, known, self._notes)

    def _distance_m(self, row: int, tree: int) -> float:
        place = places.place_of(self._notes, row)
        return float(self._memory.distance[tree, place])

    def _plant_trees(self) -> None:
        roots = self._destinations
        if self._approaches:
            roots = np.append(roots, np.int32(self._source))
        if self._situation.hierarchy is not None:
            distances.root_all(self._skyway, self._notes, roots)
            self._memory.radius[:] = math.inf
            return
        while not trees.plant_all(
            self._skyway, self._closed, self._notes, roots, self._start, self._source
        ):
            self._enlarge()

    def _apart_m(self) -> Floats:
        """As in `bounds_of`."""
        count = len(self._destinations)
        while True:
            apart_m = trees.distances(
                self._skyway, self._closed, self._notes, self._destinations, self._source, count
            )
            if not self._memory.counts[memory.FULL]:
                return apart_m
            self._enlarge()

    def _enlarge(self) -> None:
        self._memory = enlarged(self._memory)
        self._notes = handle_of(self._memory)
