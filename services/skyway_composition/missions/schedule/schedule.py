"""A drone's schedule: its missions in time order, and when and where it is free again."""

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Annotated, Any, Final

from pydantic import Field

from skyway.contracts.message import FleetMoment
from skyway.contracts.mission import OPEN_MISSION_STATES, MissionState
from skyway.contracts.mission_reports import FreeFrom
from skyway.delivery.plan import Fly
from skyway.ids import DeliveryId, DroneId, MissionId, ProviderId, StationId
from skyway.json_model import JsonModel
from skyway.runtime.http.paging import Page
from skyway.scheduling.stays import first_slot
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.missions.mission.notify import free_from
from skyway_composition.missions.mission.record import MissionRecord

_EXAMPLE: Final[Mapping[str, Any]] = {
    "mission_id": "msn_01m82xxr559y422js25whdngd9",
    "delivery_id": "dlv_01m82y0y5gcyfdkfatpzjqh7hf",
    "state": "QUEUED",
    "service": {
        "start_at": "2026-03-01T12:31:10Z",
        "served_at": "2026-03-01T13:02:40Z",
        "from_station_id": "new-braunfels",
        "to_station_id": "kyle",
    },
    "standby": {"until_at": "2026-03-01T15:20:00Z"},
    "free_from": {"at": "2026-03-01T13:02:40Z", "station_id": "kyle", "soc": 0.62},
}


class ScheduledService(JsonModel):
    """The part of a mission until its last hand-over, by its present plan."""

    start_at: Annotated[
        datetime, Field(description="When the drone begins the mission, fleet time.")
    ]
    served_at: Annotated[datetime, Field(description="End of the last hand-over, fleet time.")]
    from_station_id: Annotated[
        StationId, Field(description="Station where the drone begins the mission.")
    ]
    to_station_id: Annotated[StationId, Field(description="Station of the last hand-over.")]


class ScheduledStandby(JsonModel):
    """The part after the last hand-over: the way home and the charge; it gives way."""

    until_at: Annotated[
        datetime,
        Field(
            description="Planned end of the standby (`released_at` of the mission), fleet time; "
            "of a mission that is over, when its last step ended."
        ),
    ]


class ScheduleEntry(JsonModel):
    """A mission in its drone's schedule."""

    mission_id: Annotated[MissionId, Field(description="Id of the mission.")]
    delivery_id: Annotated[DeliveryId, Field(description="Delivery that the mission serves.")]
    state: Annotated[
        MissionState, Field(description="QUEUED while it waits for the missions before it.")
    ]
    service: Annotated[ScheduledService, Field(description="Until the last hand-over.")]
    standby: Annotated[ScheduledStandby, Field(description="After the last hand-over.")]
    free_from: Annotated[
        FreeFrom | None,
        Field(
            description="When, where and with what charge another mission can begin after the "
            "service; null when the mission is over or needs a new plan."
        ),
    ]


class DroneSchedule(JsonModel):
    """A drone's missions in time order, and when and where the drone is free."""

    drone_id: Annotated[DroneId, Field(description="Id of the drone.")]
    provider_id: Annotated[ProviderId, Field(description="Provider of the drone.")]
    at: Annotated[FleetMoment, Field(description="The moment of this answer, fleet time.")]
    free_from: Annotated[
        FreeFrom | None,
        Field(
            description="When, where and with what charge the drone can begin another mission "
            "after all of these; null without missions, and while the last one needs a new plan.",
            examples=[_EXAMPLE["free_from"]],
        ),
    ]
    entries: Annotated[
        tuple[ScheduleEntry, ...],
        Field(description="The missions, by their start.", examples=[[_EXAMPLE]]),
    ]


class ProviderSchedule(Page[DroneSchedule]):
    """The schedules of a provider's drones in a span; drones without missions are not listed."""

    provider_id: Annotated[ProviderId, Field(description="Id of the provider.")]
    from_at: Annotated[FleetMoment, Field(description="Start of the span, fleet time.")]
    to_at: Annotated[FleetMoment, Field(description="End of the span, fleet time.")]


def schedule_of(
    drone_id: DroneId,
    provider_id: ProviderId,
    records: Sequence[MissionRecord],
    *,
    flown: Mapping[MissionId, tuple[int | None, int | None]],
    now: datetime,
) -> DroneSchedule:
    """The schedule of a drone with these missions; `flown` are the times of `store.flown_times`."""
    entries = [_entry(each, *flown.get(each.mission_id, (None, None))) for each in records]
    open_records = [each for each in records if each.mission.state in OPEN_MISSION_STATES]
    return DroneSchedule(
        drone_id=drone_id,
        provider_id=provider_id,
        at=now,
        free_from=_free_after(open_records[-1], now) if open_records else None,
        entries=tuple(sorted(entries, key=lambda each: each.service.start_at)),
    )


def _free_after(record: MissionRecord, now: datetime) -> FreeFrom | None:
    slot = first_slot(record.stays, not_before_ms=moment_to_ms(now))
    if slot is None:
        return None
    return FreeFrom(at=ms_to_moment(slot.at_ms), station_id=slot.station_id, soc=slot.soc)


def _entry(record: MissionRecord, began_ms: int | None, ended_ms: int | None) -> ScheduleEntry:
    mission = record.mission
    is_over = mission.state not in OPEN_MISSION_STATES
    until_at = mission.released_at
    if is_over and ended_ms is not None:
        until_at = ms_to_moment(ended_ms)
    served_at = ms_to_moment(record.served_ms)
    return ScheduleEntry(
        mission_id=mission.mission_id,
        delivery_id=mission.delivery_id,
        state=mission.state,
        service=ScheduledService(
            start_at=mission.start_at if began_ms is None else ms_to_moment(began_ms),
            served_at=min(served_at, until_at) if is_over else served_at,
            from_station_id=record.candidate.station_id,
            to_station_id=_served_at_station(record),
        ),
        standby=ScheduledStandby(until_at=until_at),
        free_from=None if is_over else free_from(record),
    )


def _served_at_station(record: MissionRecord) -> StationId:
    """Where the present plan ends; its first station when nothing is left of it."""
    steps = record.mission.plan.steps
    if not steps:
        stays = record.stays
        return stays[0].station_id if stays else record.candidate.station_id
    last = steps[-1]
    return last.to_id if isinstance(last, Fly) else last.station_id
