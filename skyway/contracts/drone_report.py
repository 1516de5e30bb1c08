"""Drone to cloud: acks, events, state, telemetry and the last will."""

from enum import StrEnum
from typing import Annotated, Any, Literal

from pydantic import Field

from skyway.contracts.drone_health import ActiveFailsafe, AlarmLevel, DroneHealth, Fault
from skyway.contracts.flight_step import StepKind
from skyway.contracts.message import Count, DroneMessage, FleetMoment, Message, Soc
from skyway.geo import Position
from skyway.ids import InstructionId, MissionId, PackageId, StationId


class RefusalCode(StrEnum):
    """Why a drone refuses an instruction."""

    MALFORMED = "MALFORMED"
    UNSUPPORTED_STEP = "UNSUPPORTED_STEP"
    STALE_REVISION = "STALE_REVISION"
    STEP_RELEASED = "STEP_RELEASED"
    SEQUENCE_GAP = "SEQUENCE_GAP"
    EXPIRED = "EXPIRED"
    NOT_AT_START = "NOT_AT_START"
    OTHER_MISSION_ACTIVE = "OTHER_MISSION_ACTIVE"
    INSUFFICIENT_ENERGY = "INSUFFICIENT_ENERGY"
    OVERWEIGHT = "OVERWEIGHT"
    FAILSAFE_ACTIVE = "FAILSAFE_ACTIVE"


class Ack(DroneMessage):
    """The drone's answer to one instruction: RECEIVED once journaled, then ACCEPTED or REJECTED."""

    instruction_id: InstructionId
    instruction_seq: Count
    stream: Count
    status: Literal["RECEIVED", "ACCEPTED", "REJECTED"]
    code: RefusalCode | None = None
    detail: str | None = None
    #: Numbers behind a code: need_j and have_j, expected_seq, mass_kg and limit_kg.
    data: dict[str, Any] = Field(default_factory=dict)


class DroneEvent(DroneMessage):
    """A step's end or failure, or the mission's end; `seq` goes on across sessions.

    STEP_FAILED leaves the drone waiting at `station_id` for a new revision: that of the step, or
    another one, when a failsafe has led the drone there. Without a station it is down at
    `position` and flies no more before people have fetched it. Code UNKNOWN: the drone was
    restarted within a hand-over, and cannot know whether it was done; it never does it again.

    A step that a DIVERT or RETURN_HOME ended before its time is STEP_ENDED with code CUT and the
    `mission_revision` that it belonged to; the first new step has the same `step_id`.
    """

    event: Literal["STEP_ENDED", "STEP_FAILED", "MISSION_ENDED", "ALARM"]
    stream: Count
    mission_id: MissionId | None = None
    mission_revision: Count | None = None
    step_id: Count | None = None
    step_kind: StepKind | None = None
    started_at: FleetMoment | None = None
    ended_at: FleetMoment
    station_id: StationId | None = None
    position: Position
    soc: Soc
    energy_j: Annotated[float, Field(description="used by the step; 0 while charging")] = 0.0
    package_ids: tuple[PackageId, ...] = ()
    code: str | None = None
    detail: str | None = None
    #: Of an alarm: how bad it is.
    level: AlarmLevel | None = None
    #: Evidence: place and weights at a hand-over, need_j and have_j at a failure.
    data: dict[str, Any] = Field(default_factory=dict)


class DroneState(DroneMessage):
    """The truth of progress, retained: sent on change and at least every 30 s of wall time.

    `last_instruction_seq` and `stream` are 0 while the journal is empty.
    """

    at: FleetMoment
    #: DOWN: landed away from every station, it waits for people.
    activity: Literal["IDLE", "LOADING", "FLYING", "WAITING", "RECHARGING", "DELIVERING", "DOWN"]
    stream: Count
    last_instruction_seq: Count
    last_event_seq: Count
    mission_id: MissionId | None = None
    mission_revision: Count | None = None
    step_id: Count | None = None
    released_through: Count | None = None
    is_held: bool = False
    station_id: StationId | None = None
    position: Position
    soc: Soc
    load_kg: Annotated[float, Field(ge=0)] = 0.0
    package_ids: tuple[PackageId, ...] = ()
    health: DroneHealth | None = None
    faults: tuple[Fault, ...] = ()
    failsafe: ActiveFailsafe | None = None


class Telemetry(DroneMessage):
    """A light sample of a drone that moves or charges; `speed_mps` is over ground.

    Sent when something has changed beyond a dead band, and at least every 10 s of wall time.
    """

    at: FleetMoment
    position: Position
    soc: Soc
    power_w: float
    speed_mps: float
    voltage_v: float | None = None
    temperature_c: float | None = None
    range_m: float | None = None


class Connection(Message):
    """The drone's presence, retained; LOST is its last will.

    Ordered by (session, connection_number) alone: a last will is fixed at CONNECT.
    """

    session: Count
    connection_number: Count
    status: Literal["ONLINE", "OFFLINE", "LOST"]
