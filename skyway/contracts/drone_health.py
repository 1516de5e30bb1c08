"""What a drone finds out about itself on board: health, faults, and what it does about them."""

from enum import StrEnum
from typing import Annotated, Literal

from pydantic import Field

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

    east_mps: float
    north_mps: float


class DroneHealth(WireModel):
    """The results of the analysis on board.

    `soc_error` is one standard deviation of the estimated charge; `consumption_factor` what is
    used against what the drone model says (1.0: as planned); `range_m` is what can still be flown
    with this load above the reserve; `safe_landings` are the nearest stations that can be reached.
    """

    voltage_v: float
    current_a: float
    soc_error: Annotated[float, Field(ge=0)]
    cell_spread_v: Annotated[float, Field(ge=0)]
    temperature_c: float
    state_of_health: Soc
    consumption_factor: Annotated[float, Field(gt=0)] = 1.0
    range_m: Annotated[float, Field(ge=0)]
    wind: Wind | None = None
    safe_landings: tuple[StationId, ...] = ()


class ActiveFailsafe(WireModel):
    """What the drone does by itself just now, and where it leads; no station: down on the spot."""

    fault: Fault
    failsafe: Failsafe
    station_id: StationId | None = None
