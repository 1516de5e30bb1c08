"""A mission as composition keeps it: what the world sees of it, and what only we need."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, Literal, TypeVar

from skyway.contracts.candidate import Candidate
from skyway.contracts.flight_step import FlightStep, PackageOnBoard
from skyway.contracts.message import Soc
from skyway.contracts.mission import LIVE_MISSION_STATES, Mission, MissionState
from skyway.delivery.request import DeliveryRequest, Package
from skyway.ids import DroneId, InstructionId, MissionId, NetworkId, PackageId, StationId
from skyway.json_model import JsonModel

_T = TypeVar("_T")

#: The codes of the troubles that an operator's RETURN_HOME and DIVERT are.
CALLED_HOME: Final = "CALLED_HOME"
DIVERTED: Final = "DIVERTED"


class OccupiedPad(JsonModel):
    """A pad that a drone found taken, and until when nobody is to be sent there."""

    station_id: StationId
    pad: int
    until_ms: int


class Stuck(JsonModel):
    """Why a drone waits for a new revision, and from where it could go on.

    New steps are numbered after `last_step`, which the drone has released. A pad that was
    `occupied` is closed for a while before anything is planned.
    """

    code: str
    detail: str
    station_id: StationId
    soc: Soc
    last_step: int
    occupied: OccupiedPad | None = None


class Trouble(JsonModel):
    """Why the plan of a mission does not hold any more, though its drone may still fly by it.

    `loaded` is what a loader has confirmed while the drone waits at the pickup; `land_at` is where
    an operator wants the drone to stand, whatever was planned. One that `overrides_failsafe` is
    obeyed whatever the drone does by itself.
    """

    code: str
    detail: str
    loaded: tuple[PackageOnBoard, ...] | None = None
    land_at: StationId | None = None
    overrides_failsafe: bool = False


class Aim(JsonModel):
    """Where a package goes instead of its destination: delivered there, or returned."""

    package_id: PackageId
    station_id: StationId
    kind: Literal["DELIVER", "RETURN"]


class Proposal(JsonModel):
    """A revision that was sent, and holds once the drone has accepted it; until then both hold.

    `steps` replace the planned ones from `first_step` on.
    """

    instruction_id: InstructionId
    first_step: int
    mission: Mission
    steps: tuple[FlightStep, ...]
    code: str
    detail: str


@dataclass(frozen=True, slots=True)
class MissionRecord:
    """A mission with its request, the drone as it was booked, and what was reported so far."""

    mission: Mission
    network_id: NetworkId
    request: DeliveryRequest
    candidate: Candidate
    expires_ms: int
    report_seq: int = 0
    reported_activity: str | None = None
    stuck: Stuck | None = None
    trouble: Trouble | None = None
    proposal: Proposal | None = None
    aims: tuple[Aim, ...] = ()

    @property
    def mission_id(self) -> MissionId:
        """The mission's id."""
        return self.mission.mission_id

    @property
    def drone_id(self) -> DroneId:
        """The drone that flies it."""
        return self.mission.drone_id

    @property
    def is_live(self) -> bool:
        """Whether the drone and pads are held for it."""
        return self.mission.state in LIVE_MISSION_STATES

    @property
    def needs_plan(self) -> bool:
        """Whether a new plan is to be looked for now; a proposal is answered first."""
        return (self.stuck is not None or self.trouble is not None) and self.proposal is None

    @property
    def is_being_loaded(self) -> bool:
        """Whether a loader has confirmed, and the drone has not accepted the new plan yet."""
        return self.trouble is not None and self.trouble.loaded is not None

    def packages(self, package_ids: frozenset[str]) -> tuple[Package, ...]:
        """Those packages of the request, in its order."""
        return tuple(each for each in self.request.packages if each.package_id in package_ids)

    def own(self, held: Mapping[PackageId, _T]) -> dict[PackageId, _T]:
        """What is known of this mission's packages; a delivery may have others."""
        ids = {each.package_id for each in self.request.packages}
        return {package_id: value for package_id, value in held.items() if package_id in ids}

    def aim_of(self, package: Package) -> StationId:
        """Where a package goes now: to its destination, unless it has another aim."""
        aims = {each.package_id: each.station_id for each in self.aims}
        return aims.get(package.package_id, package.destination.station_id)

    def with_trouble(self, trouble: Trouble) -> "MissionRecord":
        """The record with another trouble."""
        return replace(self, trouble=trouble)

    def moved_to(self, state: MissionState) -> "MissionRecord":
        """The record in another state of its mission; `states` says which are allowed."""
        return replace(self, mission=self.mission.model_copy(update={"state": state}))


_NEXT: Final[Mapping[MissionState, tuple[MissionState, ...]]] = {
    "BOOKED": ("ACCEPTED", "REFUSED", "CANCELLED"),
    "ACCEPTED": ("ACTIVE", "ABORTED", "CANCELLED"),
    "ACTIVE": ("COMPLETED", "ABORTED", "CANCELLED"),
    "COMPLETED": (),
    "ABORTED": (),
    "CANCELLED": (),
    "REFUSED": (),
}


def moved(record: MissionRecord, state: MissionState) -> MissionRecord:
    """The record with its mission in the next state.

    Raises
    ------
    ValueError
        That state cannot follow the present one: a bug, since callers look first.
    """
    if state not in _NEXT[record.mission.state]:
        raise ValueError(f"{record.mission_id}: {record.mission.state} cannot become {state}")
    return record.moved_to(state)
