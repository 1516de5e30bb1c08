"""An alarm: what happened, what it concerns, how serious it is, and who acknowledged it."""

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import Field

from skyway.contracts.drone_health import AlarmLevel
from skyway.ids import AlarmId, DroneId, MissionId, ProviderId, StationId
from skyway.json_model import JsonModel

AlarmState = Literal["OPEN", "ACKNOWLEDGED"]


class Alarm(JsonModel):
    """A problem that an operator must look at."""

    alarm_id: Annotated[AlarmId, Field(description="Id of the alarm.")]
    level: Annotated[
        AlarmLevel, Field(description="How serious the problem is: WARNING, URGENT or CRITICAL.")
    ]
    code: Annotated[str, Field(description="Stable reason for programs.", examples=["BATTERY_LOW"])]
    detail: Annotated[str, Field(description="The reason in words, with the values in question.")]
    at: Annotated[datetime, Field(description="Moment of the problem, fleet time.")]
    state: Annotated[
        AlarmState, Field(description="OPEN until an operator acknowledges the alarm.")
    ]
    provider_id: Annotated[
        ProviderId | None, Field(description="Provider that the problem concerns, if any.")
    ]
    drone_id: Annotated[
        DroneId | None, Field(description="Drone that the problem concerns, if any.")
    ]
    mission_id: Annotated[
        MissionId | None, Field(description="Mission that the problem concerns, if any.")
    ]
    station_id: Annotated[
        StationId | None, Field(description="Station that the problem concerns, if any.")
    ]
    data: dict[str, Any] = Field(
        default_factory=dict,
        description="Numbers and names behind the code, such as need_j and have_j.",
        examples=[{"need_j": 512_000.0, "have_j": 430_000.0}],
    )
    acknowledged_at: Annotated[
        datetime | None, Field(description="Moment of the acknowledgement, fleet time.")
    ] = None
    acknowledged_by: Annotated[
        str | None, Field(description="The operator who acknowledged the alarm first.")
    ] = None
    note: Annotated[str | None, Field(description="What this operator wrote about the alarm.")] = (
        None
    )
