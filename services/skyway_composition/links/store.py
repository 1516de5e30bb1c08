"""All SQL of the links: how far the talk with each drone is, and what was sent to it."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import Row, bindparam, case, func, insert, literal_column, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.drone_report import Connection, DroneState
from skyway.contracts.instruction import AnyInstruction, CancelInstruction
from skyway.ids import DroneId, InstructionId, MissionId, ProviderId
from skyway.runtime.sql.among import among
from skyway.runtime.sql.database import Tx
from skyway_composition.links.link import DroneLink, Numbered
from skyway_composition.tables import drone_links, instructions

#: What the drone has not finally answered.
_OPEN = ("SENT", "RECEIVED")

#: Those among `drone_ids` that say so themselves.
OCCUPIED: Final = select(drone_links.c.drone_id).where(
    among(drone_links.c.drone_id, "drone_ids"), drone_links.c.is_occupied
)

# Statements that each booking and each word of a drone needs: making them takes longer than
# running them does.
_is_open: Final = instructions.c.status.in_([literal_column(f"'{each}'") for each in _OPEN])
_LINKS_OF: Final = (
    select(drone_links)
    .where(among(drone_links.c.drone_id, "drone_ids"))
    .order_by(drone_links.c.drone_id)
    .with_for_update()
)
_SAVE_LINK: Final = update(drone_links).where(drone_links.c.drone_id == bindparam("of_drone"))
#: Counts one more instruction to a drone, and tells its place.
COUNT_NEXT: Final = (
    update(drone_links)
    .where(drone_links.c.drone_id == bindparam("of_drone"))
    .values(
        provider_id=bindparam("of_provider"),
        stream=case((drone_links.c.stream < 1, 1), else_=drone_links.c.stream),
        last_seq=drone_links.c.last_seq + 1,
    )
    .returning(
        drone_links.c.drone_id,
        drone_links.c.provider_id,
        drone_links.c.stream,
        drone_links.c.last_seq,
        drone_links.c.last_event_seq,
    )
)
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


@dataclass(frozen=True, slots=True)
class SentInstruction:
    """An instruction as it was sent."""

    instruction_id: InstructionId
    kind: str
    mission_id: MissionId | None
    mission_revision: int | None


async def lock_link(tx: Tx, drone_id: DroneId, provider_id: ProviderId) -> DroneLink:
    """The link to a drone, begun if there was none; nobody else changes it meanwhile."""
    known = await lock_links(tx, [drone_id])
    if not known:
        await _begin(tx, drone_id, provider_id)
        known = await lock_links(tx, [drone_id])
    return known[drone_id]


async def take_next(tx: Tx, drone_id: DroneId, provider_id: ProviderId) -> Numbered:
    """The place of the next instruction to this provider's drone, whose link is locked by that."""
    wanted = {"of_drone": drone_id, "of_provider": provider_id}
    taken = (await tx.execute(COUNT_NEXT, wanted)).one_or_none()
    if taken is None:
        await _begin(tx, drone_id, provider_id)
        taken = (await tx.execute(COUNT_NEXT, wanted)).one()
    return Numbered(*taken)


async def lock_links(tx: Tx, drone_ids: Collection[DroneId]) -> dict[DroneId, DroneLink]:
    """The links to those of these drones that are known."""
    found = await tx.execute(_LINKS_OF, {"drone_ids": sorted(drone_ids)})
    return {row.drone_id: _link(row) for row in found}


async def link_to(connection: AsyncConnection, drone_id: DroneId) -> DroneLink | None:
    """The link to a drone, as it is now."""
    found = await connection.execute(select(drone_links).where(drone_links.c.drone_id == drone_id))
    row = found.one_or_none()
    return None if row is None else _link(row)


async def save_links(tx: Tx, links: Iterable[DroneLink]) -> None:
    """Keep links that are locked."""
    rows = [_values(link) for link in links]
    if rows:
        await tx.execute(_SAVE_LINK, rows)


