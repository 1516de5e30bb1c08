"""Why a drone refuses an instruction: the first reason that holds."""

from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from skyway.contracts.drone_report import Failsafe
from skyway.contracts.flight_step import (
    DeliverStep,
    FlightStep,
    FlyStep,
    PickUpStep,
    end_of,
    packages_of,
)
from skyway.contracts.instruction import (
    AnyInstruction,
    CancelInstruction,
    DivertInstruction,
    HandOverInstruction,
    HoldInstruction,
    MissionInstruction,
    RefusalCode,
    ReportInstruction,
    ResumeInstruction,
    ReturnHomeInstruction,
)
from skyway.contracts.message import utc_text
from skyway.drone.model import DroneModel
from skyway.ids import StationId
from skyway_drone_agent.failsafes.failsafe import Situation, severest
from skyway_drone_agent.flying.step_checks import fault_in, heaviest_load_kg, shortfall_of
from skyway_drone_agent.journal.logbook import (
    CurrentMission,
    Logbook,
    run_to_cut,
    run_under_way,
    start_of,
)
from skyway_drone_agent.journal.mission_changes import (
    CUTTABLE,
    Revision,
    can_be_called_off,
    cuts_step_under_way,
    kept_steps,
)
from skyway_drone_agent.vehicle import EnergyUse, Vehicle, wait_ends_at


@dataclass(frozen=True, slots=True)
class Refusal:
    """A code of the contract, a sentence, and the numbers behind it."""

    code: RefusalCode
    detail: str
    data: dict[str, Any] = field(default_factory=dict)  # numbers and names that belong to the code


#: Failsafes that keep a drone on the ground.
_GROUNDED = (Failsafe.STAY, Failsafe.LAND_AT_NEXT)

#: A load above the limit by less than this is rounding.
_MASS_TOLERANCE_KG = 1e-9


def _not_these_steps(
    revision: Revision,
    logbook: Logbook,
    *,
    vehicle: Vehicle,
    now: datetime,
    energy_use: EnergyUse,
) -> Refusal | None:
    """The first reason against the new steps after the kept steps; None without a reason.

    People who override a failsafe in the air have judged the charge themselves.
    """
    kept = kept_steps(logbook.mission, revision)
    flown = (*kept, *revision.steps)
    soc = _soc_before(revision, logbook, vehicle=vehicle, now=now)
    return (
        _not_awaited(revision, logbook)
        or _not_at_start(revision, _place_after(kept, logbook))
        or _not_well_formed(flown, logbook, kept=kept, first_step=revision.first_step)
        or _too_heavy(flown, logbook, model=vehicle.model)
        or _too_far(
            flown,
            logbook,
            model=vehicle.model,
            soc=soc,
            energy_use=energy_use,
            first_step=revision.first_step,
        )
    )


def _soc_before(revision: Revision, logbook: Logbook, *, vehicle: Vehicle, now: datetime) -> float:
    """The charge before the new steps, with the charge gained in a recharge that is cut."""
    mission = logbook.mission
    if mission is None:
        return logbook.soc
    cut = mission.cut
    if cuts_step_under_way(mission, revision):
        cut = mission.cut_of_step_under_way(now)
    return logbook.soc if cut is None else vehicle.cut(run_to_cut(logbook, cut), cut.cut_at).soc


def _not_awaited(revision: Revision, logbook: Logbook) -> Refusal | None:
    if not isinstance(revision, MissionInstruction) or revision.loaded is None:
        return None
    step = logbook.mission.step_under_way if logbook.mission else None
    if isinstance(step, PickUpStep) and step.awaits_confirmation:
        return None
    return Refusal(RefusalCode.MALFORMED, "loaded: no PICK_UP under way awaits it")


def _place_after(kept: tuple[FlightStep, ...], logbook: Logbook) -> StationId | None:
    if kept:
        return end_of(kept[-1])
    mission = logbook.mission
    if logbook.is_airborne and mission is not None:
        # Over a station, between two flights.
        return start_of(mission.steps[0])
    return logbook.station_id


