"""Why a drone refuses an instruction, the first reason that holds."""

from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from skyway.contracts.drone_report import RefusalCode
from skyway.contracts.flight_step import FlightStep
from skyway.contracts.instruction import (
    CancelInstruction,
    MissionInstruction,
    ReportInstruction,
)
from skyway.contracts.message import utc_text
from skyway.drone.model import DroneModel
from skyway.ids import StationId
from skyway_drone_agent.energy_check import shortfall_of
from skyway_drone_agent.logbook import Logbook, steps_kept
from skyway_drone_agent.mission_form import fault_in, heaviest_load_kg
from skyway_drone_agent.step_places import end_of, start_of

#: A load above the limit by less than this is rounding.
_MASS_TOLERANCE_KG = 1e-9


@dataclass(frozen=True, slots=True)
class Refusal:
    """A code of the contract, the same as a sentence, and the numbers behind it."""

    code: RefusalCode
    detail: str
    data: dict[str, Any] = field(default_factory=dict)  # whatever the code needs


def refusal_of(
    instruction: MissionInstruction | CancelInstruction | ReportInstruction,
    logbook: Logbook,
    *,
    model: DroneModel,
    now: datetime,
) -> Refusal | None:
    """Why the drone will not do this; None when it will."""
    if now > instruction.expires_at:
        detail = f"expired at {utc_text(instruction.expires_at)}, it is {utc_text(now)}"
        return Refusal(RefusalCode.EXPIRED, detail)
    match instruction:
        case MissionInstruction():
            return _not_this_revision(instruction, logbook) or _not_these_steps(
                instruction, logbook, model=model
            )
        case CancelInstruction():
            return _no_way_back(instruction, logbook)
        case ReportInstruction():
            return None


def _not_this_revision(instruction: MissionInstruction, logbook: Logbook) -> Refusal | None:
    mission = logbook.mission
    if instruction.mission_id in logbook.ended_mission_ids:
        return Refusal(RefusalCode.STALE_REVISION, f"{instruction.mission_id} is over")
    if mission is None:
        return None
    if instruction.mission_id != mission.mission_id:
        return Refusal(
            RefusalCode.OTHER_MISSION_ACTIVE,
            f"{mission.mission_id} is not over",
            {"mission_id": mission.mission_id},
        )
    if instruction.mission_revision <= mission.revision:
        return Refusal(
            RefusalCode.STALE_REVISION,
            f"revision {instruction.mission_revision} is not after revision {mission.revision}",
            {"mission_revision": mission.revision},
        )
    if instruction.first_step <= mission.released_through:
        return Refusal(
            RefusalCode.STEP_RELEASED,
            f"step {instruction.first_step} is released, as all through {mission.released_through}",
            {"released_through": mission.released_through},
        )
    return None


def _not_these_steps(
    instruction: MissionInstruction, logbook: Logbook, *, model: DroneModel
) -> Refusal | None:
    kept = steps_kept(logbook.mission, instruction.first_step)
    flown = (*kept, *instruction.steps)
    first_step = kept[0].step_id if kept else instruction.first_step
    return (
        _not_at_start(instruction, _place_after(kept, logbook))
        or _not_well_formed(flown, logbook, first_step=first_step)
        or _too_heavy(flown, logbook, model=model)
        or _too_far(flown, logbook, model=model)
    )


def _place_after(kept: tuple[FlightStep, ...], logbook: Logbook) -> StationId | None:
    return end_of(kept[-1]) if kept else logbook.station_id


def _not_at_start(instruction: MissionInstruction, place: StationId | None) -> Refusal | None:
    start = start_of(instruction.steps[0])
    if start == place:
        return None
    detail = f"step {instruction.first_step} begins at {start}, the drone will be at {place}"
    return Refusal(RefusalCode.NOT_AT_START, detail, {"station_id": place})


def _not_well_formed(
    steps: tuple[FlightStep, ...], logbook: Logbook, *, first_step: int
) -> Refusal | None:
    fault = fault_in(steps, first_step=first_step, packages=logbook.packages)
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
    steps: tuple[FlightStep, ...], logbook: Logbook, *, model: DroneModel
) -> Refusal | None:
    shortfall = shortfall_of(steps, model=model, soc=logbook.soc, packages=logbook.packages)
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


def _no_way_back(instruction: CancelInstruction, logbook: Logbook) -> Refusal | None:
    mission = logbook.mission
    if instruction.mission_id in logbook.ended_mission_ids:
        return Refusal(RefusalCode.STALE_REVISION, f"{instruction.mission_id} is over")
    if mission is None or mission.mission_id != instruction.mission_id:
        return None  # what is not there is forgotten already
    # After a failure, or between two steps with nothing on board, it can leave it at that.
    stands = logbook.station_id is not None and mission.began_at is None
    can_stop = mission.has_failed or (stands and not logbook.packages)
    if mission.released_through >= mission.first_step and not can_stop:
        detail = f"steps through {mission.released_through} are released"
        return Refusal(
            RefusalCode.STEP_RELEASED, detail, {"released_through": mission.released_through}
        )
    return None
