"""A mission as composition stores it; a row has columns for what is searched, JSON for the rest."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Final, Literal, TypeVar

from pydantic import Field, TypeAdapter

from skyway.contracts.candidate import Candidate
from skyway.contracts.flight_step import FlightStep, PackageOnBoard
from skyway.contracts.message import Soc
from skyway.contracts.mission import LIVE_MISSION_STATES, Mission, MissionState, PackageEta
from skyway.delivery.request import DeliveryRequest, Package
from skyway.ids import (
    DeliveryId,
    DroneId,
    InstructionId,
    MissionId,
    NetworkId,
    PackageId,
    StationId,
)
from skyway.json_model import JsonCache, JsonModel
from skyway.scheduling.stays import Slot, Stay, stays_json, stays_of_standby
from skyway.units import moment_to_ms
from skyway_composition.missions.mission.share import Share, read_shares, shares_json
from skyway_composition.networks.store import Present

_T = TypeVar("_T")


#: The trouble codes of an operator's commands RETURN_HOME and DIVERT.
CALLED_HOME: Final = "CALLED_HOME"


DIVERTED: Final = "DIVERTED"

#: The trouble code of a mission whose next mission has left the calendar: it needs a standby again.
STANDBY_ENDED: Final = "STANDBY_ENDED"

#: The code of a revision that ends a standby early, because the drone's next mission begins.
NEXT_MISSION: Final = "NEXT_MISSION"

#: The code of a revision with another standby, because another drone's service needs its pads.
GIVE_WAY: Final = "GIVE_WAY"

#: Revisions with these codes leave the service as it is, so they do not concern the customer.
OF_STANDBY_ONLY: Final = (NEXT_MISSION, GIVE_WAY)


_NEXT: Final[Mapping[MissionState, tuple[MissionState, ...]]] = {
    "QUEUED": ("BOOKED", "REFUSED", "CANCELLED"),
    "BOOKED": ("ACCEPTED", "REFUSED", "CANCELLED"),
    "ACCEPTED": ("ACTIVE", "ABORTED", "CANCELLED"),
    "ACTIVE": ("COMPLETED", "ABORTED", "CANCELLED"),
    "COMPLETED": (),
    "ABORTED": (),
    "CANCELLED": (),
    "REFUSED": (),
}


class OccupiedPad(JsonModel):
    """A pad that a drone found occupied, and until when no drone is sent there."""

    station_id: StationId
    pad: int
    until_ms: int


class Stuck(JsonModel):
    """Why a drone waits for a new revision, and where it stands.

    The drone has released all steps up to `last_step`, so new steps get higher numbers. An
    `occupied` pad is closed for a while before the next plan is made.
    """

    code: str
    detail: str
    station_id: StationId
    soc: Soc
    last_step: int
    occupied: OccupiedPad | None = None


class Trouble(JsonModel):
    """Why the plan of a mission no longer holds; the drone may still fly by it.

    `loaded` is what a loader has confirmed while the drone waits at the pickup. `land_at` is the
    station to which an operator diverts the drone. With `overrides_failsafe` the drone obeys even
    while one of its failsafes is active.
    """

    code: Annotated[str, Field(description="Why another plan is needed.", examples=["LATE"])]
    detail: Annotated[str, Field(description="The reason as a sentence.")]
    loaded: Annotated[
        tuple[PackageOnBoard, ...] | None,
        Field(description="Packages that a loader has confirmed; null before that."),
    ] = None
    land_at: Annotated[
        StationId | None, Field(description="Station to which an operator diverts the drone.")
    ] = None
    overrides_failsafe: Annotated[
        bool, Field(description="Whether the plan overrides an active failsafe.")
    ] = False


class Aim(JsonModel):
    """Where a package goes instead of its destination, to be delivered or returned there."""

    package_id: Annotated[PackageId, Field(description="Id of the package.")]
    station_id: Annotated[StationId, Field(description="Station where it goes instead.")]
    kind: Annotated[
        Literal["DELIVER", "RETURN"],
        Field(description="DELIVER: to a recipient there. RETURN: handed back there."),
    ]


class Proposal(JsonModel):
    """A revision that was sent and not answered yet; it becomes the plan once accepted.

    Until then the pads of both plans stay reserved. `steps` replace the planned steps from
    `first_step` on.
    """

    instruction_id: InstructionId
    first_step: int
    mission: Mission
    steps: tuple[FlightStep, ...]
    code: str
    detail: str


@dataclass(frozen=True, slots=True)
class MissionRecord:
    """A mission with its request, the drone as it was booked, and its state of replanning.

    `reported_activity` is the drone's activity and station in the last report to the customer.
    `planned_in` is the network with which a QUEUED mission was planned. `promised` are the arrival
    times with which it was booked, or with which its promise became firm. `traceparent` is that of
    the delivery's request. `shares` are the deliveries that fly together, first that of the mission
    itself; empty while it flies for one only.
    """

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
    planned_in: Present | None = None
    traceparent: str | None = None
    promised: tuple[PackageEta, ...] = ()
    shares: tuple[Share, ...] = ()

    @property
    def mission_id(self) -> MissionId:
        """The mission's id."""
        return self.mission.mission_id

    @property
    def drone_id(self) -> DroneId:
        """The drone that flies it."""
        return self.mission.drone_id

    @property
    def promises(self) -> dict[PackageId, PackageEta]:
        """When each package was promised; when it is planned, if the promise was not stored."""
        return {each.package_id: each for each in (*self.mission.packages, *self.promised)}

    @property
    def delivery_ids(self) -> tuple[DeliveryId, ...]:
        """The deliveries that it serves."""
        shared = tuple(each.delivery_id for each in self.shares)
        return shared or (self.mission.delivery_id,)

    @property
    def in_calendar(self) -> "MissionRecord | None":
        """What other plans for the drone depend on: not the reports, and not how far it has come.

        None for a mission that is over.
        """
        if not self.is_live and self.mission.state != "QUEUED":
            return None
        shares = tuple(each.model_copy(update={"report_seq": 0}) for each in self.shares)
        same = self.moved_to("ACTIVE") if self.is_live else self
        return replace(same, report_seq=0, reported_activity=None, shares=shares)

    @property
    def is_live(self) -> bool:
        """Whether the drone and pads are reserved for the mission."""
        return self.mission.state in LIVE_MISSION_STATES

    @property
    def start(self) -> Slot:
        """Where, when and with what charge the drone begins the mission as booked."""
        candidate = self.candidate
        return Slot(candidate.station_id, moment_to_ms(self.mission.start_at), candidate.soc)

    @property
    def may_be_shared(self) -> bool:
        """Whether packages of other deliveries may join the mission before it is sent."""
        return self.request.may_share_trip and self.mission.loading == "AUTOMATIC"

    @property
    def allowed_from_ms(self) -> int:
        """The earliest start that the customer allows; 0 if every start is allowed."""
        earliest_at = self.request.begins_after
        return 0 if earliest_at is None else moment_to_ms(earliest_at)

    @property
    def earliest_ms(self) -> int:
        """The earliest start that serves the customer; 0 if every start does.

        A request with windows was booked to begin when they need it, so it begins no earlier.
        """
        if not self.request.has_windows:
            return self.allowed_from_ms
        return max(self.allowed_from_ms, self.start.at_ms)

    @property
    def served_ms(self) -> int:
        """The planned end of the last hand-over."""
        mission = self.mission
        return moment_to_ms(mission.start_at) + round((mission.plan.delivery_time_s or 0.0) * 1000)

    @property
    def stays(self) -> tuple[Stay, ...]:
        """Where the drone can begin another mission after this one.

        Empty while the mission's plan is in question.
        """
        mission = self.mission
        is_sure = self.stuck is None and self.trouble is None and mission.doubt is None
        if not is_sure or mission.is_held or mission.given_up is not None:
            return ()
        return stays_of_standby(
            mission.plan,
            start_ms=moment_to_ms(mission.start_at),
            # The charge at the start of a later revision is not stored.
            soc=self.candidate.soc if mission.revision == 1 else None,
            home_plan=mission.home_plan,
            home_recharge=mission.home_recharge,
        )

    @property
    def needs_plan(self) -> bool:
        """Whether a new plan is needed and no proposal waits for the drone's answer."""
        return (self.stuck is not None or self.trouble is not None) and self.proposal is None

    @property
    def is_being_loaded(self) -> bool:
        """Whether a loader has confirmed, and the drone has not accepted the new plan yet."""
        return self.trouble is not None and self.trouble.loaded is not None

    @property
    def left_out(self) -> tuple[PackageId, ...]:
        """Cancelled packages that the next plan leaves out; the drone may still load them."""
        requested = {each.package_id for each in self.request.packages}
        return tuple(
            aim.package_id
            for aim in self.aims
            if aim.kind == "RETURN" and aim.package_id not in requested
        )

    def packages(self, package_ids: frozenset[str]) -> tuple[Package, ...]:
        """The packages of the request with these ids, in the order of the request."""
        return tuple(each for each in self.request.packages if each.package_id in package_ids)

    def own(self, held: Mapping[PackageId, _T]) -> dict[PackageId, _T]:
        """The entries of this mission's packages; the delivery may have other packages."""
        ids = {each.package_id for each in self.request.packages}
        return {package_id: value for package_id, value in held.items() if package_id in ids}

    def aim_of(self, package: Package) -> StationId:
        """The station a package goes to now: its aim, or its destination if it has no aim."""
        aims = {each.package_id: each.station_id for each in self.aims}
        return aims.get(package.package_id, package.destination.station_id)

    def with_mission(self, mission: Mission) -> "MissionRecord":
        """The record with another public part of the mission."""
        return replace(self, mission=mission)

    def with_trouble(self, trouble: Trouble) -> "MissionRecord":
        """The record with another trouble."""
        return replace(self, trouble=trouble)

    def moved_to(self, state: MissionState) -> "MissionRecord":
        """The record in another state; `moved` checks that the state may follow."""
        return replace(self, mission=self.mission.model_copy(update={"state": state}))


