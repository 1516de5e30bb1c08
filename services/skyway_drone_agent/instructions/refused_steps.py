"""Why a drone refuses new steps: it cannot be where they begin, carry the load, or fly so far."""

from datetime import datetime

from skyway.contracts.drone_report import RefusalCode
from skyway.contracts.flight_step import FlightStep, FlyStep, PickUpStep
from skyway.contracts.instruction import MissionInstruction
from skyway.drone.model import DroneModel
from skyway.ids import StationId
from skyway_drone_agent.flying.energy_check import shortfall_of
from skyway_drone_agent.instructions.mission_form import fault_in, heaviest_load_kg
from skyway_drone_agent.instructions.refusal import Refusal
from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.journal.revision import Revision, cuts_step_under_way, kept_steps
from skyway_drone_agent.journal.step_places import end_of, start_of
from skyway_drone_agent.journal.under_way import run_to_cut
from skyway_drone_agent.vehicles.vehicle import Vehicle

#: A load above the limit by less than this is rounding.
_MASS_TOLERANCE_KG = 1e-9


def not_these_steps(
    revision: Revision,
    logbook: Logbook,
    *,
    vehicle: Vehicle,
    now: datetime,
    consumption_factor: float,
) -> Refusal | None:
    """The first reason against these steps after those that are kept; None when there is none.

    People who override a failsafe in the air know how much is left, and say so.
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
            consumption_factor=consumption_factor,
            first_step=revision.first_step,
        )
    )


def _soc_before(revision: Revision, logbook: Logbook, *, vehicle: Vehicle, now: datetime) -> float:
    """The charge from which the steps are flown: what a cut recharge has given counts."""
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
    fault = fault_in(
        steps,
        first_step=kept[0].step_id if kept else first_step,
        packages=logbook.packages,
    )
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
    consumption_factor: float,
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
        consumption_factor=consumption_factor,
        # A flight that is kept is not flown the less if what follows it is refused.
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
