"""Handles instructions in order; each answer is in the journal before it is sent as an ack."""

import asyncio
import logging
from collections import deque
from dataclasses import replace
from itertools import islice
from typing import Any, Final, Literal, Protocol

from pydantic import TypeAdapter, ValidationError

from skyway.complaints import fault_of
from skyway.contracts.drone_report import Ack
from skyway.contracts.instruction import AnyInstruction, Instruction, RefusalCode, ReportInstruction
from skyway.contracts.topics import ACKS, INSTRUCTIONS, Topic
from skyway.ids import InstructionId
from skyway.json_model import WireModel
from skyway.runtime.clock import FleetClock
from skyway_drone_agent.failsafes.failsafe import overridden_by
from skyway_drone_agent.flying.step_checks import as_modelled
from skyway_drone_agent.journal.flight_recorder import FlightRecorder
from skyway_drone_agent.journal.journal import JournalUnwritable
from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.journal.record_effects import logbook_after
from skyway_drone_agent.journal.records import AcceptanceSent, Answer, InstructionAnswered
from skyway_drone_agent.link.uplink import Uplink
from skyway_drone_agent.messages.refusal import Refusal, refusal_of
from skyway_drone_agent.vehicle import EnergyUse, Vehicle

log = logging.getLogger(__name__)

_INSTRUCTION: TypeAdapter[AnyInstruction] = TypeAdapter(Instruction)

#: The topic of instructions, read as plain JSON: an instruction that this version cannot read is
#: refused, not dropped. Any, for that reason.
RAW_INSTRUCTIONS: Final[Topic[Any]] = replace(INSTRUCTIONS, message=dict[str, Any])

_Status = Literal["RECEIVED", "ACCEPTED", "REJECTED"]


class _Envelope(WireModel):
    """The fields of an instruction that are needed to answer it."""

    instruction_id: InstructionId
    stream: int
    seq: int
    traceparent: str | None = None


class Answers(Protocol):
    """Sends answers to the cloud."""

    def received(self, answer: Answer) -> None:
        """Send RECEIVED: the instruction is in the journal."""
        ...

    def answered(self, answer: Answer) -> None:
        """Send the final answer, or that the instruction came too early."""
        ...


class Events(Protocol):
    """Sends events to the cloud."""

    def resend_after(self, seq: int) -> None:
        """Send the events after this one again."""
        ...


class Inbox:
    """Handles the instructions of one drone."""

    def __init__(
        self,
        recorder: FlightRecorder,
        clock: FleetClock,
        *,
        vehicle: Vehicle,
        answers: Answers,
        events: Events,
        energy_use: EnergyUse = as_modelled,
    ) -> None:
        self._recorder = recorder
        self._clock = clock
        self._vehicle = vehicle
        self._answers = answers
        self._events = events
        self._energy_use = energy_use

    def handle(self, raw: dict[str, Any]) -> None:
        """Answer an instruction in its JSON form; the answer is in the journal first."""
        try:
            envelope = _Envelope.model_validate(raw)
        except ValidationError:
            log.warning(
                "instruction without identity dropped",
                extra={"drone_id": self._recorder.drone_id},
            )
            return
        logbook = self._recorder.logbook
        expected_seq = 1
        if envelope.stream == logbook.stream:
            expected_seq = logbook.last_instruction_seq + 1
        if envelope.stream < logbook.stream or envelope.seq < expected_seq:
            self._answer_again(envelope, logbook)
        elif envelope.seq > expected_seq:
            self._answers.answered(_gap(envelope, logbook, expected_seq=expected_seq))
        else:
            self._answer(envelope, raw)

    def _answer(self, envelope: _Envelope, raw: dict[str, Any]) -> None:
        now = self._clock.now()
        instruction, refusal = _understood(raw)
        logbook, overridden = self._recorder.logbook, None
        if instruction is not None:
            overridden = overridden_by(instruction, logbook, vehicle=self._vehicle, now=now)
            refusal = refusal_of(
                instruction,
                logbook if overridden is None else logbook_after(logbook, overridden),
                vehicle=self._vehicle,
                now=now,
                energy_use=self._energy_use,
            )
        answer = _accepted(envelope) if refusal is None else _refused(envelope, refusal)
        answered = InstructionAnswered(answered_at=now, answer=answer, instruction=instruction)
        # The override is written first: without the answer the drone flies on as planned, and the
        # cloud sends the instruction again.
        before = (overridden,) if overridden is not None and refusal is None else ()
        try:
            self._recorder.record(*before, answered)
        except JournalUnwritable:
            # Without a record there is no ack, so the cloud sends the instruction again.
            return
        self._send_answer(answer)
        if refusal is None and isinstance(instruction, ReportInstruction):
            self._events.resend_after(instruction.events_after_seq)

    def _send_answer(self, answer: Answer) -> None:
        log.info(
            "instruction answered",
            extra={
                "drone_id": self._recorder.drone_id,
                "instruction_id": answer.instruction_id,
                "status": answer.status,
                "code": answer.code,
                "detail": answer.detail,
            },
        )
        self._answers.received(answer)
        self._answers.answered(answer)

    def _answer_again(self, envelope: _Envelope, logbook: Logbook) -> None:
        """Give the same answer as the first time, and change nothing."""
        for answer in logbook.answers:
            if (answer.stream, answer.seq) == (envelope.stream, envelope.seq):
                if answer.instruction_id == envelope.instruction_id:
                    self._answers.answered(answer)
                    return
                break
        detail = (
            f"stream {envelope.stream} seq {envelope.seq} is past, the drone is at "
            f"stream {logbook.stream} seq {logbook.last_instruction_seq}"
        )
        self._answers.answered(_refused(envelope, Refusal(RefusalCode.STALE_REVISION, detail)))