def _not_at_start(revision: Revision, place: StationId | None) -> Refusal | None:
    start = start_of(revision.steps[0])
    if start == place:
        return None
    detail = f"step {revision.first_step} begins at {start}, the drone will be at {place}"
    return Refusal(RefusalCode.NOT_AT_START, detail, {"station_id": place})


def _not_well_formed(
    steps: tuple[FlightStep, ...],
    logbook: Logbook,
    *,
    kept: tuple[FlightStep, ...],
    first_step: int,
) -> Refusal | None:
    if logbook.is_airborne and not isinstance(steps[0], FlyStep):
        return Refusal(RefusalCode.MALFORMED, f"step {first_step} needs a landing before")
    first = kept[0].step_id if kept else first_step
    fault = fault_in(steps, first_step=first, packages=logbook.packages)
    return None if fault is None else Refusal(RefusalCode.MALFORMED, fault)


def _too_heavy(
    steps: tuple[FlightStep, ...], logbook: Logbook, *, model: DroneModel
) -> Refusal | None:
    mass_kg = heaviest_load_kg(steps, logbook.packages)
    if mass_kg <= model.max_payload_kg + _MASS_TOLERANCE_KG:
        return None
    return Refusal(
        RefusalCode.OVERWEIGHT,
        f"payload {mass_kg:g} kg exceeds the {model.max_payload_kg:g} kg limit of {model.model_id}",
        {"mass_kg": mass_kg, "limit_kg": model.max_payload_kg},
    )


def _too_far(
    steps: tuple[FlightStep, ...],
    logbook: Logbook,
    *,
    model: DroneModel,
    soc: float,
    energy_use: EnergyUse,
    first_step: int,
) -> Refusal | None:
    mission = logbook.mission
    if logbook.is_airborne and mission is not None and mission.ignored_faults:
        return None
    shortfall = shortfall_of(
        steps,
        model=model,
        soc=soc,
        packages=logbook.packages,
        energy_use=energy_use,
        # A kept flight is flown even if the steps after it are refused.
        judged_from=first_step,
    )
    if shortfall is None:
        return None
    return Refusal(
        RefusalCode.INSUFFICIENT_ENERGY,
        f"the stretch with step {shortfall.step.step_id} needs {shortfall.need_j:.0f} J, "
        f"{shortfall.have_j:.0f} J are above the reserve",
        {
            "need_j": shortfall.need_j,
            "have_j": shortfall.have_j,
            "step_id": shortfall.step.step_id,
        },
    )


def refusal_of(
    instruction: AnyInstruction,
    logbook: Logbook,
    *,
    vehicle: Vehicle,
    now: datetime,
    energy_use: EnergyUse,
) -> Refusal | None:
    """Why the drone refuses the instruction; None when it accepts."""
    if now > instruction.expires_at:
        detail = f"expired at {utc_text(instruction.expires_at)}, it is {utc_text(now)}"
        return Refusal(RefusalCode.EXPIRED, detail)
    match instruction:
        case MissionInstruction() | DivertInstruction() | ReturnHomeInstruction():
            return (
                _not_this_revision(instruction, logbook)
                or _failsafe_against(instruction, logbook)
                or _not_these_steps(
                    instruction,
                    logbook,
                    vehicle=vehicle,
                    now=now,
                    energy_use=energy_use,
                )
            )
        case HoldInstruction() | ResumeInstruction():
            return _not_flown(instruction, logbook)
        case HandOverInstruction():
            return _no_proof_awaited(instruction, logbook, now=now)
        case CancelInstruction():
            return _no_way_back(instruction, logbook)
        case ReportInstruction():
            return None


def _not_this_revision(instruction: Revision, logbook: Logbook) -> Refusal | None:
    mission = logbook.mission
    if mission is None and isinstance(instruction, MissionInstruction):
        return _is_over(instruction, logbook)
    if mission is not None and instruction.mission_id != mission.mission_id:
        return _is_over(instruction, logbook) or Refusal(
            RefusalCode.OTHER_MISSION_ACTIVE,
            f"{mission.mission_id} is not over",
            {"mission_id": mission.mission_id},
        )
    if mission is None or mission.is_called_off:
        return _not_flown(instruction, logbook)
    if instruction.mission_revision <= mission.revision:
        return Refusal(
            RefusalCode.STALE_REVISION,
            f"revision {instruction.mission_revision} is not after revision {mission.revision}",
            {"mission_revision": mission.revision},
        )
    return _released(instruction, mission)


