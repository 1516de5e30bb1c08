"""What is known of a drone's link, and what follows from what it says."""

from dataclasses import dataclass, replace
from typing import Final

from skyway.contracts.drone_report import Connection, DroneState
from skyway.contracts.message import is_newer
from skyway.ids import DroneId, ProviderId

#: A charge that differs by less from the one that is known is the same. Our own choice.
_SAME_SOC: Final = 0.01


@dataclass(frozen=True, slots=True)
class InstructionPlace:
    """The place of an instruction: its `seq` in the drone's stream, and what it confirms."""

    drone_id: DroneId
    provider_id: ProviderId
    stream: int
    seq: int
    events_confirmed_seq: int


@dataclass(frozen=True, slots=True)
class DroneLink:
    """How far the talk with one drone has come.

    `last_seq` counts our instructions in `stream` (0: none was ever sent), `last_event_seq` the
    drone's events that we have. `acked_stream` is the last stream that the drone has shown to
    know, in its session `acked_session`.
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

    @property
    def is_occupied(self) -> bool:
        """Whether the drone says that it has a mission, known or not, or is down in the open."""
        state = self.state
        return state is not None and (state.mission_id is not None or state.activity == "DOWN")

    def with_next(self) -> tuple["DroneLink", InstructionPlace]:
        """The link once one more instruction goes to the drone, and that one's place."""
        link = replace(self, stream=max(1, self.stream), last_seq=self.last_seq + 1)
        return link, InstructionPlace(
            link.drone_id, link.provider_id, link.stream, link.last_seq, link.last_event_seq
        )

    def is_newer_state(self, state: DroneState) -> bool:
        """Whether this state comes after the one that is known."""
        known = None if self.state is None else (self.state.session, self.state.seq)
        return is_newer((state.session, state.seq), known)

    def is_still_idle(self, state: DroneState) -> bool:
        """Whether a newer state says only that a drone without a mission still stands idle.

        It and we know the same stream and the same events, so nothing is to be told or asked for.
        """
        known = self.state
        return (
            known is not None
            and (state.stream, state.last_event_seq) == (self.stream, self.last_event_seq)
            and _standing(state) is not None
            and _standing(state) == _standing(known)
            and abs(state.soc - known.soc) < _SAME_SOC
        )

    def is_newer_connection(self, connection: Connection) -> bool:
        """Whether this connection comes after the known one.

        ONLINE and LOST of one connection share their pair, because a last will is fixed before it
        is known whether it will be needed: whatever follows ONLINE under the same pair counts.
        """
        known = self.connection
        if known is None:
            return True
        pair = (connection.session, connection.connection_number)
        known_pair = (known.session, known.connection_number)
        return pair > known_pair or (pair == known_pair and known.status == "ONLINE")

    def acked(self, stream: int, session: int) -> "DroneLink":
        """The link once the drone has shown that it knows this stream."""
        if stream != self.stream or stream <= 0:
            return self
        session = max(session, self.acked_session)
        return replace(self, acked_stream=stream, acked_session=session)

    def needs_new_stream(self, state: DroneState) -> bool:
        """Whether a new stream must be opened: the drone or we have forgotten the present one.

        A drone that has shown our stream and, in a later session, an older one has lost its
        journal. One that shows a later stream than ours was told so by a database we no longer
        have.
        """
        forgot = state.stream < self.acked_stream and state.session > self.acked_session
        return forgot or state.stream > self.stream

    def in_new_stream(self, state: DroneState) -> "DroneLink":
        """The link with a stream that neither side has used; events go on from what is known."""
        return replace(
            self,
            stream=max(self.stream, state.stream) + 1,
            last_seq=0,
            last_event_seq=state.last_event_seq,
        )

    @property
    def is_gone(self) -> bool:
        """Whether the drone has left, or is known to be out of reach."""
        return self.connection is not None and self.connection.status in ("LOST", "OFFLINE")


def _standing(state: DroneState) -> tuple[object, ...] | None:
    """How a drone stands at a station with nothing to do; None for one that does anything else."""
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
