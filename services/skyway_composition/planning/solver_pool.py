"""Runs the planner, and reads large problems, without blocking the event loop.

Most local requests are solved in a millisecond. A thread costs more than that: it must wake up,
wait for the interpreter and report back. So small problems are composed on the event loop, and all
others in threads. Large problems are read one at a time, because a caller cannot stop a thread.
"""

import asyncio
import logging
import threading
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import Final, Self, TypeVar

import numpy as np

from skyway.delivery.plan import Plan, PlanStatus, Recharge
from skyway.geo import Box
from skyway.ids import StationId
from skyway.network.columns import Rows
from skyway.network.great_circle import beside_deg
from skyway.network.network import Network
from skyway.planner.airspace import Airspace
from skyway.planner.compose import DEFAULT_STRATEGY, compose
from skyway.planner.exact import ROOM_BEFORE_HASTE
from skyway.planner.hierarchy import Hierarchy
from skyway.planner.pad_book import NO_RESERVATIONS, PadBook
from skyway.planner.problem import Problem
from skyway.planner.stop import Stop, TimeLimit, first_of
from skyway.planner.verify import PlanRejected
from skyway.planner.warm import is_on_disk, warm
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.metrics import timed
from skyway.units import moment_to_ms
from skyway_composition.planning.world import World

log = logging.getLogger(__name__)

#: The most problems that may wait for a thread; later callers are asked to try again.
_MOST_WAITING: Final = 500

#: Larger problems go to a thread immediately, because they take long even before the search.
_FEW_STATIONS, _FEW_PACKAGES, _FEW_CLOSURES = 5_000, 5, 50

#: How far around a request's places pads are read first, as a share of the distance between them.
#: Our own choice: most detours to recharge lie within this margin.
_FIRST_MARGIN: Final = 0.25

#: How often the box around the places is widened before the whole network is read.
_MOST_BOXES: Final = 3


class _TakesLong(Exception):
    """A problem needs more labels than the event loop may make."""


class SolverPool:
    """Composes plans; a search in a thread ends when its time is up or its caller has left.

    Parameters
    ----------
    name
        What it plans, for the metrics.
    inline_labels
        The most labels that a search may make on the event loop; 16 labels take about 10 us, and
        most searches make fewer than 100. A search that needs more starts again in a thread. With
        0 all searches run in threads.
    """

    def __init__(
        self,
        *,
        threads: int,
        time_limit_s: float,
        name: str = "missions",
        inline_labels: int = 0,
    ) -> None:
        self.name = name
        self._threads = threads
        self._time_limit_s = time_limit_s
        self._inline_labels = inline_labels
        self._waiting = 0
        self._executor: ThreadPoolExecutor | None = None
        #: Set when a drone reports: plans will be needed.
        self.needed = asyncio.Event()
        #: Whether the planner is compiled, and whether it is loaded too.
        self.is_compiled = self.is_warm = False

    async def __aenter__(self) -> Self:
        self._executor = ThreadPoolExecutor(self._threads, thread_name_prefix="solver")
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._executor is not None:
            self._executor.shutdown(wait=True, cancel_futures=True)
            self._executor = None

    async def warm(self) -> None:
        """Compile the planner, or load it from disk.

        Compiled code belongs to the process, so one call serves all pools.
        """
        log.info("compiling the planner, or loading what was compiled before")
        started_at = time.monotonic()
        await asyncio.get_running_loop().run_in_executor(self._executor, warm)
        self.is_compiled = self.is_warm = True
        log.info("planner ready", extra={"elapsed_s": round(time.monotonic() - started_at, 1)})

    async def warm_when_needed(self) -> None:
        """Load the planner when a drone reports; compile it now if it is not on disk.

        Loaded, it takes 100 MB and half a second of processor time.
        """
        if not self.needed.is_set() and await asyncio.to_thread(is_on_disk):
            self.is_compiled = True
            await self.needed.wait()
        await self.warm()

    @property
    def under_way(self) -> int:
        """How many problems wait for a thread or are in one."""
        return self._waiting

    async def compose(
        self,
        problem: Problem,
        *,
        airspace: Airspace | None = None,
        booked: PadBook = NO_RESERVATIONS,
        hierarchy: Hierarchy | None = None,
    ) -> Plan:
        """The plan for this problem; UNKNOWN when the time was up before one was found.

        Raises
        ------
        ServiceUnavailable
            Too many problems wait for a thread.
        """
        with timed("skyway_planning_duration_seconds", "time to plan once", queue=self.name):
            return await self._plan(problem, airspace, booked, hierarchy)

    async def _plan(
        self,
        problem: Problem,
        airspace: Airspace | None,
        booked: PadBook,
        hierarchy: Hierarchy | None,
    ) -> Plan:
        if self._executor is None or self._waiting >= _MOST_WAITING:
            raise ServiceUnavailable("planning", f"{self._waiting} problems wait for a thread")
        # Before the planner is compiled, even a small problem may take a minute.
        if self._inline_labels and self.is_warm and _is_small(problem, airspace, hierarchy):
            plan = self._compose_inline(problem, airspace, booked, hierarchy)
            # Other tasks get their turn between the plans of a caller that needs a hundred.
            await asyncio.sleep(0)
            if plan is not None:
                return plan
        is_abandoned = threading.Event()
        loop = asyncio.get_running_loop()
        self._waiting += 1
        try:
            return await loop.run_in_executor(
                self._executor, self._compose, problem, airspace, booked, hierarchy, is_abandoned
            )
        finally:
            self._waiting -= 1
            is_abandoned.set()

    async def compose_in(self, world: World, problem: Problem) -> Plan:
        """The plan of a problem with a `start_at`, in this world's weather and reservations.

        A problem with fewer reservations is easier. If its plan charges only at stations that were
        read, the plan and its proof hold for the whole problem. If it has no plan, the whole
        problem has none. In all other cases more stations are read and the problem is composed
        again. Only the exact search finds the same plan either way; for other strategies all
        stations are read.
        """
        network = world.skyway.network
        start_ms = 0 if problem.start_at is None else moment_to_ms(problem.start_at)
        weather = await world.weather(problem.drone.model, start_ms)
        if weather is not None:
            problem = problem.model_copy(update={"weather": weather})
        places = {problem.source, problem.start_station_id}
        places.update(package.destination for package in problem.packages)
        margin = _FIRST_MARGIN
        every = np.arange(len(network.row_of), dtype=np.int32)
        boxes = _MOST_BOXES if problem.strategy in (None, DEFAULT_STRATEGY) else 0
        while True:
            around = _rows_around(network, places, margin) if boxes > 0 else every
            await world.pads.read(around)
            plan = await self.compose(
                problem,
                airspace=world.skyway.airspace,
                hierarchy=world.skyway.hierarchy,
                booked=world.pads.book.seen_from(start_ms),
            )
            charging = {step.station_id for step in plan.steps if isinstance(step, Recharge)}
            unread = {each for each in charging if not world.pads.has_read(each)}
            if not unread:
                return plan
            places |= unread
            margin *= 2
            boxes -= 1

    def _compose_inline(
        self,
        problem: Problem,
        airspace: Airspace | None,
        booked: PadBook,
        hierarchy: Hierarchy | None,
    ) -> Plan | None:
        """The plan of a problem that needs few labels; None when it may need more."""
        limit = ROOM_BEFORE_HASTE * self._inline_labels
        limited = problem.model_copy(update={"label_limit": limit})
        try:
            return _composed(limited, self._give_up, airspace, booked, hierarchy)
        except _TakesLong:
            return None

    def _give_up(self, labels: int) -> bool:
        """Raise instead of stopping the search, because costly proofs follow a stopped search.

        The planner stops no search before the labels of its limit are made, divided by
        `ROOM_BEFORE_HASTE`. So if this never raises, no search was stopped, and the plan is the
        same as without a limit.
        """
        if labels >= self._inline_labels:
            raise _TakesLong
        return False

    def _compose(
        self,
        problem: Problem,
        airspace: Airspace | None,
        booked: PadBook,
        hierarchy: Hierarchy | None,
        is_abandoned: threading.Event,
    ) -> Plan:
        stop = first_of(TimeLimit(self._time_limit_s), lambda _labels: is_abandoned.is_set())
        return _composed(problem, stop, airspace, booked, hierarchy)