def _values(link: DroneLink) -> dict[str, Any]:  # parameters of `_SAVE_LINK` of any type
    return {
        "of_drone": link.drone_id,
        "provider_id": link.provider_id,
        "stream": link.stream,
        "last_seq": link.last_seq,
        "acked_stream": link.acked_stream,
        "acked_session": link.acked_session,
        "last_event_seq": link.last_event_seq,
        "report_asked_wall_ms": link.report_asked_wall_ms,
        "state": None if link.state is None else link.state.model_dump_json(),
        "is_occupied": link.is_occupied,
        "connection": None if link.connection is None else link.connection.model_dump_json(),
    }


async def add_instruction(tx: Tx, drone_id: DroneId, instruction: AnyInstruction) -> None:
    """Keep an instruction that is being sent."""
    await tx.execute(_ADD_INSTRUCTION, _instruction_row(drone_id, instruction))


def add_last_instruction(tx: Tx, drone_id: DroneId, instruction: AnyInstruction) -> None:
    """The same when the block ends, which does not ask any more what the drone was sent."""
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
    wanted = {"instruction_id": instruction_id, "drone_id": drone_id}
    found = await tx.execute(_SENT_TO, wanted)
    return found.scalar_one_or_none() is not None


async def is_answered(tx: Tx, link: DroneLink, *, seq: int) -> bool:
    """Whether the drone has finally answered this instruction of the present stream."""
    found = await tx.execute(
        select(instructions.c.status).where(
            instructions.c.drone_id == link.drone_id,
            instructions.c.stream == link.stream,
            instructions.c.seq == seq,
        )
    )
    status = found.scalar_one_or_none()
    return status is not None and status not in _OPEN


async def open_instructions(tx: Tx, drone_id: DroneId) -> list[SentInstruction]:
    """What this drone has not finally answered, in the order of sending."""
    found = await tx.execute(
        select(instructions)
        .where(instructions.c.drone_id == drone_id, _is_open)
        .order_by(instructions.c.stream, instructions.c.seq)
    )
    return [_sent(row) for row in found]


async def last_cancel(tx: Tx, link: DroneLink, mission_id: MissionId) -> CancelInstruction | None:
    """How the drone was last told to forget a mission, in the present stream, if it was."""
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
    """The newest revision of a mission that was ever sent, taken or not."""
    found = await tx.execute(_LAST_REVISION, {"mission_id": mission_id})
    return found.scalar_one() or 0


async def kind_of_revision(tx: Tx, mission_id: MissionId, revision: int) -> str | None:
    """Which instruction brought this revision of a mission; None when none is known."""
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


async def answer(
    tx: Tx, drone_id: DroneId, instruction_id: InstructionId, status: str
) -> SentInstruction | None:
    """An instruction whose answer this drone has just given; None when it had none to give."""
    answered = {"of_instruction": instruction_id, "to_drone": drone_id, "status": status}
    found = await tx.execute(_ANSWER, answered)
    row = found.one_or_none()
    return None if row is None else _sent(row)


async def set_status(tx: Tx, instruction_id: InstructionId, status: str) -> None:
    """Note how far the drone's answer is."""
    await tx.execute(_SET_STATUS, {"of_instruction": instruction_id, "status": status})


async def _begin(tx: Tx, drone_id: DroneId, provider_id: ProviderId) -> None:
    fresh = DroneLink(drone_id, provider_id)
    row = {
        "drone_id": drone_id,
        "provider_id": provider_id,
        "stream": fresh.stream,
        "last_seq": fresh.last_seq,
        "acked_stream": fresh.acked_stream,
        "acked_session": fresh.acked_session,
        "last_event_seq": fresh.last_event_seq,
        "report_asked_wall_ms": fresh.report_asked_wall_ms,
    }
    await tx.execute(tx.insert(drone_links).on_conflict_do_nothing(), row)


def _link(row: Row[Any]) -> DroneLink:  # a row of drone_links
    return DroneLink(
        drone_id=row.drone_id,
        provider_id=row.provider_id,
        stream=row.stream,
        last_seq=row.last_seq,
        acked_stream=row.acked_stream,
        acked_session=row.acked_session,
        last_event_seq=row.last_event_seq,
        report_asked_wall_ms=row.report_asked_wall_ms,
        state=None if row.state is None else DroneState.read(row.state),
        connection=None if row.connection is None else Connection.read(row.connection),
    )


def _sent(row: Row[Any]) -> SentInstruction:  # a row of instructions
    return SentInstruction(row.instruction_id, row.kind, row.mission_id, row.mission_revision)
