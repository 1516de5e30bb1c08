"""The time of the event loop: what each request takes of it, and whose request begins next."""

import asyncio
import heapq
import itertools
import time
import types
from collections.abc import Callable, Coroutine, Generator
from typing import Any, Final, TypeVar

from starlette.types import Scope

from skyway.runtime.limits import Meter, Slots

#: Any: what a coroutine yields belongs to asyncio, which sends nothing back.
T = TypeVar("T")

#: What one unit of a budget pays for: seconds of the event loop, or bytes of a body or an answer.
UNIT_S: Final = 0.005
UNIT_BYTES: Final = 64 * 1024

#: The share of the event loop for requests, while others wait. What a request takes is known when
#: it is done, so a rest of so many seconds is made up for.
SHARE: Final = 0.5
CREDIT_S: Final = 0.01
#: A request begins at least so often; and so often, if its caller has no other waiting.
LONGEST_PAUSE_S: Final = 0.05
SHORT_PAUSE_S: Final = 0.002

#: A request stands so far behind for each other request of its caller that waits.
BEHIND_S: Final = 5.0
_MOST_WAITING: Final = 200


class Account:
    """Charges a caller for the work of one request, beyond the unit that its admission has cost."""

    def __init__(
        self,
        meter: Meter,
        who: str,
        now: Callable[[], float] = time.perf_counter,
        note: Callable[[float], None] = lambda _work_s: None,
    ) -> None:
        self._meter = meter
        self._who = who
        self._now = now
        self._note = note
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
                work_s = self._now() - began_s
                self._add(work_s / UNIT_S)
                self._note(work_s)
            try:
                yield waits_for
            except BaseException as error:  # noqa: BLE001 - the coroutine decides about it
                thrown = error


class LoopTurns:
    """Lets requests begin one after another, and keeps a part of the event loop free.

    A request waits as if it had come later: by what its caller has spent of a budget, as time of
    the loop, and by `BEHIND_S` for each other request of its caller that waits. So a caller who
    asks one thing after another passes those who ask many things together, and nobody waits for
    ever. A request begins when the work of the earlier ones fits into the share of all requests.
    So those that have begun seldom wait for a step of others.

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
        #: When each counts as come, its number, and whether its caller had no other waiting.
        self._waiting: list[tuple[float, int, bool, asyncio.Future[None]]] = []
        self.slots = Slots("WAITING_REQUESTS", _MOST_WAITING)
        self._last_s = self._fits_at_s = 0.0
        self._timer: asyncio.TimerHandle | None = None
        self._will_look = False

    @property
    def waiting(self) -> int:
        """How many requests wait, with those whose callers have left meanwhile."""
        return len(self._waiting)

    def note(self, work_s: float) -> None:
        """Note for how long a request has kept the event loop busy."""
        now_s = self._now()
        fits_at_s = max(self._fits_at_s, now_s - CREDIT_S) + work_s / SHARE
        self._fits_at_s = min(fits_at_s, now_s + LONGEST_PAUSE_S)

    async def turn(self, who: str) -> None:
        """Wait until a request of this caller may begin.

        Raises
        ------
        BudgetSpent
            Too many requests of the caller wait.
        """
        others = self.slots.used(who)
        with self.slots.held(who):
            turn: asyncio.Future[None] = asyncio.get_running_loop().create_future()
            came_s = self._now() + self._spent(who) * UNIT_S + others * BEHIND_S
            heapq.heappush(self._waiting, (came_s, next(self._number), others == 0, turn))
            if not self._will_look:
                self._will_look = True
                asyncio.get_running_loop().call_soon(self.look)
            await turn

    def look(self) -> None:
        """Let the next request begin if it may, and look again while others wait."""
        self._will_look = False
        while self._waiting and self._waiting[0][-1].done():
            heapq.heappop(self._waiting)  # its caller has left
        if not self._waiting:
            return
        _, _, is_only, turn = self._waiting[0]
        now_s, pause_s = self._now(), SHORT_PAUSE_S if is_only else LONGEST_PAUSE_S
        wait_s = min(self._fits_at_s, self._last_s + pause_s) - now_s
        if wait_s <= 0.0:
            heapq.heappop(self._waiting)
            self._last_s = now_s
            turn.set_result(None)
        if self._timer is not None:
            self._timer.cancel()
        self._timer = asyncio.get_running_loop().call_later(max(wait_s, 0.0), self.look)


def charged(scope: Scope, work: Coroutine[Any, Any, T]) -> Coroutine[Any, Any, T]:
    """The work, measured for the account of this request, if it has one."""
    account: Account | None = scope.get("state", {}).get("account")
    return work if account is None else account.measured(work)
