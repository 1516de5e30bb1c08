"""The logbook: the sum of the journal's records, with the accepted mission and what is left of it.

It also says what the drone does now.
"""

from itertools import pairwise
from typing import Final, Self

from pydantic import Field

from skyway.contracts.drone_report import DroneEvent, Failsafe, Fault
from skyway.contracts.flight_step import FlightStep, FlyStep, PackageOnBoard, PickUpStep
from skyway.contracts.message import FleetMoment, Soc
from skyway.geo import Position
from skyway.ids import DeliveryId, MissionId, StationId
from skyway.json_model import WireModel
from skyway_drone_agent.journal.records import Answer
from skyway_drone_agent.vehicle import Standing, StepRun

#: Number of ended missions that are remembered, to refuse late revisions of them.
_ENDED_MISSIONS_KEPT: Final = 16


class CutStep(WireModel):
    """A step that an instruction ends early; `revision` is the revision of that step."""

    step: FlightStep
    began_at: FleetMoment
    cut_at: FleetMoment
    revision: int


class Escape(WireModel):
    """Why the flight under way differs from the plan; `instead_of` is the planned flight."""

    fault: Fault
    failsafe: Failsafe
    instead_of: FlyStep

    def leads_back(self, flight: FlyStep) -> bool:
        """Whether this flight corrects the course: it lands where the planned flight lands."""
        has_left_course = (self.fault, self.failsafe) == (Fault.GEOFENCE, Failsafe.DIVERT)
        return has_left_course and self.instead_of.lands and flight.to_id == self.instead_of.to_id


class FlownBefore(WireModel):
    """The part of a flight that was flown before a failsafe turned it."""

    since: FleetMoment
    used_j: float


class CurrentMission(WireModel):
    """The accepted mission: the steps that have not ended, and where the drone is in them.

    `expires_at` is that of the accepted instruction. `acceptance_sent_at` is when the broker
    confirmed its ACCEPTED.
    `first_step` is that of the whole mission, not of the revision. `free_at` is when the last step
    ended. `began_at` is when the first of `steps` began, or None. `changed_at` is when an
    instruction last changed that step. After a failure the drone waits for a new revision. A
    mission that `is_called_off` is dropped once the drone stands.

    During an `escape` the first of `steps` is the flight of the failsafe. A turned flight starts
    again in the air; `flown_before` is the part that was flown until then.
    """

    mission_id: MissionId
    revision: int
    delivery_id: DeliveryId
    accepted_by: Answer
    expires_at: FleetMoment
    acceptance_sent_at: FleetMoment | None = None
    first_step: int
    steps: tuple[FlightStep, ...]
    released_through: int
    free_at: FleetMoment
    began_at: FleetMoment | None = None
    changed_at: FleetMoment | None = None
    cut: CutStep | None = None
    escape: Escape | None = None
    flown_before: FlownBefore | None = None
    ignored_faults: tuple[Fault, ...] = ()
    has_failed: bool = False
    is_held: bool = False
    is_called_off: bool = False

    @property
    def step_under_way(self) -> FlightStep | None:
        """The step that has begun and goes on."""
        return self.steps[0] if self.began_at is not None else None

    @property
    def has_expired(self) -> bool:
        """Whether the acceptance came too late to load: the cloud may have sent another drone."""
        if self.acceptance_sent_at is None or self.began_at is not None or self.has_failed:
            return False
        is_next = bool(self.steps) and isinstance(self.steps[0], PickUpStep)
        return is_next and self.acceptance_sent_at > self.expires_at

    @property
    def next_step_id(self) -> int:
        """The first step that has not ended."""
        return self.steps[0].step_id if self.steps else self.released_through + 1

    def cut_of_step_under_way(self, at: FleetMoment) -> CutStep | None:
        """The step under way as it is cut at this moment, or the step that is already cut."""
        if self.began_at is None:
            return self.cut
        return CutStep(
            step=self.steps[0], began_at=self.began_at, cut_at=at, revision=self.revision
        )


def start_of(step: FlightStep) -> StationId:
    """The station at which the drone must be for this step."""
    return step.from_id if isinstance(step, FlyStep) else step.station_id


class Logbook(WireModel):
    """Everything that a drone needs after a restart.

    `station_id` is None in the air, and when the drone is down, which means away from every
    station. `faults` are the current faults with an alarm. `state_of_health` is the last estimate
    of the battery's capacity, as a share of the capacity when new. `first_session` is the session
    in which the journal was begun, 0 before the first start.
    """

    session: int = 0
    first_session: int = 0
    stream: int = 0
    last_instruction_seq: int = 0
    answers: tuple[Answer, ...] = ()
    last_event_seq: int = 0
    events: tuple[DroneEvent, ...] = Field(default=(), description="not confirmed by the cloud")
    mission: CurrentMission | None = None
    ended_mission_ids: tuple[MissionId, ...] = ()
    station_id: StationId | None
    position: Position
    soc: Soc
    packages: tuple[PackageOnBoard, ...] = ()
    is_down: bool = False
    faults: tuple[Fault, ...] = ()
    state_of_health: Soc = 1.0

    @property
    def is_airborne(self) -> bool:
        """Whether the drone flies."""
        return self.station_id is None and not self.is_down

    @property
    def load_kg(self) -> float:
        """The mass of all packages on board."""
        return sum(package.mass_kg for package in self.packages)

    def begun_anew(self, *, at_first: Self) -> Self:
        """The logbook of a drone that has lost its journal after this one.

        On the ground it still has its place and its charge; in the air it is as `at_first`.
        """
        known = {"session": self.session}
        if self.station_id is None:
            return at_first.model_copy(update=known)
        place = {name: getattr(self, name) for name in ("station_id", "position", "soc")}
        return at_first.model_copy(update=known | place)

    def without_mission(self) -> Self:
        """The logbook after its mission, if it has one.

        Packages on board are stranded: they stay at the station where the drone stands. A drone
        that is down keeps them on board until people come.
        """
        if self.mission is None:
            return self
        ended = (*self.ended_mission_ids, self.mission.mission_id)[-_ENDED_MISSIONS_KEPT:]
        packages = self.packages if self.is_down else ()
        return self.model_copy(
            update={"mission": None, "ended_mission_ids": ended, "packages": packages}
        )


def doing_now(logbook: Logbook) -> StepRun | Standing:
    """The step under way, or where the drone stands."""
    run = run_under_way(logbook)
    return run or Standing(logbook.position, logbook.soc, logbook.load_kg)


def run_under_way(logbook: Logbook) -> StepRun | None:
    """The step that has begun and not ended, also after a restart; None without one."""
    mission = logbook.mission
    if mission is None or mission.began_at is None:
        return None
    return StepRun(
        step=mission.steps[0],
        started_at=mission.began_at,
        soc=logbook.soc,
        load_kg=logbook.load_kg,
        position=logbook.position,
        changed_at=mission.changed_at,
        onward=_onward(mission.steps),
    )


def run_to_cut(logbook: Logbook, cut: CutStep) -> StepRun:
    """The step that an instruction has cut and whose end is not written yet."""
    return StepRun(cut.step, cut.began_at, logbook.soc, logbook.load_kg, logbook.position)


def _onward(steps: tuple[FlightStep, ...]) -> tuple[FlyStep, ...]:
    """The flights after the first step, up to the flight that lands."""
    onward: list[FlyStep] = []
    for step, after in pairwise(steps):
        if not isinstance(step, FlyStep) or step.lands or not isinstance(after, FlyStep):
            break
        onward.append(after)
    return tuple(onward)
