"""Instructions to the drone of a mission: fly these steps, cancel, hold, resume."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from skyway.contracts.flight_step import FlightStep
from skyway.contracts.instruction import (
    CancelInstruction,
    HoldInstruction,
    MissionInstruction,
    ResumeInstruction,
)
from skyway.contracts.mission import Mission
from skyway.ids import DroneId, InstructionId, MissionId
from skyway.runtime.tracing import in_trace_of
from skyway.units import moment_to_ms
from skyway_composition.links.courier import Draft
from skyway_composition.links.instruction_store import SentInstruction, open_instructions
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, raise_alarm


def mission_draft(mission: Mission, steps: Sequence[FlightStep]) -> Draft:
    """The instruction with these steps as the mission's present revision."""
    return partial(
        MissionInstruction,
        mission_id=mission.mission_id,
        mission_revision=mission.revision,
        delivery_id=mission.delivery_id,
        first_step=steps[0].step_id,
        steps=tuple(steps),
    )


async def call_off(work: MissionUnitOfWork, record: MissionRecord, *, reason: str) -> None:
    """Instruct the drone to cancel its mission, unless such an instruction is unanswered."""
    revision = record.mission.revision
    await call_off_revision(work, record.drone_id, record.mission_id, revision, reason=reason)


async def call_off_revision(
    work: MissionUnitOfWork, drone_id: DroneId, mission_id: MissionId, revision: int, *, reason: str
) -> None:
    """Call off a mission of which only the id and the revision are known."""
    if await is_being_called_off(work, drone_id, mission_id):
        return
    draft = partial(
        CancelInstruction, mission_id=mission_id, mission_revision=revision, reason=reason
    )
    await work.send(drone_id, draft)


async def is_being_called_off(
    work: MissionUnitOfWork, drone_id: DroneId, mission_id: MissionId
) -> bool:
    """Whether the drone has not answered yet whether it cancels this mission."""
    sent = await open_instructions(work.tx, drone_id)
    return any(each.kind == "CANCEL" and each.mission_id == mission_id for each in sent)


async def send_mission(work: MissionUnitOfWork, record: MissionRecord) -> None:
    """Send the planned steps of a mission: for the first time, or again in a new stream."""
    all_steps = await work.steps.of(record.mission_id)
    steps = [each.step for each in all_steps if each.status == "PLANNED"]
    expires_at = work.courier.expiry()
    # A QUEUED mission is not in the unit of work yet.
    with in_trace_of(record.traceparent):
        draft = mission_draft(record.mission, steps)
        await work.send(record.drone_id, draft, expires_at=expires_at)
    await work.save(replace(record, expires_ms=moment_to_ms(expires_at)))


async def hold(work: MissionUnitOfWork, record: MissionRecord, *, reason: str) -> InstructionId:
    """Instruct the drone to hold: it flies to its next landing and starts nothing there.

    A RESUME or new steps end the hold. Returns the id of the instruction.
    """
    draft = partial(
        HoldInstruction,
        mission_id=record.mission_id,
        mission_revision=_newest_revision(record),
        reason=reason,
    )
    return await work.send(record.drone_id, draft)


async def resume(work: MissionUnitOfWork, record: MissionRecord) -> InstructionId:
    """Instruct the drone to continue; returns the id of the instruction."""
    draft = partial(
        ResumeInstruction,
        mission_id=record.mission_id,
        mission_revision=_newest_revision(record),
    )
    return await work.send(record.drone_id, draft)


async def handle_refused_hold(
    work: MissionUnitOfWork, record: MissionRecord, sent: SentInstruction, *, code: str
) -> None:
    """The drone refused to hold: the mission is no longer held, and operators get an alarm."""
    is_sent_again = any(
        each.kind == "HOLD" for each in await open_instructions(work.tx, record.drone_id)
    )
    is_held = record.mission.is_held and record.mission_id == sent.mission_id
    if is_sent_again or not is_held:
        return
    await raise_alarm(
        work,
        record,
        level="URGENT",
        code="HOLD_REFUSED",
        detail=f"the drone flies on because it refused to hold: {code}",
    )
    await work.save(held(record, is_held=False))


def held(record: MissionRecord, *, is_held: bool) -> MissionRecord:
    """The record with its mission held or not held."""
    return replace(record, mission=record.mission.model_copy(update={"is_held": is_held}))


def _newest_revision(record: MissionRecord) -> int:
    """The newest revision that was sent to the drone, answered or not."""
    mission = record.mission if record.proposal is None else record.proposal.mission
    return mission.revision
