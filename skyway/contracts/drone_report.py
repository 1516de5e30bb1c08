"""Drone to cloud: its health, acks, events, state, telemetry and the last will."""

from enum import StrEnum
from typing import Annotated, Literal

from pydantic import Field

from skyway.bounds import (
    Amperes,
    Celsius,
    Count,
    Joules,
    Kilograms,
    Metres,
    MetresPerSecond,
    SmallObject,
    Volts,
    Watts,
    WindComponent,
    Words,
)
from skyway.contracts.flight_step import StepKind
from skyway.contracts.instruction import RefusalCode
from skyway.contracts.message import DroneMessage, FleetMoment, Message, Soc
from skyway.geo import Position
from skyway.ids import InstructionId, MissionId, PackageId, StationId
from skyway.json_model import WireModel

#: A delivery has at most 100 packages.
_PackageIds = Annotated[tuple[PackageId, ...], Field(max_length=100)]

_Factor = Annotated[float, Field(gt=0, le=1_000)]

AlarmLevel = Literal["WARNING", "URGENT", "CRITICAL"]


class Fault(StrEnum):
    """What is wrong; the code of an ALARM, and of the STEP_FAILED that a failsafe leads to."""

    BATTERY_LOW = "BATTERY_LOW"  # the next landing would be below the reserve
    BATTERY_SHORT = "BATTERY_SHORT"  # the next landing cannot be reached safely, another can
    BATTERY_EMPTY = "BATTERY_EMPTY"  # no landing can be reached
    BATTERY_HOT = "BATTERY_HOT"
    BATTERY_COLD = "BATTERY_COLD"
    CELL_IMBALANCE = "CELL_IMBALANCE"
    BATTERY_WORN = "BATTERY_WORN"
    BATTERY_UNKNOWN = "BATTERY_UNKNOWN"  # nothing reports the charge
    MOTOR_FAILURE = "MOTOR_FAILURE"
    GEOFENCE = "GEOFENCE"
    GPS_LOST = "GPS_LOST"
    LINK_LOST = "LINK_LOST"
    CLOUD_SILENT = "CLOUD_SILENT"
    PAD_OCCUPIED = "PAD_OCCUPIED"
    INSTRUCTION_EXPIRED = "INSTRUCTION_EXPIRED"
    DISK_FULL = "DISK_FULL"


class Failsafe(StrEnum):
    """The failsafes of a drone against a fault, the mildest first."""

    GO_ON = "GO_ON"
    WARN = "WARN"
    STAY = "STAY"  # on the ground: begin nothing
    ASK = "ASK"  # on the ground: fail the step, so that the cloud makes another plan
    WAIT_THEN_ASK = "WAIT_THEN_ASK"
    LAND_AT_NEXT = "LAND_AT_NEXT"  # fly the released steps, land, wait there
    DIVERT = "DIVERT"  # fly to the nearest landing that can be reached, and wait there
    LAND_NOW = "LAND_NOW"  # at this place, even if it is no station


class Wind(WireModel):
    """The wind: where the air moves, estimated on board from ground and air speed."""

    east_mps: Annotated[
        WindComponent,
        Field(description="Speed towards the east in metres per second."),
    ]
    north_mps: Annotated[
        WindComponent,
        Field(description="Speed towards the north in metres per second."),
    ]


class DroneHealth(WireModel):
    """The results of the analysis on board.

    `soc_error` is one standard deviation of the estimated charge. `consumption_factor` is the
    energy used divided by the energy of the drone model (1.0: as planned), in this wind and with
    this battery; `still_air_factor` is the drone's own part of it, of the flights just flown.
    `range_m` is the distance that can still be flown with this load above the reserve.
    `safe_landings` are the nearest stations in reach.
    """

    voltage_v: Annotated[Volts, Field(description="Battery voltage in volts.")]
    current_a: Annotated[Amperes, Field(description="Battery current in amperes.")]
    soc_error: Annotated[
        float,
        Field(ge=0, le=10, description="One standard deviation of the state of charge, 0 to 1."),
    ]
    cell_spread_v: Annotated[
        Volts,
        Field(description="The difference between the highest and the lowest cell, in volts."),
    ]
    temperature_c: Annotated[Celsius, Field(description="Battery temperature in degrees Celsius.")]
    state_of_health: Soc
    consumption_factor: Annotated[
        _Factor, Field(description="Energy used per energy planned; 1.0 is as planned.")
    ] = 1.0
    still_air_factor: Annotated[
        _Factor | None,
        Field(
            description="Energy used by the last flights, divided by the model's for the same "
            "flights in the same wind; null before a flight.",
        ),
    ] = None
    charge_rate_factor: Annotated[
        _Factor | None,
        Field(
            description="How fast the last recharge raised the state of charge, divided by the "
            "model's charge curve; null without a measured recharge.",
        ),
    ] = None
    range_m: Annotated[
        Metres,
        Field(description="How far the drone can still fly above its reserve, in metres."),
    ]
    wind: Annotated[Wind | None, Field(description="The wind, if it can be estimated.")] = None
    safe_landings: Annotated[
        tuple[StationId, ...],
        Field(max_length=100, description="The nearest stations that can be reached."),
    ] = ()


