"""Invariants of all messages that a drone publishes."""

from typing import Any

from skyway.contracts.drone_report import Ack, Connection, DroneEvent, DroneState
from skyway.contracts.topics import Topic
from tests.drone_agent.simulation.rehearsal.disk import Disk
from tests.drone_agent.simulation.rehearsal.findings import Findings

#: Instructions of which the drone still knows its answer.
_REMEMBERED = 64


class Witness:
    """Checks every message that reaches the broker."""

    def __init__(self, disk: Disk, findings: Findings) -> None:
        self._disk = disk
        self._findings = findings
        self._last: dict[str, tuple[int, int]] = {}
        self._final_acks: dict[str, tuple[object, ...]] = {}
        self._events: dict[int, DroneEvent] = {}
        self._connection = (0, 0)
        self._state: DroneState | None = None

    @property
    def events(self) -> list[DroneEvent]:
        """Each once, in order."""
        return [event for _, event in sorted(self._events.items())]

    def receive(self, topic: Topic[Any], message: Any) -> None:
        match message:
            case Connection():
                self._check_connection(message)
            case DroneEvent():
                self._check_event(message)
            case _:
                self._check_numbered(topic, message)
        if isinstance(message, Ack):
            self._check_ack(message)
        if isinstance(message, DroneState):
            self._check_state(message)

    def _check_numbered(self, topic: Topic[Any], message: Any) -> None:
        number = (message.session, message.seq)
        last = self._last.get(topic.template, (0, 0))
        # What the broker did not confirm comes again with the number it had.
        is_again = isinstance(message, Ack) and number == last
        self._findings.expect(
            number > last or is_again, "I15: went backwards", (topic.template, last, number)
        )
        self._last[topic.template] = number

    def _check_connection(self, message: Connection) -> None:
        number = (message.session, message.connection_number)
        self._findings.expect(number >= self._connection, "I15: connection went backwards", message)
        self._connection = number

    def _check_event(self, event: DroneEvent) -> None:
        known = self._events.setdefault(event.seq, event)
        self._findings.expect(known == event, "I15: one event number, two events", event)
        kept = self._disk.kept
        self._findings.expect(
            event.seq <= kept.last_event_seq, "I7: sent before it was in the journal", event.seq
        )

    def _check_ack(self, ack: Ack) -> None:
        if ack.status == "RECEIVED" or ack.code == "SEQUENCE_GAP":
            return
        final = (ack.status, ack.code, ack.detail, str(ack.data))
        known = self._final_acks.setdefault(ack.instruction_id, final)
        self._findings.expect(known == final, "I7: two final answers", (known, final))
        if ack.instruction_seq > self._disk.kept.last_instruction_seq - _REMEMBERED:
            kept = [one.status for one in self._disk.kept.answers if one.seq == ack.instruction_seq]
            self._findings.expect(
                kept == [ack.status], "I7: answered before it was in the journal", (ack, kept)
            )

    def _check_state(self, state: DroneState) -> None:
        last, self._state = self._state, state
        if last is None:
            return
        for name in ("at", "last_instruction_seq", "last_event_seq"):
            self._findings.expect(
                getattr(state, name) >= getattr(last, name),
                "I15: the state went backwards",
                (name, getattr(last, name), getattr(state, name)),
            )
        if state.mission_id is not None and state.mission_id == last.mission_id:
            before = (last.mission_revision or 0, last.step_id or 0)
            now = (state.mission_revision or 0, state.step_id or 0)
            is_on = (
                self._disk.has_forgotten
                or now[0] > before[0]
                or (now[0] == before[0] and (now >= before or not now[1]))
            )
            self._findings.expect(is_on, "I15: the mission went backwards", (before, now))
