"""All SQL of instructions: what was sent to each drone, and how the drone answered."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import Row, bindparam, func, insert, literal_column, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.instruction import (
    AnyInstruction,
    CancelInstruction,
    DivertInstruction,
    MissionInstruction,
    ReturnHomeInstruction,
)
from skyway.ids import DroneId, InstructionId, MissionId
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway_composition.links.link import DroneLink
from skyway_composition.tables import instructions

#: An instruction that brings steps.
PlanInstruction = MissionInstruction | DivertInstruction | ReturnHomeInstruction

#: States of an instruction that the drone has neither accepted nor rejected.
_OPEN = ("SENT", "RECEIVED")

# Built once, because every booking and every drone message runs these statements, and building
# takes longer than running.
_is_open: Final = instructions.c.status.in_([literal_column(f"'{each}'") for each in _OPEN])
_ADD_INSTRUCTION: Final = insert(instructions)
_SENT_TO: Final = select(instructions.c.instruction_id).where(
    instructions.c.instruction_id == bindparam("instruction_id"),
    instructions.c.drone_id == bindparam("drone_id"),
)
_LAST_REVISION: Final = select(func.max(instructions.c.mission_revision)).where(
    instructions.c.mission_id == bindparam("mission_id")
)
_SET_STATUS: Final = update(instructions).where(
    instructions.c.instruction_id == bindparam("of_instruction")
)
_ANSWER: Final = (
    update(instructions)
    .where(
        instructions.c.instruction_id == bindparam("of_instruction"),
        instructions.c.drone_id == bindparam("to_drone"),
        _is_open,
    )
    .returning(
        instructions.c.instruction_id,
        instructions.c.kind,
        instructions.c.mission_id,
        instructions.c.mission_revision,
    )
)


_BODIES: Final[Mapping[str, type[PlanInstruction]]] = {
    "MISSION": MissionInstruction,
    "DIVERT": DivertInstruction,
    "RETURN_HOME": ReturnHomeInstruction,
}

_PLANS: Final = (
    select(instructions.c.kind, instructions.c.status, instructions.c.body)
    .where(
        in_list(instructions.c.mission_id, "mission_ids"),
        instructions.c.kind.in_(tuple(_BODIES)),
        instructions.c.status != "REISSUED",
    )
    .order_by(instructions.c.stream, instructions.c.seq)
)


@dataclass(frozen=True, slots=True)
class SentPlan:
    """An instruction that brought steps, and whether the drone has accepted it."""

    instruction: PlanInstruction
    is_accepted: bool


@dataclass(frozen=True, slots=True)
class SentInstruction:
    """An instruction as it was sent."""

    instruction_id: InstructionId
    kind: str
    mission_id: MissionId | None
    mission_revision: int | None


async def add_instruction(tx: Tx, drone_id: DroneId, instruction: AnyInstruction) -> None:
    """Store an instruction that is being sent."""
    await tx.execute(_ADD_INSTRUCTION, _instruction_row(drone_id, instruction))


def add_last_instruction(tx: Tx, drone_id: DroneId, instruction: AnyInstruction) -> None:
    """Store an instruction at the end of a transaction that reads no instructions after this."""
    tx.add(instructions, [_instruction_row(drone_id, instruction)])


def _instruction_row(
    drone_id: DroneId, instruction: AnyInstruction
) -> dict[str, Any]:  # column values of any type
    return {
        "instruction_id": instruction.instruction_id,
        "drone_id": drone_id,
        "stream": instruction.stream,
        "seq": instruction.seq,
        "kind": instruction.kind,
        "mission_id": instruction.mission_id,
        "mission_revision": instruction.mission_revision,
        "status": "SENT",
        "body": instruction.model_dump_json(),
    }


async def was_sent(tx: Tx, drone_id: DroneId, instruction_id: InstructionId) -> bool:
    """Whether an instruction was ever sent to this drone."""
    found = await tx.execute(_SENT_TO, {"instruction_id": instruction_id, "drone_id": drone_id})
    return found.scalar_one_or_none() is not None


async def is_answered(tx: Tx, link: DroneLink, *, seq: int) -> bool:
    """Whether the drone has accepted or rejected this instruction of the current stream.

    Answered instructions of deliveries that ended long ago are deleted, but never the last one.
    """
    found = await tx.execute(
        select(instructions.c.status).where(
            instructions.c.drone_id == link.drone_id,
            instructions.c.stream == link.stream,
            instructions.c.seq == seq,
        )
    )
    status = found.scalar_one_or_none()
    return 0 < seq < link.last_seq if status is None else status not in _OPEN


async def open_instructions(tx: Tx, drone_id: DroneId) -> list[SentInstruction]:
    """The instructions that this drone has neither accepted nor rejected, in sending order."""
    found = await tx.execute(
        select(instructions)
        .where(instructions.c.drone_id == drone_id, _is_open)
        .order_by(instructions.c.stream, instructions.c.seq)
    )
    return [_sent(row) for row in found]


async def last_cancel(tx: Tx, link: DroneLink, mission_id: MissionId) -> CancelInstruction | None:
    """The last CANCEL of a mission to the drone in the current stream; None without one."""
    found = await tx.execute(
        select(instructions.c.body)
        .where(
            instructions.c.drone_id == link.drone_id,
            instructions.c.mission_id == mission_id,
            instructions.c.kind == "CANCEL",
            instructions.c.stream == link.stream,
        )
        .order_by(instructions.c.seq.desc())
        .limit(1)
    )
    body = found.scalar_one_or_none()
    return None if body is None else CancelInstruction.read(body)


async def last_revision(tx: Tx, mission_id: MissionId) -> int:
    """The newest revision of a mission that was ever sent, accepted or not; 0 without one."""
    found = await tx.execute(_LAST_REVISION, {"mission_id": mission_id})
    return found.scalar_one() or 0


async def kind_of_revision(tx: Tx, mission_id: MissionId, revision: int) -> str | None:
    """The kind of the instruction that brought this revision of a mission; None without one."""
    found = await tx.execute(
        select(instructions.c.kind)
        .where(
            instructions.c.mission_id == mission_id,
            instructions.c.mission_revision == revision,
            instructions.c.kind.in_(("MISSION", "DIVERT", "RETURN_HOME")),
        )
        .order_by(instructions.c.stream.desc(), instructions.c.seq.desc())
        .limit(1)
    )
    return found.scalar_one_or_none()


async def plans_sent(
    connection: AsyncConnection, mission_ids: Collection[MissionId]
) -> list[SentPlan]:
    """The plans of these missions in sending order; a plan that was sent again counts once."""
    found = await connection.execute(_PLANS, {"mission_ids": [*mission_ids]})
    return [
        SentPlan(_BODIES[row.kind].read(row.body), is_accepted=row.status == "ACCEPTED")
        for row in found
    ]


async def answered(
    tx: Tx, drone_id: DroneId, instruction_id: InstructionId, status: str
) -> SentInstruction | None:
    """Store the drone's answer and return its instruction.

    None when the drone was not sent this instruction, or has answered it already.
    """
    given = {"of_instruction": instruction_id, "to_drone": drone_id, "status": status}
    found = await tx.execute(_ANSWER, given)
    row = found.one_or_none()
    return None if row is None else _sent(row)


async def set_status(tx: Tx, instruction_id: InstructionId, status: str) -> None:
    """Set the state of an instruction."""
    await tx.execute(_SET_STATUS, {"of_instruction": instruction_id, "status": status})


def _sent(row: Row[Any]) -> SentInstruction:  # a row of instructions
    return SentInstruction(row.instruction_id, row.kind, row.mission_id, row.mission_revision)
