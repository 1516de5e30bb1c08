"""A queue before heavy work that shares it between tenants."""

import asyncio
from collections import Counter, deque
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Final

from skyway.runtime.errors import BudgetSpent

#: Seconds until another try; when the queue gets shorter is unknown.
_RETRY_AFTER_S: Final = 1.0

_Turn = asyncio.Future[None]


class FairQueue:
    """Lets a number of works run at the same time; tenants that wait take turns.

    So a tenant with many waiting works delays another tenant by one work at most. `code` names the
    queue in problem documents.
    """

    def __init__(self, code: str, *, at_once: int, per_tenant: int, most_waiting: int) -> None:
        self.code = code
        self._at_once = at_once
        self._per_tenant = per_tenant
        self._most_waiting = most_waiting
        self._running: Counter[str] = Counter()
        #: The tenants that wait, in the order of their turns.
        self._waiting: dict[str, deque[_Turn]] = {}

    @asynccontextmanager
    async def turn(self, who: str) -> AsyncIterator[None]:
        """Wait for the tenant's turn, and hold one place while the block runs.

        Raises
        ------
        BudgetSpent
            Too many works of the tenant wait already.
        """
        await self._wait(who)
        try:
            yield
        finally:
            self._end(who)

    def waiting(self, who: str) -> int:
        """How many works of the tenant wait."""
        return len(self._waiting.get(who, ()))

    @property
    def depth(self) -> int:
        """How many works of all tenants wait."""
        return sum(len(queue) for queue in self._waiting.values())

    async def _wait(self, who: str) -> None:
        queue = self._waiting.get(who)
        if queue is None and self._has_room(who):
            self._running[who] += 1
            return
        if self.waiting(who) >= self._most_waiting:
            raise BudgetSpent(self.code, _RETRY_AFTER_S)
        turn = asyncio.get_running_loop().create_future()
        self._waiting.setdefault(who, deque()).append(turn)
        try:
            await turn
        except asyncio.CancelledError:
            if turn.done() and not turn.cancelled():
                self._end(who)  # its turn had come
            else:
                self._forget(who, turn)
            raise

    def _has_room(self, who: str) -> bool:
        return self._running.total() < self._at_once and self._running[who] < self._per_tenant

    def _end(self, who: str) -> None:
        self._running[who] -= 1
        if self._running[who] == 0:
            del self._running[who]
        self._begin_next()

    def _begin_next(self) -> None:
        """Give free places to the tenants that wait, in turn."""
        for who in list(self._waiting):
            if not self._has_room(who):
                continue
            queue = self._waiting.pop(who)
            # A caller that has just left is still in the queue.
            while queue and queue[0].done():
                queue.popleft()
            if queue:
                queue.popleft().set_result(None)
                self._running[who] += 1
            if queue:
                self._waiting[who] = queue

    def _forget(self, who: str, turn: _Turn) -> None:
        queue = self._waiting.get(who, deque())
        if turn in queue:
            queue.remove(turn)
            if not queue:
                del self._waiting[who]