def _understood(raw: dict[str, Any]) -> tuple[AnyInstruction | None, Refusal | None]:
    """The instruction, or the reason why it cannot be read."""
    try:
        return _INSTRUCTION.validate_python(raw, extra="ignore"), None
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        is_new_step = first["type"] == "union_tag_invalid" and "steps" in first["loc"]
        code = RefusalCode.UNSUPPORTED_STEP if is_new_step else RefusalCode.MALFORMED
        return None, Refusal(code, ": ".join(fault_of(first)))


def _accepted(envelope: _Envelope) -> Answer:
    return Answer(**envelope.model_dump(), status="ACCEPTED")


def _refused(envelope: _Envelope, refusal: Refusal) -> Answer:
    return Answer(
        **envelope.model_dump(),
        status="REJECTED",
        code=refusal.code,
        detail=refusal.detail,
        data=refusal.data,
    )


def _gap(envelope: _Envelope, logbook: Logbook, *, expected_seq: int) -> Answer:
    """No final answer: the instruction is accepted after the instructions before it."""
    detail = f"seq {expected_seq} of stream {envelope.stream} comes first, not {envelope.seq}"
    data = {"expected_seq": expected_seq, "stream": logbook.stream}
    return _refused(envelope, Refusal(RefusalCode.SEQUENCE_GAP, detail, data))


class AckQueue:
    """Sends answers as acks, and records when the broker confirmed a mission's ACCEPTED."""

    def __init__(self, uplink: Uplink, recorder: FlightRecorder, clock: FleetClock) -> None:
        self._uplink = uplink
        self._recorder = recorder
        self._clock = clock
        self._waiting: deque[tuple[_Status, Answer]] = deque()
        self._has_some = asyncio.Event()
        self._all_sent = asyncio.Event()
        self._all_sent.set()

    def received(self, answer: Answer) -> None:
        """Queue RECEIVED: the instruction is in the journal."""
        self._add("RECEIVED", answer)

    def answered(self, answer: Answer) -> None:
        """Queue the final answer."""
        self._add(answer.status, answer)

    async def run(self) -> None:
        """Send for ever; after a restart first the ack of the current mission."""
        if self._recorder.logbook.mission is not None:
            self.answered(self._recorder.logbook.mission.accepted_by)
        while True:
            await self._has_some.wait()
            together = self._together()
            acks = [self._ack(status, answer) for status, answer in together]
            await self._uplink.send_until_confirmed(ACKS, *acks)
            for status, answer in together:
                self._waiting.popleft()
                if status == "ACCEPTED":
                    self._note_acceptance(answer)
            if not self._waiting:
                self._has_some.clear()
                self._all_sent.set()

    async def wait_all_sent(self) -> None:
        """Return once the broker has confirmed every answer, and the journal says so."""
        await self._all_sent.wait()

    def _together(self) -> list[tuple[_Status, Answer]]:
        """The next answer; a RECEIVED is sent together with the answer after it."""
        is_received = self._waiting[0][0] == "RECEIVED"
        return list(islice(self._waiting, 2 if is_received else 1))

    def _add(self, status: _Status, answer: Answer) -> None:
        self._waiting.append((status, answer))
        self._has_some.set()
        self._all_sent.clear()

    def _note_acceptance(self, answer: Answer) -> None:
        mission = self._recorder.logbook.mission
        is_new = mission is not None and mission.acceptance_sent_at is None
        if mission is not None and is_new and answer == mission.accepted_by:
            self._recorder.note(AcceptanceSent(acceptance_sent_at=self._clock.now()))

    def _ack(self, status: _Status, answer: Answer) -> Ack:
        is_final = status != "RECEIVED"
        return Ack(
            **self._uplink.envelope(ACKS),
            traceparent=answer.traceparent,
            instruction_id=answer.instruction_id,
            instruction_seq=answer.seq,
            stream=answer.stream,
            status=status,
            code=answer.code if is_final else None,
            detail=answer.detail if is_final else None,
            data=answer.data if is_final else {},
        )
