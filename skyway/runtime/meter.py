"""Token buckets: what each tenant or address may use, kept in the memory of one process.

The library `limits` is not used: it has no token bucket, it counts by the wall clock, which may be
set back, and nothing bounds how many callers it remembers.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
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
