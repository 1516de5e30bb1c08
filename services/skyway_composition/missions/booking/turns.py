"""Turns: the bookings of a network in this process are committed in the order of asking.

Bookings of one network compete for the same drones and pads. Without turns, the booking with the
faster messages would get the better drone. Bookings of other networks go on at the same time.
Repeated calls only read, so they need no turn.
"""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from typing import NamedTuple

from skyway.contracts.mission import BookMissions
from skyway.delivery.qos import PRIORITY_RANKS
from skyway.ids import DeliveryId, NetworkId


class AskingOrder(NamedTuple):
    """The place of a booking among those that wait: by class, then by asking, then by id."""

    rank: int
    asked_at: datetime
    delivery_id: DeliveryId

    @classmethod
    def of(cls, delivery_id: DeliveryId, requested: BookMissions, now: datetime) -> "AskingOrder":
        """The place of this booking; without `asked_at` it was asked now."""
        rank = PRIORITY_RANKS[requested.request.qos.priority]
        return cls(rank, requested.asked_at or now, delivery_id)


@dataclass(eq=False, slots=True)
class Turn:
    """A booking's place in the line of its network; it commits when its turn `comes`."""

    order: AskingOrder
    came: int
    line: "_Line"
    is_ready: bool = False
    has_come: asyncio.Event = field(default_factory=asyncio.Event)

    async def comes(self) -> None:
        """Return when every booking before this one is over; the turn then lasts to its end."""
        self.is_ready = True
        self.line.pass_on()
        await self.has_come.wait()


@dataclass(slots=True)
class _Line:
    """The bookings of one network that are not over; one of them may have its turn."""

    turns: list[Turn] = field(default_factory=list)
    current: Turn | None = None
    #: Counts the arrivals, because two calls for one delivery have the same order.
    came: int = 0

    def pass_on(self) -> None:
        """Give the turn to the first booking, if nobody has it and that booking is ready."""
        if self.current is not None or not self.turns:
            return
        first = min(self.turns, key=lambda each: (each.order, each.came))
        if first.is_ready:
            self.current = first
            first.has_come.set()

    def leave(self, turn: Turn) -> None:
        """Remove a booking that is over from the line."""
        self.turns.remove(turn)
        if self.current is turn:
            self.current = None
        self.pass_on()


class Turns:
    """Lets the bookings of each network commit one at a time, the first in order first.

    They plan at the same time. A plan that an earlier booking has spoiled is made again in turn.
    """

    def __init__(self) -> None:
        self._lines: dict[NetworkId, _Line] = {}

    @contextmanager
    def line_up(self, network_id: NetworkId, order: AskingOrder) -> Iterator[Turn]:
        """The place of a booking in the line of its network, for the block."""
        line = self._lines.setdefault(network_id, _Line())
        line.came += 1
        turn = Turn(order, line.came, line)
        line.turns.append(turn)
        try:
            yield turn
        finally:
            line.leave(turn)
            if not line.turns:
                del self._lines[network_id]

    def waiting(self, network_id: NetworkId) -> int:
        """How many bookings of a network are ready and wait for their turn."""
        line = self._lines.get(network_id)
        if line is None:
            return 0
        return sum(each.is_ready and each is not line.current for each in line.turns)
