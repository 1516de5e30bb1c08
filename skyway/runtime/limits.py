"""What each caller may use, in the memory of one process: budgets, slots, and turns in a queue.

A `Meter` counts calls against a budget (a token bucket), `Slots` limit what is open at the same
time, and a `FairQueue` shares heavy work between tenants. Callers without a valid key spend the
budget of their network.

The library `limits` is not used: it has no token bucket, it counts by the wall clock, which may be
set back, and nothing bounds how many callers it remembers.
"""

import asyncio
import math
import time
from collections import Counter, deque
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from functools import lru_cache
from ipaddress import IPv6Address, ip_address, ip_network
from typing import Final

from skyway.runtime.errors import BudgetSpent

#: The most callers that a meter remembers, about 100 bytes each.
_MOST_REMEMBERED: Final = 20_000

#: Rounding tolerance of sums of seconds.
_ROUNDING_S: Final = 1e-6


@dataclass(frozen=True, slots=True)
class Budget:
    """What each caller may use: up to `burst` together; the budget refills by `per_s` a second.

    `code` names the budget in problem documents.
    """

    code: str
    per_s: float
    burst: int


@dataclass(frozen=True, slots=True)
class Reading:
    """What is left of a budget, and in how many seconds the budget is full again."""

    budget: Budget
    left: int
    full_after_s: float

    @property
    def headers(self) -> dict[str, str]:
        """The `RateLimit-*` fields (draft-ietf-httpapi-ratelimit-headers-06)."""
        burst = self.budget.burst
        window_s = math.ceil(burst / self.budget.per_s)
        return {
            "RateLimit-Limit": str(burst),
            "RateLimit-Remaining": str(self.left),
            "RateLimit-Reset": str(math.ceil(self.full_after_s)),
            "RateLimit-Policy": f"{burst};w={window_s}",
        }


class Meter:
    """One budget for each caller.

    A bucket is stored as the moment at which it is full again, so a bucket that is full needs no
    memory. When the memory is full, the meter forgets the caller that was silent for longest.

    Parameters
    ----------
    now
        Seconds of a clock. If it goes back, a caller waits at most for a whole bucket.
    """

    def __init__(
        self,
        budget: Budget,
        *,
        most: int = _MOST_REMEMBERED,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self.budget = budget
        self._most = most
        self._now = now
        self._refill_s = budget.burst / budget.per_s
        #: When the bucket of a caller is full again; the caller that was last seen is last.
        self._full_at: dict[str, float] = {}

    def spend(self, who: str, cost: float = 1.0) -> Reading:
        """Spend `cost` of the caller's budget, and return what is left of the budget.

        Raises
        ------
        BudgetSpent
            Less than `cost` is left; nothing is spent.
        """
        self.require(who, cost)
        self.charge(who, cost)
        return self.read(who)

    def require(self, who: str, cost: float = 1.0) -> None:
        """Check that at least `cost` is left; nothing is spent.

        Raises
        ------
        BudgetSpent
            Less than `cost` is left.
        """
        lacking_s = self._lacking_s(who)
        wait_s = lacking_s + cost / self.budget.per_s - self._refill_s
        if wait_s > _ROUNDING_S:
            headers = self._reading(lacking_s).headers
            raise BudgetSpent(self.budget.code, wait_s, headers=headers)

    def charge(self, who: str, cost: float) -> None:
        """Spend `cost`, or all that is left: for work whose cost is only clear afterwards.

        A negative cost gives budget back.
        """
        self._keep(who, min(self._lacking_s(who) + cost / self.budget.per_s, self._refill_s))

    def spent(self, who: str) -> float:
        """How much of the budget the caller has spent and not got back yet."""
        return self._lacking_s(who) * self.budget.per_s

    def read(self, who: str) -> Reading:
        """What the caller has left."""
        return self._reading(self._lacking_s(who))

    @property
    def remembered(self) -> int:
        """How many callers are in memory."""
        return len(self._full_at)

    def _lacking_s(self, who: str) -> float:
        """Seconds until the bucket is full."""
        return min(max(self._full_at.get(who, 0.0) - self._now(), 0.0), self._refill_s)

    def _keep(self, who: str, lacking_s: float) -> None:
        full_at = self._full_at
        full_at.pop(who, None)
        full_at[who] = self._now() + lacking_s
        if len(full_at) > self._most:
            del full_at[next(iter(full_at))]

    def _reading(self, lacking_s: float) -> Reading:
        left = int(self.budget.burst - lacking_s * self.budget.per_s + _ROUNDING_S)
        return Reading(self.budget, left, lacking_s)


#: Seconds until another try; when a slot or a place becomes free is unknown.
_RETRY_AFTER_S: Final = 1.0


class Slots:
    """The same number of slots for each caller; `code` names them in problem documents."""

    def __init__(self, code: str, most: int) -> None:
        self.code = code
        self.most = most
        self._used: dict[str, int] = {}

    @contextmanager
    def held(self, who: str) -> Iterator[None]:
        """One slot of the caller, while the block runs.

        Raises
        ------
        BudgetSpent
            All slots of the caller are in use.
        """
        used = self.used(who)
        if used >= self.most:
            raise BudgetSpent(self.code, _RETRY_AFTER_S)
        self._used[who] = used + 1
        try:
            yield
        finally:
            self._used[who] -= 1
            if self._used[who] == 0:
                del self._used[who]

    def used(self, who: str) -> int:
        """How many slots the caller has in use."""
        return self._used.get(who, 0)


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


@lru_cache(maxsize=4096)
def network_of(host: str) -> str:
    """The IPv4 address, or the /64 of an IPv6 address; empty when the text is no address."""
    try:
        address = ip_address(host[:64])
    except ValueError:
        return ""  # a proxy that is trusted named no address
    if isinstance(address, IPv6Address):
        return str(address.ipv4_mapped or ip_network((address, 64), strict=False))
    return str(address)
