"""The events of one viewer: a snapshot or what it has missed, then each change."""

import asyncio
import re
from collections.abc import AsyncGenerator, AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from typing import Final

from skyway_gateway.live.feed import LiveFeed, Pay
from skyway_gateway.live.scope import Scope
from skyway_gateway.live.view import Frame, TooSlow, View

#: How many requests a snapshot costs that is made for this viewer, and the items for which it costs
#: one more.
SNAPSHOT_COST: Final = 10.0
ITEMS_OF_A_REQUEST: Final = 100

#: Bytes that are sent together: a viewer that does not read keeps no more in memory.
_PART_BYTES: Final = 64 * 1024

_HEARTBEAT: Final = b": still here\n\n"
_EVENT_ID: Final = re.compile(r"([0-9a-f]{8})-([0-9]{1,15})")


def event_seen(last_event_id: str | None) -> tuple[str, int] | None:
    """The epoch and the number in the id of an event; None for any other text."""
    found = _EVENT_ID.fullmatch(last_event_id or "")
    return None if found is None else (found[1], int(found[2]))


def _parts(content: bytes) -> Iterator[bytes]:
    for start in range(0, len(content), _PART_BYTES):
        yield content[start : start + _PART_BYTES]


@dataclass(frozen=True, slots=True)
class ViewerFrames:
    """The events of one viewer; seconds are of wall time."""

    feed: LiveFeed
    last_seen: tuple[str, int] | None
    #: Whether the viewer's key is still in use.
    may_read: Callable[[], Awaitable[bool]]
    #: How often that is asked while nothing changes.
    check_s: float = 0.4
    heartbeat_s: float = 15.0
    pay: Pay = lambda _cost: None

    @asynccontextmanager
    async def opened(self, scope: Scope) -> AsyncIterator[AsyncGenerator[bytes]]:
        """The events of this scope, while the viewer counts as looking.

        Raises
        ------
        ServiceUnavailable
            Registry or composition have not answered yet.
        BudgetSpent
            The viewer looks at too many parts of the picture, or has asked for too many.
        """
        async with self.feed.viewing(scope, self.pay) as view:
            yield self.of(view)

    def of(self, view: View) -> AsyncGenerator[bytes]:
        """The events; they end for a viewer who is too slow or may read no more.

        Raises
        ------
        BudgetSpent
            The viewer needs a snapshot, and has asked for too many.
        """
        picture = self.feed.picture
        if self.last_seen and view.can_resume(*self.last_seen, latest=picture.number):
            return self._events(view, self.last_seen[1])
        if not view.has_snapshot(picture):
            self.pay(SNAPSHOT_COST + view.size // ITEMS_OF_A_REQUEST)
        snapshot = view.snapshot(picture)
        return self._events(view, snapshot.number, snapshot)

    async def _events(
        self, view: View, number: int, snapshot: Frame | None = None
    ) -> AsyncGenerator[bytes]:
        if snapshot is not None:
            for part in _parts(snapshot.content):
                yield part
        loop = asyncio.get_running_loop()
        sent_at = loop.time()
        while await self.may_read():
            changed = view.changed
            try:
                frames = view.frames_after(number)
            except TooSlow:
                return
            for frame in frames:
                for part in _parts(frame.content):
                    yield part
                number, sent_at = frame.number, loop.time()
            if loop.time() - sent_at >= self.heartbeat_s:
                yield _HEARTBEAT
                sent_at = loop.time()
            if changed is view.changed:
                await self._wait(changed)

    async def _wait(self, changed: asyncio.Event) -> None:
        with suppress(TimeoutError):
            async with asyncio.timeout(self.check_s):
                await changed.wait()
