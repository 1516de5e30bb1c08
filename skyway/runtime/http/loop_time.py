"""The time of the event loop: what each request takes of it, and whose request begins next."""

import asyncio
import heapq
import itertools
import time
import types
from collections.abc import Callable, Coroutine, Generator
from typing import Any, Final, TypeVar

from starlette.types import Scope

from skyway.runtime.limits import Meter

#: Any: what a coroutine yields belongs to asyncio, which sends nothing back.
T = TypeVar("T")

#: What one unit of a budget pays for: seconds of the event loop, or bytes of a body or an answer.
UNIT_S: Final = 0.005
UNIT_BYTES: Final = 64 * 1024

#: Requests begin while a pass of the event loop is shorter than this, and at least so often.
SHORT_PASS_S: Final = 0.001
LONGEST_PAUSE_S: Final = 0.02


class Account:
    """Charges a caller for the work of one request, beyond the unit that its admission has cost."""

    def __init__(
        self, meter: Meter, who: str, now: Callable[[], float] = time.perf_counter
    ) -> None:
        self._meter = meter
        self._who = who
        self._now = now
        self._owed = -1.0

    def add_bytes(self, size_bytes: int) -> None:
        """Charge these bytes."""
        self._add(size_bytes / UNIT_BYTES)

    def _add(self, units: float) -> None:
        self._owed += units
        if self._owed > 0.0:
            self._meter.charge(self._who, self._owed)
            self._owed = 0.0

    async def measured(self, work: Coroutine[Any, Any, T]) -> T:
        """The result of the coroutine; the time between its waits is charged."""
        return await self._steps(work)

    @types.coroutine
    def _steps(self, work: Coroutine[Any, Any, T]) -> Generator[Any, Any, T]:
        thrown: BaseException | None = None
        while True:
            began_s = self._now()
            try:
                waits_for = work.send(None) if thrown is None else work.throw(thrown)
            except StopIteration as end:
                result: T = end.value
                return result
            finally:
                thrown = None  # its traceback refers to this frame: only a collection would end it
                self._add((self._now() - began_s) / UNIT_S)
            try:
                yield waits_for
            except BaseException as error:  # noqa: BLE001 - the coroutine decides about it
                thrown = error


class LoopTurns:
    """Lets requests begin one after another; who has spent least of a budget goes first.

    Requests begin only while the passes of the event loop are short, so a request that has begun
    is not held up by many others. One begins now and then even if the passes are long.

    Parameters
    ----------
    spent
        What a caller has spent of its budget and not got back yet.
    """

    def __init__(
        self, spent: Callable[[str], float], now: Callable[[], float] = time.perf_counter
    ) -> None:
        self._spent = spent
        self._now = now
        self._number = itertools.count()
        self._waiting: list[tuple[float, int, asyncio.Future[None]]] = []
        self._pass_began_s = self._last_s = 0.0

    @property
    def waiting(self) -> int:
        """How many requests wait, with those whose callers have left meanwhile."""
        return len(self._waiting)

    async def turn(self, who: str) -> None:
        """Wait until a request of this caller may begin."""
        loop = asyncio.get_running_loop()
        turn: asyncio.Future[None] = loop.create_future()
        if not self._waiting:
            self._pass_began_s = self._now()
            loop.call_soon(self._next_pass, loop)
        heapq.heappush(self._waiting, (self._spent(who), next(self._number), turn))
        await turn

    def _next_pass(self, loop: asyncio.AbstractEventLoop) -> None:
        now_s = self._now()
        is_short = now_s - self._pass_began_s < SHORT_PASS_S
        self._pass_began_s = now_s
        if is_short or now_s - self._last_s > LONGEST_PAUSE_S:
            self._last_s = now_s
            self._begin_one()
        if self._waiting:
            loop.call_soon(self._next_pass, loop)

    def _begin_one(self) -> None:
        while self._waiting:
            _, _, turn = heapq.heappop(self._waiting)
            if not turn.done():  # its caller has not left
                turn.set_result(None)
                return


def charged(scope: Scope, work: Coroutine[Any, Any, T]) -> Coroutine[Any, Any, T]:
    """The work, measured for the account of this request, if it has one."""
    account: Account | None = scope.get("state", {}).get("account")
    return work if account is None else account.measured(work)
