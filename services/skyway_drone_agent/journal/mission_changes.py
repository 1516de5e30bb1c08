"""What a mission becomes after new steps, a cancel, or the escape of a failsafe."""

from collections.abc import Collection
from datetime import datetime, timedelta
from typing import Final, Protocol

from skyway.contracts.drone_report import Failsafe
from skyway.contracts.flight_step import (
    DeliverStep,
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
from skyway.drone.flight import flight_time_s
from skyway.drone.model import DroneModel
from skyway.geo import Position, distance_m
from skyway.ids import PackageId, StationId
from skyway_drone_agent.journal.logbook import CurrentMission, Escape, FlownBefore
from skyway_drone_agent.journal.records import Answer, FailsafeBegun, FailsafeOverridden

#: Steps that can end at any moment, because the drone does not move in them.
CUTTABLE: Final = (WaitStep, RechargeStep, PickUpStep)

#: Instructions with steps. A MISSION replaces only steps that are not released yet.
Revision = MissionInstruction | DivertInstruction | ReturnHomeInstruction

#: Metres of a flight that ends where it begins; a flight has a length above 0.
_ON_THE_SPOT_M = 0.001


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


def with_proofs(
    mission: CurrentMission, package_ids: Collection[PackageId], *, at: datetime
) -> CurrentMission:
    """The mission once the proofs of these packages are there, for the DELIVER under way."""
    step, *later = mission.steps
    if not isinstance(step, DeliverStep):
        return mission
    steps = (step.proven(package_ids), *later)
    return mission.model_copy(update={"steps": steps, "changed_at": at})


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


class Place(Protocol):
    """A station and where it is."""

    @property
    def station_id(self) -> StationId:
        """The station's id."""
        ...

    @property
    def position(self) -> Position:
        """The station's position."""
        ...


def flight_to(
    landing: Place,
    *,
    instead_of: FlyStep,
    here: Position,
    at: datetime,
    model: DroneModel,
    load_kg: float,
) -> FlyStep:
    """The flight straight from here to a landing."""
    length_m = max(distance_m(here, landing.position), _ON_THE_SPOT_M)
    flight_s = flight_time_s(model, length_m=length_m, load_kg=load_kg) + model.stop_s
    return instead_of.model_copy(
        update={
            "planned_start_at": at,
            "planned_end_at": at + timedelta(seconds=flight_s),
            "to_id": landing.station_id,
            "from_position": here,
            "to_position": landing.position,
            "length_m": length_m,
            "lands": True,
        }
    )


def descent(*, instead_of: FlyStep, here: Position, at: datetime, model: DroneModel) -> FlyStep:
    """A flight straight down; its station ids have no meaning."""
    return instead_of.model_copy(
        update={
            "planned_start_at": at,
            "planned_end_at": at + timedelta(seconds=model.stop_s),
            "from_position": here,
            "to_position": here,
            "length_m": _ON_THE_SPOT_M,
            "lands": True,
        }
    )


def flight_resumed(escape: Escape, *, here: Position) -> FlyStep:
    """The flight that was planned before the escape, from here."""
    planned = escape.instead_of
    length_m = max(distance_m(here, planned.to_position), _ON_THE_SPOT_M)
    return planned.model_copy(update={"from_position": here, "length_m": length_m})


def mission_escaping(mission: CurrentMission, begun: FailsafeBegun) -> CurrentMission:
    """The mission after a failsafe turned its flight; no later step stays released."""
    instead_of = mission.escape.instead_of if mission.escape else mission.steps[0]
    if not isinstance(instead_of, FlyStep):
        return mission
    turned = _turned(mission, begun.flight, at=begun.at, used_j=begun.used_j)
    escape = Escape(fault=begun.fault, failsafe=begun.failsafe, instead_of=instead_of)
    return turned.model_copy(
        update={"escape": escape, "released_through": begun.flight.step_id, "changed_at": None}
    )


def mission_overridden(mission: CurrentMission, overridden: FailsafeOverridden) -> CurrentMission:
    """The mission once people have overridden its failsafe."""
    ignored = tuple(dict.fromkeys((*mission.ignored_faults, *overridden.faults)))
    mission = mission.model_copy(update={"ignored_faults": ignored})
    if mission.escape is None or overridden.flight is None:
        return mission
    resumed = _turned(mission, overridden.flight, at=overridden.at, used_j=overridden.used_j)
    landing = next(step for step in resumed.steps if isinstance(step, FlyStep) and step.lands)
    return resumed.model_copy(update={"escape": None, "released_through": landing.step_id})


def lands_on_the_spot(mission: CurrentMission) -> bool:
    """Whether the flight under way goes straight down."""
    return mission.escape is not None and mission.escape.failsafe is Failsafe.LAND_NOW


def _turned(
    mission: CurrentMission, flight: FlyStep, *, at: datetime, used_j: float
) -> CurrentMission:
    """The mission with this flight instead of the one under way."""
    before = mission.flown_before or FlownBefore(since=mission.began_at or at, used_j=0.0)
    flown_before = before.model_copy(update={"used_j": before.used_j + used_j})
    steps = (flight, *mission.steps[1:])
    return mission.model_copy(update={"steps": steps, "began_at": at, "flown_before": flown_before})