def moved(record: MissionRecord, state: MissionState) -> MissionRecord:
    """The record with its mission in the next state.

    Raises
    ------
    ValueError
        The state cannot follow the present one. This is a bug: callers check first.
    """
    if state not in _NEXT[record.mission.state]:
        raise ValueError(f"{record.mission_id}: {record.mission.state} cannot become {state}")
    return record.moved_to(state)


#: How many values of one model are cached, about 10 KiB each. The dispatcher reads all open
#: missions of a fleet: a smaller cache would lose those that drones report about next.
_MOST: Final = 4_000

_AIMS: Final = TypeAdapter(tuple[Aim, ...])


#: Reads and writes the arrival times with which a QUEUED mission was booked.
PROMISED: Final = TypeAdapter(tuple[PackageEta, ...])


# A mission is read again soon after it was written, most often by the same replica: a drone answers
# about a second after its booking. The request seldom changes.
_MISSIONS: Final = JsonCache(Mission, most=_MOST)
_REQUESTS: Final = JsonCache(DeliveryRequest, most=_MOST)
_CANDIDATES: Final = JsonCache(Candidate, most=_MOST)


def new_row(record: MissionRecord) -> dict[str, Any]:  # column values of any type
    """All columns of a new mission."""
    mission = record.mission
    return {
        "mission_id": mission.mission_id,
        "delivery_id": mission.delivery_id,
        "attempt": mission.attempt,
        "trip": mission.trip,
        "provider_id": mission.provider_id,
        "drone_id": mission.drone_id,
        "network_id": record.network_id,
        "request": _REQUESTS.write(record.request),
        "candidate": _CANDIDATES.write(record.candidate),
        "traceparent": record.traceparent,
        "promised": PROMISED.dump_json(record.promised).decode() if record.promised else None,
        "pooling_at": record.request.pickup.station_id if record.may_be_shared else None,
        **changing_columns(record),
    }


