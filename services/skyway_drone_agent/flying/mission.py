"""The mission: what a drone does next, decided only from its logbook and the fleet clock.

- A step begins when the step before has ended and its own planned start has come. The vehicle says
  when a step ended; the moment when this process woke does not matter.
- A drone on the ground takes off only with the energy for all flights up to the next recharge, and
  not while the link is lost.
- A drone loads only after the broker has confirmed its acceptance, and only if that was before the
  instruction expired. After that the cloud may have sent another drone.
- A drone that is held flies on to its next landing and begins no step there.

Every beginning and end is in the journal first.
"""

from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, Final

from skyway.contracts.flight_step import FlightStep, FlyStep, PickUpStep, RechargeStep
from skyway_drone_agent.flying.step_checks import as_modelled, shortfall_of, stretch_of
from skyway_drone_agent.journal.logbook import CurrentMission, Logbook, run_to_cut, run_under_way
from skyway_drone_agent.journal.mission_changes import lands_on_the_spot
from skyway_drone_agent.vehicle import EnergyUse, StepRun, Vehicle

_ALWAYS: Final = datetime.min.replace(tzinfo=UTC)


@dataclass(frozen=True, slots=True)
class Gates:
    """The fleet moments since when the drone may act; None while it may not.

    `take_off_at` is None when the link is lost for long. `loading_at` is None while the link is
    down, and until the broker has confirmed the drone's ACCEPTED. `begin_at` is None while a
    failsafe says STAY.
    """

    take_off_at: datetime | None
    loading_at: datetime | None
    begin_at: datetime | None = _ALWAYS


@dataclass(frozen=True, slots=True)
class Stand:
    """Do nothing until the moment, or until something changes."""

    until: datetime | None


@dataclass(frozen=True, slots=True)
class Begin:
    """Begin the next step; from now on steps up to `released_through` cannot be replaced."""

    step: FlightStep
    at: datetime
    released_through: int


@dataclass(frozen=True, slots=True)
class Land:
    """Land on the spot, because a failsafe says so."""

    run: StepRun


@dataclass(frozen=True, slots=True)
class Cut:
    """End a step of an earlier revision now, because new steps replace it."""

    run: StepRun
    at: datetime
    revision: int


@dataclass(frozen=True, slots=True)
class Fail:
    """Fail the next step and wait for a new revision."""

    step: FlightStep
    at: datetime
    code: str
    data: dict[str, Any] = field(default_factory=dict)  # numbers behind the code


@dataclass(frozen=True, slots=True)
class End:
    """All steps are done."""

    at: datetime


Act = Stand | Begin | StepRun | Land | Cut | Fail | End


def next_act(
    logbook: Logbook,
    *,
    vehicle: Vehicle,
    now: datetime,
    gates: Gates,
    agent_started_at: datetime,
    energy_use: EnergyUse = as_modelled,
) -> Act:
    """What to do now; a `StepRun` is a step under way, to be performed to its end."""
    mission = logbook.mission
    if mission is None:
        return Stand(until=None)
    if mission.cut is not None:
        cut = mission.cut
        return Cut(run_to_cut(logbook, cut), at=cut.cut_at, revision=cut.revision)
    if mission.has_failed:
        return Stand(until=None)
    run = run_under_way(logbook)
    if run is not None:
        return Land(run) if lands_on_the_spot(mission) else run
    if mission.steps and mission.steps[0].step_id <= mission.released_through:
        # The drone flies over a station: the flight goes on in any case.
        return Begin(mission.steps[0], mission.free_at, mission.released_through)
    if mission.is_held:
        return Stand(until=None)
    if not mission.steps:
        return End(mission.free_at)
    if gates.begin_at is None:
        return Stand(until=None)
    # No step can begin while no agent runs, so a restart may make the drone late.
    earliest = max(mission.free_at, _not_before(mission.steps[0]), agent_started_at, gates.begin_at)
    if now < earliest:
        return Stand(until=earliest)
    return _next_on_the_ground(
        logbook,
        mission,
        earliest,
        vehicle=vehicle,
        gates=gates,
        energy_use=energy_use,
    )


def _next_on_the_ground(
    logbook: Logbook,
    mission: CurrentMission,
    earliest: datetime,
    *,
    vehicle: Vehicle,
    gates: Gates,
    energy_use: EnergyUse,
) -> Act:
    step = mission.steps[0]
    match step:
        case PickUpStep():
            return _load_or_not(mission, step, earliest, gates=gates)
        case FlyStep():
            return _take_off_or_not(
                logbook,
                mission,
                earliest,
                vehicle=vehicle,
                gates=gates,
                energy_use=energy_use,
            )
        case RechargeStep() if earliest >= step.not_after_at:
            return Fail(step, earliest, code="PAD_LOST")
        case _:
            return Begin(step, earliest, step.step_id)


def _not_before(step: FlightStep) -> datetime:
    return step.not_before_at if isinstance(step, RechargeStep) else step.planned_start_at


def _load_or_not(
    mission: CurrentMission, step: PickUpStep, earliest: datetime, *, gates: Gates
) -> Act:
    if mission.acceptance_sent_at is not None and mission.has_expired:
        return Fail(step, max(earliest, mission.acceptance_sent_at), code="EXPIRED")
    if gates.loading_at is None:
        return Stand(until=None)
    return Begin(step, max(earliest, gates.loading_at), step.step_id)


def _take_off_or_not(
    logbook: Logbook,
    mission: CurrentMission,
    earliest: datetime,
    *,
    vehicle: Vehicle,
    gates: Gates,
    energy_use: EnergyUse,
) -> Act:
    if gates.take_off_at is None:
        return Stand(until=None)
    at = max(earliest, gates.take_off_at)
    shortfall = shortfall_of(
        stretch_of(mission.steps),
        model=vehicle.model,
        soc=logbook.soc,
        packages=logbook.packages,
        energy_use=energy_use,
    )
    if shortfall is not None:
        energy = {"need_j": shortfall.need_j, "have_j": shortfall.have_j}
        return Fail(mission.steps[0], at, code="INSUFFICIENT_ENERGY", data=energy)
    landing = next(step for step in mission.steps if isinstance(step, FlyStep) and step.lands)
    return Begin(mission.steps[0], at, landing.step_id)
