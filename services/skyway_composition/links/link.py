"""A drone's link, what follows from the drone's messages, and a cache of links.

The cache lets this process skip messages that change nothing without locking or writing a row. Most
messages come from idle drones, which send their state every half minute. A cached link may be older
than the stored link. That does no harm: links only move forward, so a message that changes nothing
in an older link changes nothing in the current link. Only a renewal of a drone's credentials moves
a link back.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from skyway.contracts.drone_report import Connection, DroneEvent, DroneState
from skyway.contracts.message import is_newer
from skyway.ids import DroneId, ProviderId
from skyway.runtime.clock import FleetClock
from skyway.runtime.mqtt.client import Received
from skyway_composition.margins import STATE_IS_STORED

#: Two states of charge that differ by less count as the same. Our own choice.
_SAME_SOC: Final = 0.01

#: Sessions count from 1.
_NO_SESSION: Final = 0

#: The most streams of one drone that a restored database may lack. Our own choice.
_MOST_LOST_STREAMS: Final = 1_000

#: The step that a drone flies, and the last step that it may begin by itself; see `DroneState`.
AtStep = tuple[int | None, int | None]


@dataclass(frozen=True, slots=True)
class InstructionPlace:
    """An instruction's `seq` in the drone's stream, and the last drone event that it confirms."""

    drone_id: DroneId
    provider_id: ProviderId
    stream: int
    seq: int
    events_confirmed_seq: int


@dataclass(frozen=True, slots=True)
class DroneLink:
    """What we sent to one drone, and what we last received from it.

    `last_seq` numbers our last instruction in `stream`, 0 before the first. `last_event_seq`
    numbers the last drone event that we have. `acked_stream` is the last stream that the drone
    has confirmed, in its session `acked_session`. `renewed_ms` is when the drone's credentials were
    renewed last, fleet time. `calendar_version` is the number of its calendar when this was read.
    """

    drone_id: DroneId
    provider_id: ProviderId
    stream: int = 0
    last_seq: int = 0
    acked_stream: int = 0
    acked_session: int = 0
    last_event_seq: int = 0
    report_asked_wall_ms: int = 0
    state: DroneState | None = None
    connection: Connection | None = None
    renewed_ms: int | None = None
    calendar_version: int = 0

    @property
    def at_step(self) -> AtStep:
        """The step that the drone has reported last."""
        state = self.state
        return (None, None) if state is None else (state.step_id, state.released_through)

    @property
    def is_occupied(self) -> bool:
        """Whether the drone reports a mission, or has landed away from every station."""
        state = self.state
        return state is not None and (state.mission_id is not None or state.activity == "DOWN")

    @property
    def has_unread_events(self) -> bool:
        """Whether the drone's last state names events that were not read here."""
        return self.state is not None and self.state.last_event_seq > self.last_event_seq

    def may_have_lost_journal(self, state: DroneState) -> bool:
        """Whether the drone may have lost its journal since its last state.

        A drone of an older version does not say when its journal was begun. After a restart its
        journal may be lost, unless its event numbers continue ours.
        """
        before = self.state
        if before is None or state.session == before.session:
            return False
        if before.journal_session and state.journal_session:
            return before.journal_session != state.journal_session
        is_continued = 0 < self.last_event_seq <= state.last_event_seq
        return state.stream < self.stream and not is_continued

    def is_before_journal(self, event: DroneEvent) -> bool:
        """Whether the drone has begun another journal since this event, and numbers anew."""
        return self.state is not None and event.session < self.state.journal_session

    def has_new_journal(self, state: DroneState) -> bool:
        """Whether the drone has certainly begun another journal since its last state."""
        before = self.state
        if before is None or not (before.journal_session and state.journal_session):
            return False
        return before.journal_session != state.journal_session

    def with_next(self) -> tuple["DroneLink", InstructionPlace]:
        """The link with one more instruction, and the place of this instruction."""
        link = replace(self, stream=max(1, self.stream), last_seq=self.last_seq + 1)
        return link, InstructionPlace(
            link.drone_id, link.provider_id, link.stream, link.last_seq, link.last_event_seq
        )

    def is_newer_state(self, state: DroneState) -> bool:
        """Whether this state is newer than the last one."""
        last = None if self.state is None else (self.state.session, self.state.seq)
        return is_newer((state.session, state.seq), last)

    def is_still_idle(self, state: DroneState) -> bool:
        """Whether a newer state only repeats that a drone without a mission stands idle.

        Drone and cloud agree on the stream and on the last event, so nothing has to be sent.
        """
        last = self.state
        return (
            last is not None
            and (state.stream, state.last_event_seq) == (self.stream, self.last_event_seq)
            and _standing(state) is not None
            and _standing(state) == _standing(last)
            and abs(state.soc - last.soc) < _SAME_SOC
        )

    def is_newer_connection(self, connection: Connection) -> bool:
        """Whether this connection message is newer than the last one.

        ONLINE and LOST of one connection have the same session and connection number, because the
        drone sets its last will when it connects. So a message with the same numbers is newer
        than ONLINE.
        """
        last = self.connection
        if last is None:
            return True
        pair = (connection.session, connection.connection_number)
        last_pair = (last.session, last.connection_number)
        return pair > last_pair or (pair == last_pair and last.status == "ONLINE")

    def acked(self, stream: int, session: int) -> "DroneLink":
        """The link after the drone has confirmed this stream."""
        if stream != self.stream or stream <= 0:
            return self
        session = max(session, self.acked_session)
        return replace(self, acked_stream=stream, acked_session=session)

    def needs_new_stream(self, state: DroneState) -> bool:
        """Whether a new stream must be opened, because the drone or we have lost the current one.

        A drone has lost its journal when it confirmed our stream and shows an older stream in a
        later session. We have lost a database when the drone shows a later stream than ours.
        """
        forgot = state.stream < self.acked_stream and state.session > self.acked_session
        return forgot or state.stream > self.stream

    def in_new_stream(self, state: DroneState) -> "DroneLink":
        """The link with a stream that neither side has used; events go on from the drone's last.

        What the drone confirmed before is forgotten. Otherwise each further state of a drone that
        has lost its journal would open another stream until the drone gets an instruction.
        """
        return replace(
            self,
            stream=max(self.stream, state.stream) + 1,
            last_seq=0,
            acked_stream=state.stream,
            acked_session=state.session,
            last_event_seq=state.last_event_seq,
        )

    def renewed(self, *, at_ms: int) -> "DroneLink":
        """The link after the drone's credentials were renewed.

        Somebody else may have sent the messages so far, with the largest numbers. The last state
        still says whether the drone is occupied, but every next message is newer.
        """
        known = None
        if self.state is not None:
            unnumbered = {"session": _NO_SESSION, "seq": 0, "journal_session": 0}
            known = self.state.model_copy(update=unnumbered)
        return replace(self, state=known, connection=None, acked_session=0, renewed_ms=at_ms)

    def without_foreign_events(self, state: DroneState) -> "DroneLink":
        """The link without events that the drone never sent, by its first state after a renewal."""
        is_first = self.state is not None and self.state.session == _NO_SESSION
        if not is_first or state.stream != self.stream:
            return self
        return replace(self, last_event_seq=min(self.last_event_seq, state.last_event_seq))

    def shows_unlikely_stream(self, state: DroneState) -> bool:
        """Whether the drone follows a stream far after ours.

        A restored backup of our database may lack some streams, but never so many.
        """
        return state.stream > self.stream + _MOST_LOST_STREAMS

    @property
    def is_gone(self) -> bool:
        """Whether the drone has disconnected, or its connection was lost."""
        return self.connection is not None and self.connection.status in ("LOST", "OFFLINE")


def _standing(state: DroneState) -> tuple[object, ...] | None:
    """What an idle drone at a station reports; None for a drone that is not idle at a station."""
    is_idle = state.activity == "IDLE" and state.mission_id is None and not state.package_ids
    if not is_idle or state.station_id is None:
        return None
    return (
        state.session,
        state.stream,
        state.last_instruction_seq,
        state.last_event_seq,
        state.station_id,
        state.is_held,
        state.faults,
        state.failsafe,
        None if state.health is None else state.health.consumption_factor,
    )


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
