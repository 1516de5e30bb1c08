"""A cache of links, by which messages that change nothing are skipped.

It lets this process skip messages without locking or writing a row. Most messages come from idle
drones, which send their state every half minute. A cached link may be older than the stored link.
That does no harm: links only move forward, so a message that changes nothing in an older link
changes nothing in the current link. Only a renewal of a drone's credentials moves a link back.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from skyway.contracts.drone_report import Connection, DroneState
from skyway.ids import DroneId, ProviderId
from skyway.runtime.clock import FleetClock
from skyway.runtime.mqtt.client import Received
from skyway_composition.links.link import DroneLink
from skyway_composition.margins import STATE_IS_STORED

#: The most links in the cache, about 5 KiB each.
_MOST_CACHED: Final = 10_000


@dataclass(frozen=True, slots=True)
class _CachedLink:
    """A link as this process last read or wrote it; `newest` is the newest state since then."""

    link: DroneLink
    newest: tuple[int, int] | None


def _is_old(cached: _CachedLink, message: object) -> bool:
    """Whether a newer message of its kind is cached."""
    match message:
        case Connection():
            return not cached.link.is_newer_connection(message)
        case DroneState():
            return cached.newest is not None and (message.session, message.seq) <= cached.newest
        case _:
            return False


class CachedLinks:
    """The links that this process read or wrote last; any of them may be dropped at any time."""

    def __init__(self, clock: FleetClock) -> None:
        self._clock = clock
        self._cached: dict[DroneId, _CachedLink] = {}

    def changes_nothing(self, drone_id: DroneId, messages: Iterable[Received[Any]]) -> bool:
        """Whether none of these messages has an effect, for a drone without a mission.

        Any: each topic has messages of its own type.
        """
        cached = self._cached.get(drone_id)
        return cached is not None and all(self._is_repeated(cached, each) for each in messages)

    def have_old(self, drone_id: DroneId, messages: Iterable[Received[Any]]) -> bool:
        """Whether some of these messages change nothing because they are old."""
        return any(_is_old(self._cached[drone_id], each.message) for each in messages)

    def forget_renewed(self, renewed_ms: Mapping[DroneId, int]) -> set[DroneId]:
        """Drop the links whose drones have other credentials since; the result is those drones."""
        outdated = {
            drone_id
            for drone_id, at_ms in renewed_ms.items()
            if self._cached[drone_id].link.renewed_ms != at_ms
        }
        self.forget(outdated)
        return outdated

    def note(self, drone_id: DroneId, messages: Sequence[Received[Any]]) -> None:
        """Remember the newest state among skipped messages, to recognise older states later."""
        cached = self._cached[drone_id]
        states = (each.message for each in messages if isinstance(each.message, DroneState))
        pairs = [cached.newest, *((state.session, state.seq) for state in states)]
        newest = max((each for each in pairs if each is not None), default=None)
        self._cached[drone_id] = replace(cached, newest=newest)

    def keep(self, links: Iterable[DroneLink]) -> None:
        """Cache links as they are stored now; when there are too many, the oldest are dropped."""
        for link in links:
            state = link.state
            newest = None if state is None else (state.session, state.seq)
            self._cached[link.drone_id] = _CachedLink(link, newest)
        while len(self._cached) > _MOST_CACHED:
            del self._cached[next(iter(self._cached))]

    def forget(self, drone_ids: Iterable[DroneId]) -> None:
        """Drop the links of drones whose messages are being handled, as the commit may fail."""
        for drone_id in drone_ids:
            self._cached.pop(drone_id, None)

    def _is_repeated(self, cached: _CachedLink, received: Received[Any]) -> bool:
        link, message = cached.link, received.message
        if ProviderId(received.ids[0]) != link.provider_id:
            return False
        match message:
            case Connection() | DroneState() if _is_old(cached, message):
                return True
            case DroneState() if cached.newest is not None:
                return self._is_recent(link, message) and link.is_still_idle(message)
            case _:
                return False

    def _is_recent(self, link: DroneLink, state: DroneState) -> bool:
        """Whether the stored state is not much older than this state."""
        longest = STATE_IS_STORED.span(self._clock)
        return link.state is not None and abs(state.at - link.state.at) < longest
