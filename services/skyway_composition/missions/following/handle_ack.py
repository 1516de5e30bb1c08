"""Handles a drone's answer to an instruction: it counts once and stops the repetition."""

import logging
from dataclasses import replace
from typing import Final

from skyway.contracts.drone_report import Ack
from skyway.contracts.instruction import RefusalCode
from skyway.ids import DroneId
from skyway.units import moment_to_ms
from skyway_composition.links.instruction_store import (
    SentInstruction,
    answered,
    is_answered,
    was_sent,
)
from skyway_composition.links.link import DroneLink
from skyway_composition.margins import ENERGY_IS_LOOKED_AT
from skyway_composition.missions.following.advance import accept
from skyway_composition.missions.following.handle_failure import open_stream, wait_for_revision
from skyway_composition.missions.mission.end import abort, cancel, refuse, without_doubt
from skyway_composition.missions.mission.instruct import (
    call_off_revision,
    handle_refused_hold,
    is_being_called_off,
)
from skyway_composition.missions.mission.record import CALLED_HOME, MissionRecord, Proposal, Trouble
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, raise_alarm
from skyway_composition.missions.replanning.call_off import handle_answer_to_cancel
from skyway_composition.missions.replanning.propose import accept_proposal, drop_proposal
from skyway_composition.missions.replanning.situation import steering_failsafe
from skyway_composition.missions.replanning.store import plan_now, retry_stuck

log = logging.getLogger(__name__)

#: The kinds of instructions that carry steps.
_REVISIONS: Final = ("MISSION", "DIVERT", "RETURN_HOME")

#: Refusals of a drone that cannot fly with its load.
_NOT_WITH_THIS_LOAD: Final = (RefusalCode.OVERWEIGHT, RefusalCode.INSUFFICIENT_ENERGY)

#: Wall time between a refusal and the next planning. Our own choice.
_LOOK_AGAIN_MS: Final = 2_000

#: After so many refusals in a row for lack of energy a standing drone gets no further plan. The
#: wind had as many minutes to change. A drone that always answers so would otherwise hold its pads
#: for 40 plans. Our own choice.
_MOST_ENERGY_REFUSALS: Final = 10


async def handle_ack(work: MissionUnitOfWork, link: DroneLink, ack: Ack) -> None:
    """Handle an ack: RECEIVED is saved; ACCEPTED and REJECTED are final."""
    is_gap = ack.code is RefusalCode.SEQUENCE_GAP
    sent = None
    if not is_gap:
        sent = await answered(work.tx, link.drone_id, ack.instruction_id, ack.status)
    if sent is None and not await was_sent(work.tx, link.drone_id, ack.instruction_id):
        return
    link = link.acked(ack.stream, ack.session)
    work.stage_link(link)
    if is_gap:
        await _handle_gap(work, link, ack)
    if sent is None or ack.status == "RECEIVED":
        return
    work.stage_answer(sent.instruction_id)
    record = work.missions.get(link.drone_id)
    proposal = None if record is None else record.proposal
    if record is not None and proposal and proposal.instruction_id == sent.instruction_id:
        await _handle_answer_to_proposal(work, record, proposal, sent=sent, ack=ack)
    elif sent.kind in _REVISIONS and ack.status == "ACCEPTED":
        await _handle_acceptance(work, link, sent)
    elif sent.kind in _REVISIONS:
        await _handle_refusal(work, work.links[link.drone_id], sent, ack)
    elif sent.kind == "HOLD" and ack.status == "REJECTED" and record is not None:
        await handle_refused_hold(work, record, sent, code=ack.code or RefusalCode.MALFORMED)
    elif sent.kind == "HAND_OVER" and ack.status == "REJECTED" and record is not None:
        await _raise_proof_refused(work, record, ack)
    elif sent.kind == "CANCEL" and record is not None and record.mission_id == sent.mission_id:
        await handle_answer_to_cancel(work, record, ack)


async def _raise_proof_refused(work: MissionUnitOfWork, record: MissionRecord, ack: Ack) -> None:
    """Raise an alarm: a drone did not hand over a package though its proof is there."""
    detail = f"the proof of a hand-over came in vain: {ack.detail or ack.code}"
    await raise_alarm(work, record, level="WARNING", code="PROOF_REFUSED", detail=detail)


async def _handle_answer_to_proposal(
    work: MissionUnitOfWork,
    record: MissionRecord,
    proposal: Proposal,
    *,
    sent: SentInstruction,
    ack: Ack,
) -> None:
    if ack.status == "ACCEPTED":
        await accept_proposal(work, record, proposal, kind=sent.kind)
        return
    code = ack.code or RefusalCode.MALFORMED
    log.info("proposal refused", extra={"mission_id": record.mission_id, "code": code})
    if code is RefusalCode.FAILSAFE_ACTIVE:
        record = await _handle_failsafe_refusal(work, record)
    record = await drop_proposal(work, record)
    is_loading = record.trouble is not None and record.trouble.loaded is not None
    if is_loading and code in _NOT_WITH_THIS_LOAD:
        detail = ack.detail or "the drone refused its load"
        await cancel(work, record, Trouble(code=code, detail=detail))
    elif code is not RefusalCode.STEP_RELEASED:
        # The drone would refuse the same plan again, until it has reported a new state.
        at_wall_ms = moment_to_ms(work.clock.wall_now()) + _LOOK_AGAIN_MS
        await retry_stuck(work.tx, record.mission_id, at_wall_ms=at_wall_ms)


