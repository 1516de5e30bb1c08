"""Keeps the picture up to date while anybody looks at it, and hands out views of it."""

import asyncio
import logging
import secrets
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Final

from skyway.runtime.errors import BudgetSpent, ServiceUnavailable
from skyway.runtime.loops import Wake, repeat
from skyway_gateway.live.documents import service_items
from skyway_gateway.live.picture import JsonObject, Picture
from skyway_gateway.live.scope import Scope
from skyway_gateway.live.sources import Source, show_customers_drones
from skyway_gateway.live.view import KEPT_LOOKS, LOOK_EVERY_S, View

log = logging.getLogger(__name__)

#: Views that are kept without viewers, for those who come back.
_MOST_LEFT_VIEWS: Final = 50

#: How many requests a view costs that is made for this viewer.
VIEW_COST: Final = 10.0
#: When to try again: nobody knows when a viewer leaves.
_RETRY_AFTER_S: Final = 1.0

#: Takes so many requests from the viewer's budget, or raises BudgetSpent.
Pay = Callable[[float], object]


@dataclass(slots=True)
class LiveFeed:
    """One picture for all viewers of this process.

    Without viewers nothing is read: the picture costs nothing while nobody looks. A service that
    does not answer leaves its part of the picture as it was, and the picture says so.
    """

    sources: Sequence[Source]
    #: The parts of the picture that one customer or provider may look at together: each look costs
    #: time for each of them.
    most_views: int = 16
    #: How long a viewer waits for the first picture, wall seconds.
    first_look_within_s: float = 15.0
    wake: Wake = field(default_factory=Wake)
    #: What operators see of each service, beside whether it answers.
    figures: dict[str, JsonObject] = field(default_factory=dict)
    epoch: str = field(default_factory=lambda: secrets.token_hex(4))
    #: Fleet time.
    now: Callable[[], datetime] = lambda: datetime.now(UTC)
    _silent_since: dict[str, datetime] = field(default_factory=dict)
    _picture: Picture = field(default_factory=Picture)
    _views: dict[Scope, View] = field(default_factory=dict)
    _left_at: dict[Scope, int] = field(default_factory=dict)
    _looks: int = 0
    _looked_at: float | None = None
    _is_complete: asyncio.Event = field(default_factory=asyncio.Event)

    @property
    def viewers(self) -> int:
        """How many look now."""
        return sum(view.viewers for view in self._views.values())

    @property
    def age_s(self) -> float | None:
        """Wall seconds since every source was last read; None while nobody looks."""
        if self._looked_at is None or not self._views:
            return None
        return time.monotonic() - self._looked_at

    @property
    def picture(self) -> Picture:
        """The picture as it is now."""
        return self._picture

    def views_of(self, role: str, subject_id: str) -> list[Scope]:
        """The parts of the picture that this viewer looks at, or has left a moment ago."""
        return [each for each in self._views if (each.role, each.subject_id) == (role, subject_id)]

    @asynccontextmanager
    async def viewing(self, scope: Scope, pay: Pay = lambda _cost: None) -> AsyncIterator[View]:
        """The view of this scope, up to date while the block lasts.

        Raises
        ------
        ServiceUnavailable
            Registry or composition have not answered yet.
        BudgetSpent
            The viewer looks at too many parts of the picture, or has asked for too many.
        """
        view = self._views.get(scope)
        if view is None:
            pay(VIEW_COST)
            self._make_room(scope)
            view = self._views[scope] = View(scope, self.epoch)
            view.begin(self._picture)
        view.viewers += 1
        self._left_at.pop(scope, None)
        if not self._is_complete.is_set():
            self.wake.set()  # Otherwise the picture is as old as one look at most.
        try:
            await self._first_look()
            yield view
        finally:
            view.viewers -= 1
            if view.viewers == 0:
                self._left_at[scope] = self._looks

    def _make_room(self, scope: Scope) -> None:
        """Forget a part that this customer or provider has left, if it has as many as it may."""
        own = self.views_of(scope.role, scope.subject_id)
        if scope.role not in ("customer", "provider") or len(own) < self.most_views:
            return
        left = [each for each in own if each in self._left_at]
        if not left:
            raise BudgetSpent("LIVE_VIEWS", _RETRY_AFTER_S)
        oldest = min(left, key=self._left_at.__getitem__)
        del self._left_at[oldest], self._views[oldest]

    async def run(self) -> None:
        """Look until cancelled."""
        await repeat("live", self.step, every_s=LOOK_EVERY_S, wake=self.wake)

    async def step(self) -> bool:
        """Step of a loop: look once, if anybody does."""
        self._forget_left_views()
        if not self._views:
            self._forget_picture()
            return False
        self._looks += 1
        are_read = [await self._read(source) for source in self.sources]
        show_customers_drones(self._picture)
        tick = self._picture.tick()
        if tick is not None:
            for view in self._views.values():
                view.apply(tick)
        if all(are_read):
            self._is_complete.set()
            self._looked_at = time.monotonic()
        return False

    async def _read(self, source: Source) -> bool:
        try:
            await source.read(self._picture)
        except ServiceUnavailable as error:
            log.info("live picture stands still", extra={"part": source.name, "reason": str(error)})
            self._silent_since.setdefault(source.name, self.now())
        else:
            self._silent_since.pop(source.name, None)
        figures = self.figures.get(source.name, {})
        since_at = self._silent_since.get(source.name)
        is_answering = since_at is None
        self._picture.put(
            service_items(source.name, figures, is_answering=is_answering, silent_since_at=since_at)
        )
        return is_answering

    async def _first_look(self) -> None:
        try:
            async with asyncio.timeout(self.first_look_within_s):
                await self._is_complete.wait()
        except TimeoutError:
            raise ServiceUnavailable("registry or composition", "no answer yet") from None

    def _forget_left_views(self) -> None:
        oldest_first = sorted(self._left_at, key=self._left_at.__getitem__)
        too_many = oldest_first[: max(0, len(oldest_first) - _MOST_LEFT_VIEWS)]
        for scope in oldest_first:
            if scope in too_many or self._looks - self._left_at[scope] > KEPT_LOOKS:
                del self._left_at[scope], self._views[scope]

    def _forget_picture(self) -> None:
        """Nobody looks: the next viewer gets a picture that is read anew.

        Its number is higher, so that nobody goes on from the forgotten one: what has gone meanwhile
        would stay in the viewer's document.
        """
        if self._is_complete.is_set():
            self._picture = Picture(self._picture.number + 1)
            for source in self.sources:
                source.forget()
            self._looked_at = None
            self._silent_since.clear()
            self._is_complete.clear()