def _composed(
    problem: Problem,
    stop: Stop,
    airspace: Airspace | None,
    booked: PadBook,
    hierarchy: Hierarchy | None,
) -> Plan:
    try:
        return compose(problem, stop=stop, airspace=airspace, booked=booked, hierarchy=hierarchy)
    except PlanRejected as error:
        # A defect of the planner. A plan that breaks a rule must not be flown.
        log.exception("plan rejected", extra={"source": problem.source})
        return Plan(status=PlanStatus.UNKNOWN, stats={"rejected": str(error)})


def _is_small(problem: Problem, airspace: Airspace | None, hierarchy: Hierarchy | None) -> bool:
    """Whether everything but the search is fast, and the search can be limited by labels."""
    return (
        problem.strategy in (None, DEFAULT_STRATEGY)
        and problem.label_limit is None
        and hierarchy is not None
        and len(hierarchy.rank) <= _FEW_STATIONS
        and len(problem.packages) <= _FEW_PACKAGES
        and len(problem.closures) <= _FEW_CLOSURES
        and airspace is not None
        and not airspace.reaches
    )


def _rows_around(network: Network, places: Iterable[StationId], margin: float) -> Rows:
    """The stations in the box around these places, with a margin as a share of its larger side."""
    columns = network.columns
    rows = [network.row_of[place] for place in places]
    box = Box.around(zip(columns.longitude_deg[rows], columns.latitude_deg[rows], strict=True))
    more_deg = margin * max(box.width_deg, box.north - box.south)
    longitude_deg = beside_deg(columns.longitude_deg, box.west + box.width_deg / 2)
    is_near = (
        (longitude_deg >= box.west - more_deg)
        & (longitude_deg <= box.west + box.width_deg + more_deg)
        & (columns.latitude_deg >= box.south - more_deg)
        & (columns.latitude_deg <= box.north + more_deg)
    )
    return np.flatnonzero(is_near).astype(np.int32)


T = TypeVar("T")
A = TypeVar("A")


class ReadingTurn:
    """Runs functions in a thread, one after another; a caller that leaves gives up its place."""

    def __init__(self) -> None:
        self._turn = asyncio.Semaphore(1)

    async def run(self, read: Callable[[A], T], value: A) -> T:
        """What `read` makes of the value."""
        async with self._turn:
            reading = asyncio.ensure_future(asyncio.to_thread(read, value))
            try:
                return await asyncio.shield(reading)
            except asyncio.CancelledError:
                # The next one begins when the thread is free.
                await asyncio.wait({reading})
                raise