async def _handle_failsafe_refusal(work: MissionUnitOfWork, record: MissionRecord) -> MissionRecord:
    """A drone has refused a new plan because of its failsafe; returns the changed record.

    The plan is made again once the failsafe is over. If an operator had asked for the plan,
    operators get an alarm. A plan that could not override the failsafe does not try that again.
    """
    trouble = record.trouble
    if trouble is None:
        return record
    if trouble.code == CALLED_HOME or trouble.land_at is not None:
        active = steering_failsafe(record, work.links[record.drone_id].state)
        acting = "a failsafe" if active is None else f"{active.failsafe} for {active.fault}"
        hint = "nothing overrides this" if trouble.overrides_failsafe else "unless overridden"
        await raise_alarm(
            work,
            record,
            level="WARNING",
            code="FAILSAFE_ACTIVE",
            detail=(
                f"the drone refused {trouble.code} ({trouble.detail}): {acting} is under way; "
                f"it is sent again when that is over, {hint}"
            ),
            data={} if active is None else active.model_dump(mode="json"),
        )
    return record.with_trouble(trouble.model_copy(update={"overrides_failsafe": False}))


async def _handle_gap(work: MissionUnitOfWork, link: DroneLink, ack: Ack) -> None:
    """Open a new stream if the drone misses an instruction that was answered before.

    Such a drone runs on an old copy of its journal, and the instruction is not repeated. Otherwise
    the outbox repeats the missing instruction, so nothing is to be done.
    """
    state, expected_seq = link.state, ack.data.get("expected_seq")
    # Only a state of this session says at which number its events continue.
    is_of_now = state is not None and state.session == ack.session and ack.stream == link.stream
    if state is None or not is_of_now or not isinstance(expected_seq, int):
        return
    if await is_answered(work.tx, link, seq=expected_seq):
        await open_stream(work, link, state)


async def _handle_acceptance(
    work: MissionUnitOfWork, link: DroneLink, sent: SentInstruction
) -> None:
    record = work.missions.get(link.drone_id)
    if record is not None and record.mission_id == sent.mission_id:
        record = _with_energy_refusals(record, 0)
        work.stage(accept(work, without_doubt(work, record)))
        # Planning for later troubles has waited for this answer.
        is_waited_for = record.needs_plan and await is_being_called_off(
            work, link.drone_id, record.mission_id
        )
        if record.needs_plan and not is_waited_for:
            await plan_now(work.tx, record.mission_id)
        return
    if sent.mission_id is None or sent.mission_revision is None:
        return
    # The mission was given up before this answer arrived: the drone must not fly it.
    log.warning("late acceptance", extra={"mission_id": sent.mission_id})
    reason = "the mission was given up before it was accepted"
    await call_off_revision(
        work, link.drone_id, sent.mission_id, sent.mission_revision, reason=reason
    )


async def _handle_refusal(
    work: MissionUnitOfWork, link: DroneLink, sent: SentInstruction, ack: Ack
) -> None:
    record = work.missions.get(link.drone_id)
    is_current = (
        record is not None
        and record.mission_id == sent.mission_id
        and record.mission.revision == sent.mission_revision
    )
    if record is None or not is_current:
        return
    code = ack.code or RefusalCode.MALFORMED
    if record.mission.state == "BOOKED" and (link.has_unread_events or record.mission.doubt):
        # A drone may refuse a mission that it has flown. Its events decide, or an operator.
        work.links[link.drone_id] = await work.courier.ask_for_events(work.tx, link)
    elif record.mission.state == "BOOKED":
        detail = ack.detail or "the drone refused the mission"
        await refuse(work, record, Trouble(code=code, detail=detail))
    else:
        is_for_energy = code is RefusalCode.INSUFFICIENT_ENERGY
        refused = record.mission.energy_refusals + 1 if is_for_energy else 0
        why = Trouble(code=code, detail=ack.detail or "the drone refused the revision")
        await wait_for_revision(work, _with_energy_refusals(record, refused), why)
        if is_for_energy and record.trouble is None:
            await _wait_or_give_up(work, link.drone_id)


def _with_energy_refusals(record: MissionRecord, number: int) -> MissionRecord:
    """The record with this number of plans that the drone has refused in a row for its energy."""
    mission = record.mission.model_copy(update={"energy_refusals": number})
    return replace(record, mission=mission)


async def _wait_or_give_up(work: MissionUnitOfWork, drone_id: DroneId) -> None:
    """Plan again a minute later for a drone that refused for lack of energy, or abort its mission.

    In this minute the wind can change. Without it the mission would soon use up all its plans. A
    plan that a command or a closure needs does not wait. The mission is aborted after too many
    refusals in a row.
    """
    record = work.missions.get(drone_id)
    if record is None or record.stuck is None:
        return
    refused = record.mission.energy_refusals
    if refused < _MOST_ENERGY_REFUSALS:
        pause = ENERGY_IS_LOOKED_AT.span(work.clock) / work.clock.rate
        at_wall_ms = moment_to_ms(work.clock.wall_now() + pause)
        await retry_stuck(work.tx, record.mission_id, at_wall_ms=at_wall_ms)
        return
    detail = f"the drone has refused {refused} plans in a row for lack of energy"
    why = Trouble(code=RefusalCode.INSUFFICIENT_ENERGY, detail=detail)
    await abort(work, record, why, at=work.clock.now())
    # Afterwards: this alarm stays, because people must see to a drone that stands with packages.
    await raise_alarm(work, record, level="URGENT", code="REVISIONS_REFUSED", detail=detail)
