"""The fake cloud's instructions on their way: numbered, repeated until acked, answered once."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

from pydantic import TypeAdapter

from skyway.contracts.drone_report import Ack
from skyway.contracts.instruction import AnyInstruction, Instruction
from tests.drone_agent.simulation.rehearsal.findings import Findings
from tests.drone_agent.simulation.rehearsal.link import Air

_INSTRUCTION: TypeAdapter[AnyInstruction] = TypeAdapter(Instruction)

#: Wall seconds between two tries.
_REPEAT_S = 2.0

#: How long an instruction is good (fleet time).
_GOOD_FOR = timedelta(hours=2)

#: What is done once a drone has answered for good.
Answered = Callable[[AnyInstruction, Ack], None]


@dataclass
class _Sent:
    instruction: AnyInstruction
    answered: Answered


class Mailbox:
    """The instructions that the drone has not answered yet."""

    def __init__(self, air: Air, findings: Findings) -> None:
        self._air = air
        self._findings = findings
        self._seq = 0
        self._waiting: dict[int, _Sent] = {}
        self.is_silent = False
        self.events_through = 0

    @property
    def is_empty(self) -> bool:
        return not self._waiting

    def send(self, kind: str, answered: Answered, **fields: Any) -> None:
        """Send an instruction; `answered` is called with its final answer."""
        self._seq += 1
        now = self._air.clock.now()
        envelope = {
            "message_id": f"msg_{self._seq}",
            "sent_at": now,
            "instruction_id": f"ins_{self._seq}",
            "stream": 1,
            "seq": self._seq,
            "events_confirmed_seq": self.events_through,
            "expires_at": now + _GOOD_FOR,
            "kind": kind,
        }
        instruction = _INSTRUCTION.validate_python(envelope | fields)
        self._waiting[self._seq] = _Sent(instruction, answered)
        self._transmit(instruction)

    def receive(self, ack: Ack) -> None:
        """Note the drone's ack; only the first final answer counts."""
        if ack.status == "RECEIVED" or ack.code == "SEQUENCE_GAP":
            return
        sent = self._waiting.pop(ack.instruction_seq, None)
        if sent is not None:
            right = sent.instruction.instruction_id
            self._findings.expect(ack.instruction_id == right, "answer to another one", ack)
            sent.answered(sent.instruction, ack)

    async def repeat(self) -> None:
        """Repeat unanswered instructions for ever."""
        while True:
            await self._air.clock.sleep_wall(_REPEAT_S)
            for sent in list(self._waiting.values()):
                self._transmit(sent.instruction)

    def _transmit(self, instruction: AnyInstruction) -> None:
        if not self.is_silent:
            self._air.instruct(instruction.model_dump_json().encode())