def changing_columns(record: MissionRecord) -> dict[str, Any]:  # column values of any type
    """The columns that change while a mission lives."""
    mission, planned_in, stays = record.mission, record.planned_in, record.stays
    return {
        "state": mission.state,
        "start_ms": moment_to_ms(mission.start_at),
        "released_ms": moment_to_ms(mission.released_at),
        "expires_ms": record.expires_ms,
        "body": _MISSIONS.write(mission),
        "report_seq": record.report_seq,
        "told": record.reported_activity,
        "stuck": None if record.stuck is None else record.stuck.model_dump_json(),
        "trouble": None if record.trouble is None else record.trouble.model_dump_json(),
        "proposal": None if record.proposal is None else record.proposal.model_dump_json(),
        "aims": _AIMS.dump_json(record.aims).decode(),
        "loading": mission.loading,
        "stays": stays_json(stays) if stays else None,
        "served_ms": record.served_ms,
        "firm_ms": None if mission.firm_at is None else moment_to_ms(mission.firm_at),
        "planned_version": None if planned_in is None else planned_in.version,
        "planned_conditions": None if planned_in is None else planned_in.conditions,
        "shares": shares_json(record.shares),
    }


def read_record(row: Any) -> MissionRecord:  # a row of missions, whose columns have any type
    """The mission in a row."""
    return MissionRecord(
        mission=_MISSIONS.read(row.body),
        network_id=row.network_id,
        request=_REQUESTS.read(row.request),
        candidate=_CANDIDATES.read(row.candidate),
        expires_ms=row.expires_ms,
        report_seq=row.report_seq,
        reported_activity=row.told,
        stuck=None if row.stuck is None else Stuck.read(row.stuck),
        trouble=None if row.trouble is None else Trouble.read(row.trouble),
        proposal=None if row.proposal is None else Proposal.read(row.proposal),
        aims=_AIMS.validate_json(row.aims),
        planned_in=(
            None
            if row.planned_version is None
            else Present(row.network_id, row.planned_version, row.planned_conditions)
        ),
        traceparent=row.traceparent,
        promised=() if row.promised is None else PROMISED.validate_json(row.promised),
        shares=() if row.shares is None else read_shares(row.shares),
    )
