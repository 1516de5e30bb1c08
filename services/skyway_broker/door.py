"""The open connections: how many there may be, in all and of one address."""

import logging
import time
from collections.abc import Callable
from typing import Protocol

from skyway.runtime.errors import BudgetSpent
from skyway.runtime.limits import Meter
from skyway_broker.limits import Limits

log = logging.getLogger(__name__)


class Abortable(Protocol):
    """A connection."""

    def abort(self) -> None:
        """Close the connection now."""


class Door:
    """Counts connections, and closes one of those that have not introduced themselves if needed.

    Connections that have not introduced themselves get at most half of the places. When more come,
    the one that waits longest is closed. So silent connections cannot keep others out.
    """

    def __init__(self, limits: Limits, now: Callable[[], float] = time.monotonic) -> None:
        self._limits = limits
        self._connects = Meter(limits.connects_per_address, now=now)
        self._address_of: dict[Abortable, str] = {}
        self._open_of: dict[str, int] = {}
        self._silent: dict[Abortable, None] = {}

    def enter(self, connection: Abortable, address: str) -> bool:
        """Note a new connection; False when it must be closed."""
        try:
            self._connects.spend(address)
        except BudgetSpent:
            return False
        open_here = self._open_of.get(address, 0)
        if (
            open_here >= self._limits.connections_per_address
            or len(self._address_of) >= self._limits.connections
        ):
            return False
        self._address_of[connection] = address
        self._open_of[address] = open_here + 1
        if len(self._silent) >= self._limits.connections // 2:
            longest = next(iter(self._silent))
            del self._silent[longest]
            longest.abort()
        self._silent[connection] = None
        return True

    def introduce(self, connection: Abortable) -> None:
        """Note that a connection has the right password."""
        self._silent.pop(connection, None)

    def leave(self, connection: Abortable) -> None:
        """Forget a connection that is closed."""
        self._silent.pop(connection, None)
        address = self._address_of.pop(connection)
        self._open_of[address] -= 1
        if not self._open_of[address]:
            del self._open_of[address]
