"""That a row stays in the outbox, and when it is sent again."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Row


@dataclass(frozen=True, slots=True)
class Again:
    """A row stays, and is sent again after a while of wall time."""

    after_s: float
    attempts: int


#: Sends one row; None when it is done with. Any: the columns of `outbox_table`.
Send = Callable[[Row[Any]], Awaitable[Again | None]]


def backing_off(row: Row[Any], span_s: tuple[float, float]) -> Again:
    """A row is sent again later with each attempt: after the first of these times to the last."""
    first_s, longest_s = span_s
    after_s = min(first_s * 2.0 ** min(row.attempts, 16), longest_s)
    return Again(after_s=after_s, attempts=row.attempts + 1)
