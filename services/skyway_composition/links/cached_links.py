"""What drones said last: what only says it again is neither locked nor written.

Most of what is heard comes from drones that stand somewhere with nothing to do, and say so every
half minute. Only that is left out from which nothing would follow, whatever others have kept
meanwhile: links only ever move on, so what is no news to an older one is none to the present one.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from skyway.contracts.drone_report import Connection, DroneState
from skyway.ids import DroneId, ProviderId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.mqtt.client import Received
from skyway_composition.links.link import DroneLink

#: Drones of which is known what they said, those of the last batches: some 5 KiB each.
_MOST: Final = 10_000

#: A state is kept at least so often, in wall time, though nothing has changed. Our own choice.
_KEPT_EVERY_S: Final = 300.0


@dataclass(frozen=True, slots=True)
class _Heard:
    """A link as this process has kept or found it; `newest` is the newest state heard since."""

    link: DroneLink
    newest: tuple[int, int] | None


class CachedLinks:
    """What each drone said last, as far as this process took it; it may forget any at any time."""

    def __init__(self, clock: FleetClock) -> None:
        self._clock = clock
        self._known: dict[DroneId, _Heard] = {}

    def repeats_known_facts(self, drone_id: DroneId, said: Iterable[Received[Any]]) -> bool:
        """Whether nothing follows from any of this, if the drone is on no mission.

        Any: each topic has messages of its own type.
        """
        known = self._known.get(drone_id)
        return known is not None and all(self._is_no_news(known, each) for each in said)

    def note(self, drone_id: DroneId, said: Sequence[Received[Any]]) -> None:
        """Know the newest state among what was said again, so that older ones stay so."""
        known = self._known[drone_id]
        states = (each.message for each in said if isinstance(each.message, DroneState))
        pairs = [known.newest, *((state.session, state.seq) for state in states)]
        newest = max((each for each in pairs if each is not None), default=None)
        self._known[drone_id] = replace(known, newest=newest)

    def keep(self, links: Iterable[DroneLink]) -> None:
        """Know links as they are kept now; those known longest are forgotten."""
        for link in links:
            state = link.state
            newest = None if state is None else (state.session, state.seq)
            self._known[link.drone_id] = _Heard(link, newest)
        while len(self._known) > _MOST:
            del self._known[next(iter(self._known))]

    def forget(self, drone_ids: Iterable[DroneId]) -> None:
        """Forget drones of which something is being taken: who knows whether it will be kept."""
        for drone_id in drone_ids:
            self._known.pop(drone_id, None)

    def _is_no_news(self, known: _Heard, received: Received[Any]) -> bool:
        link, message = known.link, received.message
        if ProviderId(received.ids[0]) != link.provider_id:
            return False
        match message:
            case Connection():
                return not link.is_newer_connection(message)
            case DroneState() if known.newest is not None:
                is_old = (message.session, message.seq) <= known.newest
                return is_old or (self._is_recent(link, message) and link.is_still_idle(message))
            case _:
                return False

    def _is_recent(self, link: DroneLink, state: DroneState) -> bool:
        """Whether the state that is kept is not much older than this one."""
        longest = fleet_margin(self._clock, fleet_s=0, wall_s=_KEPT_EVERY_S)
        return link.state is not None and abs(state.at - link.state.at) < longest
