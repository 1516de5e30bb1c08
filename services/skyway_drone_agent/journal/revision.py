"""What a mission is after the drone has accepted new steps, or a cancel."""

from datetime import datetime
from typing import Final

from skyway.contracts.flight_step import (
    FlightStep,
    FlyStep,
    PackageOnBoard,
    PickUpStep,
    RechargeStep,
    WaitStep,
)
from skyway.contracts.instruction import (
    DivertInstruction,
    MissionInstruction,
    ReturnHomeInstruction,
)
from skyway_drone_agent.journal.current_mission import CurrentMission
from skyway_drone_agent.journal.records import Answer

#: Steps that can end at any moment, because the drone does not move in them.
CUTTABLE: Final = (WaitStep, RechargeStep, PickUpStep)

#: Instructions with steps. A MISSION replaces only steps that are not released yet.
Revision = MissionInstruction | DivertInstruction | ReturnHomeInstruction


def kept_steps(mission: CurrentMission | None, revision: Revision) -> tuple[FlightStep, ...]:
    """The steps that are left before the first step of a revision, as the revision changes them.

    There are none after a failure: the drone stands and waits for new steps.
    """
    if mission is None or mission.has_failed:
        return ()
    kept = tuple(step for step in mission.steps if step.step_id < revision.first_step)
    if not isinstance(revision, MissionInstruction):
        return _joined(kept, revision.steps[0])
    if revision.loaded is None:
        return kept
    return tuple(_loaded(step, revision.loaded) for step in kept)


def cuts_step_under_way(mission: CurrentMission, revision: Revision) -> bool:
    """Whether the revision replaces the step under way."""
    step = mission.step_under_way
    return step is not None and step.step_id >= revision.first_step


def mission_after(
    before: CurrentMission | None,
    revision: Revision,
    *,
    answer: Answer,
    at: datetime,
    is_airborne: bool,
) -> CurrentMission:
    """The mission after this revision is accepted; a revision ends a hold."""
    kept = kept_steps(before, revision)
    accepted = CurrentMission(
        mission_id=revision.mission_id,
        revision=revision.mission_revision,
        delivery_id=revision.delivery_id,
        accepted_by=answer,
        expires_at=revision.expires_at,
        first_step=revision.first_step,
        steps=(*kept, *revision.steps),
        released_through=revision.first_step - 1,
        free_at=at,
    )
    if before is None:
        return accepted
    accepted = accepted.model_copy(
        update={
            "first_step": before.first_step,
            "released_through": _released_through(before, accepted, is_airborne=is_airborne),
            # A drone in the air cannot stand still.
            "free_at": before.free_at if is_airborne else max(at, before.free_at),
            "cut": before.cut,
            "ignored_faults": before.ignored_faults,
        }
    )
    if cuts_step_under_way(before, revision):
        return accepted.model_copy(update={"cut": before.cut_of_step_under_way(at)})
    is_changed = kept[:1] != before.steps[:1]
    changed_at = at if before.began_at is not None and is_changed else before.changed_at
    return accepted.model_copy(
        update={
            "began_at": before.began_at,
            "changed_at": changed_at,
            "flown_before": before.flown_before,
        }
    )


def _released_through(
    before: CurrentMission, accepted: CurrentMission, *, is_airborne: bool
) -> int:
    """In the air, the step of the next landing, which may have changed."""
    if is_airborne:
        return next(
            step.step_id for step in accepted.steps if isinstance(step, FlyStep) and step.lands
        )
    return min(before.released_through, accepted.released_through)


def _joined(kept: tuple[FlightStep, ...], following: FlightStep) -> tuple[FlightStep, ...]:
    """The kept steps; their last flight lands unless another flight follows."""
    if not kept or not isinstance(kept[-1], FlyStep):
        return kept
    lands = not isinstance(following, FlyStep)
    return (*kept[:-1], kept[-1].model_copy(update={"lands": lands}))


def _loaded(step: FlightStep, packages: tuple[PackageOnBoard, ...]) -> FlightStep:
    if not isinstance(step, PickUpStep) or not step.awaits_confirmation:
        return step
    return step.model_copy(update={"packages": packages, "awaits_confirmation": False})


def can_be_called_off(mission: CurrentMission, *, is_airborne: bool, is_loaded: bool) -> bool:
    """Whether the drone is empty and not loading, or the mission has failed."""
    if mission.has_failed or mission.released_through < mission.first_step:
        return True
    step = mission.step_under_way
    return not is_loaded and (is_airborne or step is None or _can_end_now(step))


def called_off(
    mission: CurrentMission, *, at: datetime, is_airborne: bool
) -> CurrentMission | None:
    """What remains of the mission: flights to the next landing, or a step to cut; else None."""
    if is_airborne:
        released = tuple(step for step in mission.steps if step.step_id <= mission.released_through)
        return mission.model_copy(update={"steps": released, "is_called_off": True})
    cut = mission.cut_of_step_under_way(at)
    if cut is None:
        return None
    return mission.model_copy(
        update={"steps": (), "began_at": None, "cut": cut, "is_called_off": True}
    )


def _can_end_now(step: FlightStep) -> bool:
    if isinstance(step, PickUpStep):
        return step.awaits_confirmation
    return isinstance(step, WaitStep | RechargeStep)