class ActiveFailsafe(WireModel):
    """The failsafe that acts now, and where it leads; no station means on the spot."""

    fault: Annotated[Fault, Field(description="What is wrong.")]
    failsafe: Annotated[Failsafe, Field(description="What the drone does about it.")]
    station_id: StationId | None = None


class Ack(DroneMessage):
    """The drone's answer to one instruction: RECEIVED once journaled, then ACCEPTED or REJECTED."""

    instruction_id: InstructionId
    instruction_seq: Annotated[
        Count, Field(description="The `seq` of the instruction that is answered.")
    ]
    stream: Annotated[Count, Field(description="The stream of the instruction that is answered.")]
    status: Annotated[
        Literal["RECEIVED", "ACCEPTED", "REJECTED"],
        Field(description="RECEIVED once journaled, then ACCEPTED or REJECTED."),
    ]
    code: Annotated[RefusalCode | None, Field(description="Why it is rejected, for programs.")] = (
        None
    )
    detail: Annotated[Words | None, Field(description="Why it is rejected, for people.")] = None
    #: Numbers behind a code: need_j and have_j, expected_seq, mass_kg and limit_kg.
    data: SmallObject = Field(
        default_factory=dict,
        description="The numbers behind the code, such as need_j and have_j.",
    )


class DroneEvent(DroneMessage):
    """A step's end or failure, or the mission's end; `seq` goes on across sessions.

    After STEP_FAILED the drone waits at `station_id` for a new revision. This is the station of the
    step, or the one to which a failsafe has led the drone. Without a station the drone is down at
    `position`, and does not fly until people have fetched it. Code UNKNOWN: the drone was restarted
    during a hand-over, and cannot know whether the hand-over was done; it never repeats it.

    If a DIVERT or RETURN_HOME ends a step early, the event is STEP_ENDED with code CUT and the
    `mission_revision` of that step; the first new step has the same `step_id`.

    HAND_OVER_AWAITED: the drone has landed for a DELIVER at `started_at`, and waits for the proofs
    of `package_ids`. PIN_ENTERED: a person has typed `pin` at the box of the drone that waits, for
    the package in `package_ids`, or for any if there is none.
    """

    event: Annotated[
        Literal[
            "STEP_ENDED",
            "STEP_FAILED",
            "MISSION_ENDED",
            "ALARM",
            "HAND_OVER_AWAITED",
            "PIN_ENTERED",
        ],
        Field(description="What happened."),
    ]
    stream: Annotated[
        Count, Field(description="The stream of instructions that the drone follows.")
    ]
    mission_id: MissionId | None = None
    mission_revision: Annotated[
        Count | None, Field(description="The revision of the plan that the step belongs to.")
    ] = None
    step_id: Annotated[Count | None, Field(description="The number of the step, from 1.")] = None
    step_kind: Annotated[StepKind | None, Field(description="What the step does.")] = None
    started_at: FleetMoment | None = None
    ended_at: FleetMoment
    station_id: StationId | None = None
    position: Annotated[Position, Field(description="Where the drone is, in degrees.")]
    soc: Soc
    energy_j: Annotated[Joules, Field(description="used by the step; 0 while charging")] = 0.0
    package_ids: Annotated[_PackageIds, Field(description="The packages of the step.")] = ()
    code: Annotated[
        Words | None, Field(description="Why it failed, or what the alarm is about, for programs.")
    ] = None
    detail: Annotated[Words | None, Field(description="The same for people.")] = None
    pin: Annotated[
        str | None,
        Field(
            pattern=r"^[0-9]{1,8}$",
            repr=False,
            exclude_if=lambda value: value is None,
            description="The digits that were typed at the drone's box, 1 to 8; left out "
            "otherwise.",
        ),
    ] = None
    #: Of an alarm: how bad it is.
    level: Annotated[AlarmLevel | None, Field(description="How bad an alarm is.")] = None
    #: Evidence: place and weights at a hand-over, need_j and have_j at a failure.
    data: SmallObject = Field(
        default_factory=dict,
        description="Evidence: place and masses at a hand-over, need_j and have_j at a failure.",
    )


