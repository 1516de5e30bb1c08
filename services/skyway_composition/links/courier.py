"""Send instructions: number them without gaps, store them, and add them to the outbox."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from functools import partial
from typing import Final

from skyway.contracts.instruction import AnyInstruction, ReportInstruction
from skyway.contracts.topics import INSTRUCTIONS
from skyway.ids import DroneId, InstructionId
from skyway.runtime.clock import FleetClock
from skyway.runtime.minting import Mint
from skyway.runtime.outbox.outbox_store import confirm
from skyway.runtime.sql.database import Tx
from skyway.runtime.tracing import in_trace_of
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.links import store
from skyway_composition.links.instruction_store import (
    SentInstruction,
    add_instruction,
    add_last_instruction,
    open_instructions,
    set_status,
)
from skyway_composition.links.link import DroneLink, InstructionPlace
from skyway_composition.margins import INSTRUCTION_LIFE

#: Builds the instruction from the members of its envelope: `functools.partial` of a model.
Draft = Callable[..., AnyInstruction]

#: Wall time after which a drone is asked again for its missing events.
_ASK_AGAIN_MS: Final = 5_000


def _no_trace(_drone_id: DroneId) -> None:
    """The drone's mission is not known here: its instructions are in the present trace."""


@dataclass(frozen=True, slots=True)
class Courier:
    """Sends instructions within a transaction that has locked the drone's link.

    `trace_of` gives the traceparent of the mission that a drone is on: all instructions to the
    drone are in this trace.
    """

    clock: FleetClock
    mint: Mint
    trace_of: Callable[[DroneId], str | None] = _no_trace

    def expiry(self) -> datetime:
        """The latest moment to begin an instruction that is sent now, in whole milliseconds."""
        return ms_to_moment(moment_to_ms(self.clock.now() + self.lifetime))

    @property
    def lifetime(self) -> timedelta:
        """How long an instruction can be begun after it was sent."""
        return INSTRUCTION_LIFE.span(self.clock)

    async def post(
        self, tx: Tx, link: DroneLink, draft: Draft, *, expires_at: datetime | None = None
    ) -> tuple[DroneLink, InstructionId]:
        """Send an instruction to the drone, and store its changed link.

        Returns the link and the instruction's id, which the drone's answer names.
        """
        link, place = link.with_next()
        await store.save_link(tx, link)
        instruction = self._instruction(place, draft, expires_at or self.expiry())
        await add_instruction(tx, place.drone_id, instruction)
        with in_trace_of(self.trace_of(place.drone_id)):
            _hand_over(tx, place, instruction)
        return link, instruction.instruction_id

    def post_last(
        self, tx: Tx, place: InstructionPlace, draft: Draft, *, expires_at: datetime
    ) -> None:
        """Send an instruction whose place is claimed, as the transaction's last to this drone."""
        instruction = self._instruction(place, draft, expires_at)
        add_last_instruction(tx, place.drone_id, instruction)
        _hand_over(tx, place, instruction)

    def _instruction(
        self, place: InstructionPlace, draft: Draft, expires_at: datetime
    ) -> AnyInstruction:
        instruction_id = InstructionId(self.mint("ins"))
        return draft(
            message_id=instruction_id,
            sent_at=self.clock.now(),
            instruction_id=instruction_id,
            stream=place.stream,
            seq=place.seq,
            events_confirmed_seq=place.events_confirmed_seq,
            expires_at=expires_at,
        )

    async def ask_for_events(self, tx: Tx, link: DroneLink) -> DroneLink:
        """Ask the drone for the events that follow our last one, unless it was asked just now."""
        now_wall_ms = moment_to_ms(self.clock.wall_now())
        if now_wall_ms - link.report_asked_wall_ms < _ASK_AGAIN_MS:
            return link
        link = replace(link, report_asked_wall_ms=now_wall_ms)
        draft = partial(ReportInstruction, events_after_seq=link.last_event_seq)
        link, _ = await self.post(tx, link, draft)
        return link

    async def withdraw_open(self, tx: Tx, link: DroneLink) -> list[SentInstruction]:
        """Stop sending the instructions that the drone has not answered; return them in order."""
        withdrawn = await open_instructions(tx, link.drone_id)
        await confirm(tx, [each.instruction_id for each in withdrawn])
        for instruction in withdrawn:
            await set_status(tx, instruction.instruction_id, "REISSUED")
        return withdrawn


def _hand_over(tx: Tx, place: InstructionPlace, instruction: AnyInstruction) -> None:
    address = INSTRUCTIONS(place.provider_id, place.drone_id)
    tx.send(address, instruction, confirmed_by="receiver", stream=place.drone_id)
