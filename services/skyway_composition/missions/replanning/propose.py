"""Makes and sends revisions: a proposal to a flying drone, a replacement to a waiting drone.

A proposal becomes the plan once the drone has accepted it. Until then the old plan holds, and the
pads of both plans are reserved. After acceptance the new steps replace the old ones, and only their
pads stay reserved. After a refusal the old steps stay, and another plan is made from what the drone
reports then. A waiting drone has no plan left, so its revision replaces the old plan immediately.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import timedelta
from functools import partial
from typing import Final

from skyway.contracts.flight_step import DeliverStep, FlightStep, FlyStep, WaitStep
from skyway.contracts.instruction import (
    DivertInstruction,
    MissionInstruction,
    ReturnHomeInstruction,
)
from skyway.contracts.mission import Mission
from skyway.delivery.plan import PickUp
from skyway.ids import MissionId, PackageId
from skyway.runtime.clock import FleetClock
from skyway.scheduling.trip import PlacedStep
from skyway.units import ms_to_moment
from skyway_composition.links.courier import Draft
from skyway_composition.links.instruction_store import kind_of_revision
from skyway_composition.links.link import DroneLink
from skyway_composition.margins import PROOF_ARRIVES
from skyway_composition.missions.mission.from_trip import (
    StepTerms,
    finished_wait,
    flight_steps,
    next_revision,
)
from skyway_composition.missions.mission.instruct import mission_draft
from skyway_composition.missions.mission.record import (
    CALLED_HOME,
    OF_STANDBY_ONLY,
    Aim,
    MissionRecord,
    Proposal,
    Trouble,
)
from skyway_composition.missions.mission.standby import release_unneeded_pads
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, report
from skyway_composition.missions.replanning.call_off import release_left_out
from skyway_composition.missions.replanning.check_plan import request_plan
from skyway_composition.missions.replanning.find_plan import NewPlan
from skyway_composition.missions.replanning.remainder.anchor import Anchor
from skyway_composition.missions.replanning.remainder.planner import Remainder, turned_back
from skyway_composition.missions.replanning.store import plan_now


@dataclass(frozen=True, slots=True)
class Revision:
    """A new plan of a mission: its public part, the steps for the drone, and the aims."""

    mission: Mission
    steps: tuple[FlightStep, ...]
    aims: tuple[Aim, ...]


async def propose(
    work: MissionUnitOfWork,
    record: MissionRecord,
    revision: Revision,
    *,
    anchor: Anchor,
    trouble: Trouble,
) -> None:
    """Send a revision as a proposal; the pads of both plans are reserved from now on.

    Raises
    ------
    RowRefused
        Another mission has one of the new pads.
    """
    draft = _draft(revision, anchor, trouble)
    instruction_id = await work.send(record.drone_id, draft)
    record = with_aims(work, record, revision.aims, trouble)
    proposal = Proposal(
        instruction_id=instruction_id,
        first_step=anchor.first_step,
        mission=revision.mission,
        steps=revision.steps,
        code=trouble.code,
        detail=trouble.detail,
    )
    record = replace(record, proposal=proposal)
    await work.save(record)
    await release_unneeded_pads(work, record)


async def accept_if_flown(
    work: MissionUnitOfWork, record: MissionRecord, revision: int | None
) -> MissionRecord:
    """Accept a proposal by which the drone flies already, before its answer has arrived.

    Otherwise the late answer would undo what the drone has done by the new plan.
    """
    proposal = record.proposal
    if proposal is None or revision != proposal.mission.revision:
        return record
    kind = await kind_of_revision(work.tx, record.mission_id, revision)
    return await accept_proposal(work, record, proposal, kind=kind)


async def accept_proposal(
    work: MissionUnitOfWork, record: MissionRecord, proposal: Proposal, *, kind: str | None
) -> MissionRecord:
    """The drone has accepted the proposal, an instruction of this kind: it becomes the plan."""
    if kind != "MISSION":
        # The steps after the flight under way decide whether that flight lands.
        await adjust_last_flight(work, record.mission_id, proposal)
    old = record.mission
    mission = proposal.mission.model_copy(update={"state": old.state, "is_held": old.is_held})
    await work.steps.replace(
        record.mission_id,
        proposal.steps,
        first_step=proposal.first_step,
        revision=mission.revision,
    )
    record = replace(
        record,
        mission=mission,
        proposal=None,
        stuck=None,
        reported_activity=None,
        trouble=_left_of(record.trouble, proposal),
    )
    await release_unneeded_pads(work, record)
    record = await release_left_out(work, record)
    if proposal.code not in OF_STANDBY_ONLY:
        why = Trouble(code=proposal.code, detail=proposal.detail)
        record = _report_replanned(work, record, why)
    await work.save(record)
    await plan_now(work.tx, record.mission_id)
    missing = _returns_not_in_plan(record, proposal.steps)
    if missing:
        detail = f"cancelled while the plan was on its way: {', '.join(missing)}"
        record = await request_plan(work, record, Trouble(code="CANCELLED", detail=detail))
    return record


async def drop_proposal(work: MissionUnitOfWork, record: MissionRecord) -> MissionRecord:
    """Remove a proposal that the drone will not fly, and release its pads.

    The trouble stays, and another plan is made immediately.
    """
    record = replace(record, proposal=None)
    await release_unneeded_pads(work, record)
    await work.save(record)
    await plan_now(work.tx, record.mission_id)
    return record


async def replace_plan(
    work: MissionUnitOfWork, record: MissionRecord, revision: Revision, *, trouble: Trouble
) -> None:
    """Replace all planned steps by a revision, and send it.

    Raises
    ------
    RowRefused
        Another mission has one of the new pads.
    """
    mission = revision.mission
    await work.steps.replace_planned(record.mission_id, revision.steps, revision=mission.revision)
    record = with_aims(work, record, revision.aims, trouble)
    record = replace(record, mission=mission, stuck=None, trouble=None, reported_activity=None)
    await release_unneeded_pads(work, record)
    record = await release_left_out(work, record)
    await work.send(record.drone_id, mission_draft(mission, revision.steps))
    record = _report_replanned(work, record, trouble)
    await work.save(record)


def with_aims(
    work: MissionUnitOfWork, record: MissionRecord, aims: tuple[Aim, ...], why: Trouble
) -> MissionRecord:
    """The record with these aims; packages that now go back to the pickup are reported."""
    turned = turned_back(record.aims, aims)
    record = replace(record, aims=aims)
    if not turned:
        return record
    return report(work, record, "RETURNING", package_ids=turned, code=why.code, detail=why.detail)


async def adjust_last_flight(
    work: MissionUnitOfWork, mission_id: MissionId, proposal: Proposal
) -> None:
    """Save whether the flight before a proposal lands.

    Before another flight the drone flies on over the station; before any other step it lands.
    """
    lands = not isinstance(proposal.steps[0], FlyStep)
    for each in await work.steps.of(mission_id):
        step = each.step
        is_last_valid = step.step_id == proposal.first_step - 1 and each.status == "PLANNED"
        if is_last_valid and isinstance(step, FlyStep) and step.lands != lands:
            await work.steps.change(mission_id, step.model_copy(update={"lands": lands}))


def _left_of(trouble: Trouble | None, proposal: Proposal) -> Trouble | None:
    """The trouble that came after the proposal; a confirmed loading is sent only once."""
    if trouble is None or (proposal.code, proposal.detail) == (trouble.code, trouble.detail):
        return None
    is_loaded = proposal.mission.loading == "CONFIRMED"
    return trouble.model_copy(update={"loaded": None}) if is_loaded else trouble


def _draft(revision: Revision, anchor: Anchor, trouble: Trouble) -> Draft:
    """A MISSION if it replaces only steps that are not released, else a DIVERT or RETURN_HOME."""
    mission = revision.mission
    common = {
        "mission_id": mission.mission_id,
        "mission_revision": mission.revision,
        "delivery_id": mission.delivery_id,
        "steps": revision.steps,
    }
    is_mission = not anchor.is_divert and not trouble.overrides_failsafe
    if trouble.code != CALLED_HOME and is_mission:
        return partial(
            MissionInstruction, first_step=anchor.first_step, loaded=trouble.loaded, **common
        )
    kind = ReturnHomeInstruction if trouble.code == CALLED_HOME else DivertInstruction
    return partial(
        kind,
        last_valid_step=anchor.last_valid_step,
        reason=f"{trouble.code}: {trouble.detail}",
        overrides_failsafe=trouble.overrides_failsafe,
        **common,
    )


def _returns_not_in_plan(
    record: MissionRecord, steps: Sequence[FlightStep]
) -> tuple[PackageId, ...]:
    """Packages that must return but that the accepted plan delivers.

    They were cancelled after the plan was sent and before the drone accepted it.
    """
    delivered = {
        package_id
        for step in steps
        if isinstance(step, DeliverStep)
        for package_id in step.package_ids
    }
    return tuple(
        aim.package_id
        for aim in record.aims
        if aim.kind == "RETURN" and aim.package_id in delivered
    )


def _report_replanned(
    work: MissionUnitOfWork, record: MissionRecord, why: Trouble
) -> MissionRecord:
    """Report that a mission continues by another plan, and why."""
    return report(
        work,
        record,
        "REPLANNED",
        code=why.code,
        detail=why.detail,
        etas=record.mission.packages,
        mission=record.mission,
    )


#: A diverted drone without any further command ends its mission after this time. Our own choice.
_LONGEST_WAIT: Final = timedelta(days=7)


def revision_of(
    plan: NewPlan, record: MissionRecord, link: DroneLink, *, clock: FleetClock
) -> Revision:
    """The mission's next revision by this plan, with its steps."""
    case, anchor, remainder = plan.case, plan.anchor, plan.remainder
    trouble, world, skyway = case.trouble, case.world, case.world.skyway
    terms = StepTerms.of(
        replace(record, aims=remainder.aims),
        skyway.settings,
        proof_wait=PROOF_ARRIVES.span(clock),
    )
    if remainder.given_up is not None:
        terms = replace(terms, returned=anchor.carried)
    steps: tuple[FlightStep, ...] = flight_steps(
        skyway.network,
        list(_placed(record, remainder, anchor, link)),
        terms=terms,
        first_step=anchor.first_step,
    )
    if trouble.land_at is not None:
        steps = (*steps, _wait_for_operator(steps, anchor=anchor))
    elif not steps:
        # The drone is home and charged. It needs one last step to end the mission.
        start_ms = remainder.trip.start_ms
        steps = (finished_wait(anchor.station_id, start_ms, step_id=anchor.first_step),)
    mission = next_revision(
        record,
        remainder.trip,
        world,
        revision=case.situation.sent_revisions + 1,
        energy_margin=case.energy_margin,
    ).model_copy(update={"given_up": remainder.given_up})
    if remainder.given_up is not None:
        # Packages that are left behind do not arrive, so they have no arrival time.
        arriving = [each for each in mission.packages if each.package_id not in anchor.carried]
        mission = mission.model_copy(update={"packages": tuple(arriving)})
    if trouble.loaded is not None:
        mission = mission.model_copy(update={"loading": "CONFIRMED"})
    return Revision(mission, steps, remainder.aims)


