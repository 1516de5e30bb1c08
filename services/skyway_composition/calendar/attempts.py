"""Commits a planned change; if the world has changed, asks for a new plan.

A cause is why calendars change: a booking, a hold, a queue, a better order, a new plan in flight, a
drone that gives way, the end of a wait, or a cancellation. It reads the world, asks the solver, and
proposes a change, all without a lock. The change is committed in one transaction, or not at all.
"""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from skyway.runtime.errors import RowRefused
from skyway.runtime.sql.database import Tx
from skyway_composition.calendar.commit import WorldChanged
from skyway_composition.context import Context

ResultT = TypeVar("ResultT")
ResultT_co = TypeVar("ResultT_co", covariant=True)

#: Why a change was not committed: the world is not as it was planned with, or another row has a
#: pad, drone or slot that it claims.
Lost = WorldChanged | RowRefused


@dataclass(frozen=True, slots=True)
class Change(Generic[ResultT_co]):
    """A planned change of calendars.

    It may be committed until `latest_ms`, fleet time. `write` locks what it was planned with by
    `lock_as_seen`, and then writes it.
    """

    latest_ms: int
    write: Callable[[Tx], Awaitable[ResultT_co]]


@dataclass(frozen=True, slots=True)
class Settled(Generic[ResultT_co]):
    """The result of a cause that changes nothing."""

    result: ResultT_co


class Cause(Protocol[ResultT_co]):
    """Why calendars change."""

    async def propose(self, lost: Lost | None) -> Change[ResultT_co] | Settled[ResultT_co]:
        """A change as the world is now; `lost` says why the last one was not committed."""


async def commit(context: Context, change: Change[ResultT]) -> ResultT | Lost:
    """Commit a change in one transaction; or why nothing was committed."""
    try:
        async with context.db.write() as tx:
            if change.latest_ms < context.now_ms:
                return WorldChanged()
            return await change.write(tx)
    except (RowRefused, WorldChanged) as lost:
        return lost


async def carry_out(context: Context, cause: Cause[ResultT]) -> ResultT:
    """The result of a cause; it proposes until a change is committed, or until it has settled."""
    lost: Lost | None = None
    while True:
        proposed = await cause.propose(lost)
        if isinstance(proposed, Settled):
            return proposed.result
        done = await commit(context, proposed)
        if not isinstance(done, WorldChanged | RowRefused):
            return done
        lost = done
