"""The registry asks composition to raise an alarm about a drone."""

from typing import Annotated, Final

from pydantic import Field

from skyway.bounds import SmallObject, Words
from skyway.contracts.drone_report import AlarmLevel
from skyway.contracts.message import FleetMoment
from skyway.ids import DroneId, ProviderId
from skyway.json_model import WireModel

#: Where the registry posts an alarm.
DRONE_ALARMS: Final = "/internal/drone-alarms"


class DroneAlarm(WireModel):
    """A problem of a drone that operators and its provider must look at."""

    provider_id: ProviderId
    drone_id: DroneId
    level: AlarmLevel
    code: Annotated[str, Field(max_length=100)]
    detail: Words
    at: FleetMoment
    data: SmallObject = Field(default_factory=dict)