def _wait_for_operator(steps: tuple[FlightStep, ...], *, anchor: Anchor) -> WaitStep:
    """A wait that an operator's command ends; a hold would keep the drone from flying there."""
    station_id = anchor.station_id
    if steps:
        last = steps[-1]
        station_id = last.to_id if isinstance(last, FlyStep) else last.station_id
    start_at = steps[-1].planned_end_at if steps else ms_to_moment(anchor.at_ms)
    return WaitStep(
        step_id=anchor.first_step + len(steps),
        planned_start_at=start_at,
        planned_end_at=start_at + _LONGEST_WAIT,
        station_id=station_id,
        until_at=start_at + _LONGEST_WAIT,
    )


def _placed(
    record: MissionRecord, remainder: Remainder, anchor: Anchor, link: DroneLink
) -> Iterator[PlacedStep]:
    """The trip's steps; a PICK_UP of the load on board only for a drone that has forgotten it."""
    knows_its_load = anchor.carried and not (
        record.stuck is not None and _has_forgotten_its_load(link, anchor.carried)
    )
    for placed in remainder.trip.steps():
        if not (knows_its_load and isinstance(placed.step, PickUp)):
            yield placed


def _has_forgotten_its_load(link: DroneLink, carried: frozenset[PackageId]) -> bool:
    """Whether the drone wrongly reports an empty load, and none of its events is missing."""
    state = link.state
    if state is None or state.last_event_seq < link.last_event_seq:
        return False
    return carried.isdisjoint(state.package_ids)
