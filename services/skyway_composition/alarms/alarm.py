"""An alarm: what happened, to whom, how bad it is, and who has looked at it."""

from datetime import datetime
from typing import Any, Literal

from pydantic import Field

from skyway.contracts.drone_health import AlarmLevel
from skyway.ids import AlarmId, DroneId, MissionId, ProviderId, StationId
from skyway.json_model import JsonModel

AlarmState = Literal["OPEN", "ACKNOWLEDGED"]


class Alarm(JsonModel):
    """What operators see of an alarm; `acknowledged_by` is whoever was first to look at it."""

    alarm_id: AlarmId
    level: AlarmLevel
    code: str
    detail: str
    at: datetime
    state: AlarmState
    provider_id: ProviderId | None
    drone_id: DroneId | None
    mission_id: MissionId | None
    station_id: StationId | None
    #: Numbers behind the code: need_j and have_j, mass_kg and limit_kg.
    data: dict[str, Any] = Field(default_factory=dict)
    acknowledged_at: datetime | None = None
    acknowledged_by: str | None = None
    note: str | None = None
