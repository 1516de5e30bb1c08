"""Which reports of drones that came online may help waiting requests.

A drone can report as often as its broker lets it. So only a drone counts that was not online
before, a provider's drones count once in ten seconds, and all drones once in a second. A drone that
does not count misses little: the requests that were woken just before are tried again 0.5, 1, 2, 4
and 8 seconds later.
"""

from collections.abc import Iterable
from datetime import datetime, timedelta
from typing import Final

from skyway.contracts.drone_report import Connection
from skyway.runtime.mqtt.inbox import Received

_PAUSE: Final = timedelta(seconds=1)
_PAUSE_OF_PROVIDER: Final = timedelta(seconds=10)

#: Of more drones, those that came online first are forgotten, and count when they report again.
_MOST_DRONES: Final = 50_000


class DronesOnline:
    """The drones that are online, as far as this process remembers."""

    def __init__(self, *, most_drones: int = _MOST_DRONES) -> None:
        self._most_drones = most_drones
        #: The ids of provider and drone.
        self._online: dict[tuple[str, ...], None] = {}
        self._counted_at: datetime | None = None
        #: When a drone of a provider counted last, the longest ago first.
        self._counted_of: dict[str, datetime] = {}

    def note(self, batch: Iterable[Received[Connection]], *, now: datetime) -> bool:
        """Remember who is online now; whether this may help requests that wait for a drone."""
        came = {
            received.ids[0]
            for received in batch
            if self._has_come(received.ids, is_online=received.message.status == "ONLINE")
        }
        self._forget_before(now - _PAUSE_OF_PROVIDER)
        new = came - self._counted_of.keys()
        if not new or (self._counted_at is not None and now - self._counted_at < _PAUSE):
            return False
        self._counted_at = now
        self._counted_of.update(dict.fromkeys(new, now))
        return True

    def _has_come(self, ids: tuple[str, ...], *, is_online: bool) -> bool:
        if not is_online:
            self._online.pop(ids, None)
            return False
        is_new = ids not in self._online
        self._online[ids] = None
        if len(self._online) > self._most_drones:
            del self._online[next(iter(self._online))]
        return is_new

    def _forget_before(self, at: datetime) -> None:
        """Let the providers count again whose pause is over: at most one a second is remembered."""
        for provider_id, counted_at in list(self._counted_of.items()):
            if counted_at > at:
                return
            del self._counted_of[provider_id]
