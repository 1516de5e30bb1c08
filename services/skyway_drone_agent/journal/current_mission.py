"""The accepted mission: the steps that are left, and the step under way."""

from pydantic import Field

from skyway.contracts.drone_health import Failsafe, Fault
from skyway.contracts.flight_step import FlightStep, FlyStep, PickUpStep
from skyway.contracts.message import FleetMoment
from skyway.ids import DeliveryId, MissionId, StationId
from skyway.json_model import WireModel
from skyway_drone_agent.journal.records import ACCEPTANCE_SENT_AT, Answer


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
    acceptance_sent_at: FleetMoment | None = Field(
        default=None, validation_alias=ACCEPTANCE_SENT_AT
    )
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


def end_of(step: FlightStep) -> StationId:
    """The station where the drone stands, or which it flies over, after this step."""
    return step.to_id if isinstance(step, FlyStep) else step.station_id
