"""What a drone finds out about itself on board: health, faults, and what it does about them."""

from enum import StrEnum
from typing import Annotated, Literal

from pydantic import Field

from skyway.bounds import Amperes, Celsius, Metres, Volts, WindComponent
from skyway.contracts.message import Soc
from skyway.ids import StationId
from skyway.json_model import WireModel

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
    MOTOR_FAILURE = "MOTOR_FAILURE"
    GEOFENCE = "GEOFENCE"
    GPS_LOST = "GPS_LOST"
    LINK_LOST = "LINK_LOST"
    CLOUD_SILENT = "CLOUD_SILENT"
    PAD_OCCUPIED = "PAD_OCCUPIED"
    INSTRUCTION_EXPIRED = "INSTRUCTION_EXPIRED"
    DISK_FULL = "DISK_FULL"


class Failsafe(StrEnum):
    """What a drone does by itself about a fault, the mildest first."""

    GO_ON = "GO_ON"
    WARN = "WARN"
    STAY = "STAY"  # on the ground: begin nothing
    ASK = "ASK"  # on the ground: fail the step, so that the cloud makes another plan
    WAIT_THEN_ASK = "WAIT_THEN_ASK"
    LAND_AT_NEXT = "LAND_AT_NEXT"  # fly what is released, land, wait there
    DIVERT = "DIVERT"  # fly to the nearest landing that can be reached, and wait there
    LAND_NOW = "LAND_NOW"  # here, wherever that is


class Wind(WireModel):
    """Where the air goes, as estimated on board from ground against air speed."""

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

    `soc_error` is one standard deviation of the estimated charge; `consumption_factor` what is
    used against what the drone model says (1.0: as planned); `range_m` is what can still be flown
    with this load above the reserve; `safe_landings` are the nearest stations that can be reached.
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
        float,
        Field(gt=0, le=1_000, description="Energy used per energy planned; 1.0 is as planned."),
    ] = 1.0
    range_m: Annotated[
        Metres,
        Field(description="How far the drone can still fly above its reserve, in metres."),
    ]
    wind: Annotated[Wind | None, Field(description="The wind, if it can be estimated.")] = None
    safe_landings: Annotated[
        tuple[StationId, ...], Field(description="The nearest stations that can be reached.")
    ] = ()


class ActiveFailsafe(WireModel):
    """What the drone does by itself just now, and where it leads; no station: down on the spot."""

    fault: Annotated[Fault, Field(description="What is wrong.")]
    failsafe: Annotated[Failsafe, Field(description="What the drone does about it.")]
    station_id: StationId | None = None