def _released(instruction: Revision, mission: CurrentMission) -> Refusal | None:
    """Refuse to replace an ended step, or a step under way that cannot end immediately."""
    if isinstance(instruction, MissionInstruction) or mission.has_failed:
        first_free = mission.released_through + 1
    elif mission.step_under_way is None or isinstance(mission.step_under_way, CUTTABLE):
        first_free = mission.next_step_id
    else:
        first_free = mission.next_step_id + 1
    if instruction.first_step >= first_free:
        return None
    return Refusal(
        RefusalCode.STEP_RELEASED,
        f"step {instruction.first_step} is released, {first_free} is the first that may change",
        {"released_through": mission.released_through, "step_id": mission.next_step_id},
    )


def _is_over(instruction: Revision | CancelInstruction, logbook: Logbook) -> Refusal | None:
    if instruction.mission_id not in logbook.ended_mission_ids:
        return None
    return Refusal(RefusalCode.STALE_REVISION, f"{instruction.mission_id} is over")


def _not_flown(
    instruction: Revision | HoldInstruction | ResumeInstruction, logbook: Logbook
) -> Refusal | None:
    mission = logbook.mission
    if mission is None or mission.mission_id != instruction.mission_id:
        return Refusal(RefusalCode.STALE_REVISION, f"{instruction.mission_id} is not flown")
    if mission.is_called_off:
        return Refusal(RefusalCode.STALE_REVISION, f"{instruction.mission_id} is called off")
    return None


def _no_proof_awaited(
    instruction: HandOverInstruction, logbook: Logbook, *, now: datetime
) -> Refusal | None:
    """Why these packages are not handed over now; None if the drone waits for a proof of one."""
    mission, run = logbook.mission, run_under_way(logbook)
    if mission is None or mission.mission_id != instruction.mission_id or run is None:
        return Refusal(RefusalCode.NOT_AWAITED, f"{instruction.mission_id} waits for no proof")
    step = run.step
    named = {*instruction.package_ids}
    is_step = isinstance(step, DeliverStep) and step.step_id == instruction.step_id
    if not is_step or not named <= {*packages_of(step)}:
        return Refusal(RefusalCode.NOT_AWAITED, f"step {instruction.step_id} is not under way")
    until_at = wait_ends_at(run)
    if until_at is None or now > until_at:
        detail = f"step {instruction.step_id} waits for no proof any more"
        return Refusal(RefusalCode.NOT_AWAITED, detail)
    return None


def _no_way_back(instruction: CancelInstruction, logbook: Logbook) -> Refusal | None:
    mission = logbook.mission
    if mission is None or mission.mission_id != instruction.mission_id:
        # The drone does not have this mission: there is nothing to cancel.
        return _is_over(instruction, logbook)
    can_stop = can_be_called_off(
        mission, is_airborne=logbook.is_airborne, is_loaded=bool(logbook.packages)
    )
    if can_stop:
        return None
    detail = f"steps through {mission.released_through} are released"
    data = {"released_through": mission.released_through}
    return Refusal(RefusalCode.STEP_RELEASED, detail, data)


def _failsafe_against(revision: Revision, logbook: Logbook) -> Refusal | None:
    """Why a drone whose failsafe acts refuses new steps; None when no failsafe does."""
    mission = logbook.mission
    if mission is not None and mission.escape is not None:
        escape = mission.escape
        detail = f"{escape.failsafe.value} for {escape.fault.value} is under way"
        return Refusal(RefusalCode.FAILSAFE_ACTIVE, detail, {"fault": escape.fault.value})
    acting = severest(Situation.STANDING, logbook.faults) if mission is None else None
    if acting is None or acting[1] not in _GROUNDED:
        return None
    fault, failsafe = acting
    detail = f"{failsafe.value} for {fault.value}: the drone does not take off"
    return Refusal(RefusalCode.FAILSAFE_ACTIVE, detail, {"fault": fault.value})