class DroneState(DroneMessage):
    """The truth of progress, retained: sent on change and at least every 30 s of wall time.

    `last_instruction_seq` and `stream` are 0 while the journal is empty.
    """

    at: FleetMoment
    #: DOWN: landed away from every station, it waits for people.
    activity: Annotated[
        Literal["IDLE", "LOADING", "FLYING", "WAITING", "RECHARGING", "DELIVERING", "DOWN"],
        Field(description="What the drone does now; DOWN is landed away from every station."),
    ]
    stream: Annotated[
        Count,
        Field(description="The stream of instructions that the drone follows; 0 without one."),
    ]
    last_instruction_seq: Annotated[
        Count, Field(description="The `seq` of the last instruction in the journal; 0 without one.")
    ]
    last_event_seq: Annotated[Count, Field(description="The `seq` of the drone's last event.")]
    journal_session: Annotated[
        Count,
        Field(
            description="The session in which the drone's journal was begun; 0 if unknown. Another "
            "number than before shows that the drone has lost its journal."
        ),
    ] = 0
    mission_id: MissionId | None = None
    mission_revision: Annotated[
        Count | None, Field(description="The revision of the plan that it flies.")
    ] = None
    step_id: Annotated[Count | None, Field(description="The number of the step under way.")] = None
    released_through: Annotated[
        Count | None,
        Field(description="The number of the last step that it may begin without asking."),
    ] = None
    is_held: Annotated[bool, Field(description="Whether it begins no further step.")] = False
    station_id: StationId | None = None
    position: Annotated[Position, Field(description="Where the drone is, in degrees.")]
    soc: Soc
    load_kg: Annotated[Kilograms, Field(description="The mass on board in kilograms.")] = 0.0
    package_ids: Annotated[_PackageIds, Field(description="The packages on board.")] = ()
    health: Annotated[
        DroneHealth | None, Field(description="The results of the analysis on board.")
    ] = None
    faults: Annotated[
        tuple[Fault, ...], Field(max_length=100, description="What is wrong now.")
    ] = ()
    failsafe: Annotated[
        ActiveFailsafe | None,
        Field(description="What the drone does by itself now; null if nothing."),
    ] = None


class Telemetry(DroneMessage):
    """A light sample of a drone that moves or charges; `speed_mps` is over ground.

    Sent when something has changed beyond a dead band, and at least every 10 s of wall time.
    """

    at: FleetMoment
    position: Annotated[Position, Field(description="Where the drone is, in degrees.")]
    soc: Soc
    power_w: Annotated[Watts, Field(description="Electrical power in watts.")]
    speed_mps: Annotated[
        MetresPerSecond, Field(description="Speed over ground in metres per second.")
    ]
    voltage_v: Annotated[Volts | None, Field(description="Battery voltage in volts.")] = None
    temperature_c: Annotated[
        Celsius | None, Field(description="Battery temperature in degrees Celsius.")
    ] = None
    range_m: Annotated[
        Metres | None,
        Field(description="How far the drone can still fly above its reserve, in metres."),
    ] = None


class Connection(Message):
    """The drone's presence, retained; LOST is its last will.

    Ordered by (session, connection_number) alone: a last will is fixed at CONNECT.
    """

    session: Annotated[Count, Field(description="The drone's session; it grows with every boot.")]
    connection_number: Annotated[
        Count, Field(description="The number of the connection within its session.")
    ]
    status: Annotated[
        Literal["ONLINE", "OFFLINE", "LOST"],
        Field(description="ONLINE, OFFLINE, or LOST as the last will."),
    ]
