"""How much later than the best plans other plans of the same requests deliver."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

#: Seconds within which two plans are equally good.
_EQUAL_S = 0.5


@dataclass(frozen=True, slots=True)
class Lateness:
    """Shares of the best delivery time; None without a plan to compare."""

    compared: int
    optimal: int
    mean: float | None
    p95: float | None
    worst: float | None

    @classmethod
    def of(cls, delivered_s: Sequence[float | None], best_s: Sequence[float | None]) -> Self:
        """Of these plans; a request that one of both has no plan for is not compared."""
        pairs = [
            (own_s, least_s)
            for own_s, least_s in zip(delivered_s, best_s, strict=False)
            if own_s is not None and least_s is not None
        ]
        late = sorted(own_s / least_s - 1 for own_s, least_s in pairs)
        return cls(
            compared=len(pairs),
            optimal=sum(own_s <= least_s + _EQUAL_S for own_s, least_s in pairs),
            mean=sum(late) / len(late) if late else None,
            p95=late[math.ceil(0.95 * len(late)) - 1] if late else None,
            worst=late[-1] if late else None,
        )

    def as_texts(self) -> tuple[str, str, str, str]:
        """Mean, p95, worst, and how many of how many are optimal."""
        shares = (self.mean, self.p95, self.worst)
        mean, p95, worst = ("none" if share is None else f"{share:z.1%}" for share in shares)
        return mean, p95, worst, f"{self.optimal} of {self.compared}"
