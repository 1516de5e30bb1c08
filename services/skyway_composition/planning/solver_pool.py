"""The threads that plan: composing is heavy, and the event loop must never wait for it."""

import asyncio
import logging
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import Final, Self

from skyway.delivery.plan import Plan, PlanStatus
from skyway.planner.airspace import Airspace
from skyway.planner.compose import compose
from skyway.planner.hierarchy import Hierarchy
from skyway.planner.pad_book import NO_RESERVATIONS, PadBook
from skyway.planner.problem import Problem
from skyway.planner.stop import TimeLimit, first_of
from skyway.planner.verify import PlanRejected
from skyway.planner.warm import warm
from skyway.runtime.errors import ServiceUnavailable

log = logging.getLogger(__name__)

#: Problems that may wait for a thread; whoever comes later is told to ask again.
_MOST_WAITING: Final = 500


class SolverPool:
    """Composes plans in threads; a search ends when its time is up or nobody waits for it."""

    def __init__(self, *, threads: int, time_limit_s: float) -> None:
        self._threads = threads
        self._time_limit_s = time_limit_s
        self._waiting = 0
        self._executor: ThreadPoolExecutor | None = None
        #: Whether the first plan will take no longer than the tenth.
        self.is_warm = False

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
        """Have everything ready that plans are made with: compiled, or loaded from disk.

        Compiled code belongs to the process, so one pool warms all of them.
        """
        log.info("compiling the planner, or loading what was compiled before")
        started_at = time.monotonic()
        await asyncio.get_running_loop().run_in_executor(self._executor, warm)
        self.is_warm = True
        log.info("planner ready", extra={"elapsed_s": round(time.monotonic() - started_at, 1)})

    async def compose(
        self,
        problem: Problem,
        *,
        airspace: Airspace | None = None,
        booked: PadBook = NO_RESERVATIONS,
        hierarchy: Hierarchy | None = None,
    ) -> Plan:
        """The plan for this problem; unknown when the time was up before one was found.

        Raises
        ------
        ServiceUnavailable
            Too many problems wait already.
        """
        if self._executor is None or self._waiting >= _MOST_WAITING:
            raise ServiceUnavailable("planning", f"{self._waiting} problems wait for a thread")
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

    def _compose(
        self,
        problem: Problem,
        airspace: Airspace | None,
        booked: PadBook,
        hierarchy: Hierarchy | None,
        is_abandoned: threading.Event,
    ) -> Plan:
        stop = first_of(TimeLimit(self._time_limit_s), lambda _labels: is_abandoned.is_set())
        try:
            return compose(
                problem, stop=stop, airspace=airspace, booked=booked, hierarchy=hierarchy
            )
        except PlanRejected as error:
            # A defect of the planner; a plan that breaks a rule must not fly, so there is none.
            log.exception("plan rejected", extra={"source": problem.source})
            return Plan(status=PlanStatus.UNKNOWN, stats={"rejected": str(error)})
