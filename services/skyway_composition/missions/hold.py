"""Holding a drone: it flies on to its next landing and begins nothing there, until it may."""

from dataclasses import replace
from functools import partial

from skyway.contracts.instruction import HoldInstruction, ResumeInstruction
from skyway.ids import InstructionId
from skyway_composition.links.courier import Draft
from skyway_composition.links.instruction_store import SentInstruction, open_instructions
from skyway_composition.missions.mission_alarm import raise_alarm
from skyway_composition.missions.record import MissionRecord
from skyway_composition.missions.watch import Watch


async def hold(watch: Watch, record: MissionRecord, *, reason: str) -> InstructionId:
    """Tell the drone to hold, until it is resumed or gets new steps; the instruction's id."""
    draft = partial(
        HoldInstruction,
        mission_id=record.mission_id,
        mission_revision=_newest_revision(record),
        reason=reason,
    )
    return await _send(watch, record, draft)


async def resume(watch: Watch, record: MissionRecord) -> InstructionId:
    """Tell the drone to go on; the instruction's id."""
    draft = partial(
        ResumeInstruction,
        mission_id=record.mission_id,
        mission_revision=_newest_revision(record),
    )
    return await _send(watch, record, draft)


async def take_refused_hold(
    watch: Watch, record: MissionRecord, sent: SentInstruction, *, code: str
) -> None:
    """Show a mission as flown on whose drone did not hold, and tell operators."""
    is_told_again = any(
        each.kind == "HOLD" for each in await open_instructions(watch.tx, record.drone_id)
    )
    is_held = record.mission.is_held and record.mission_id == sent.mission_id
    if is_told_again or not is_held:
        return
    await raise_alarm(
        watch,
        record,
        level="URGENT",
        code="HOLD_REFUSED",
        detail=f"the drone flies on, since it refused to hold: {code}",
    )
    await watch.keep(held(record, is_held=False))


def held(record: MissionRecord, *, is_held: bool) -> MissionRecord:
    """The record of a mission that is held, or is held no more."""
    return replace(record, mission=record.mission.model_copy(update={"is_held": is_held}))


def _newest_revision(record: MissionRecord) -> int:
    """The revision that the drone was sent last: it may not have answered it yet."""
    mission = record.mission if record.proposal is None else record.proposal.mission
    return mission.revision


async def _send(watch: Watch, record: MissionRecord, draft: Draft) -> InstructionId:
    link = watch.links[record.drone_id]
    watch.links[record.drone_id] = await watch.courier.send(
        watch.tx, link, draft, expires_at=watch.courier.expiry()
    )
    *_, newest = await open_instructions(watch.tx, record.drone_id)
    return newest.instruction_id
