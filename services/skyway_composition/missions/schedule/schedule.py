"""Schedules: a drone's missions in time order, a station's reservations, and the span shown.

A drone's schedule also says when and where the drone is free again.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime, timedelta
from typing import Annotated, Any, Final

from pydantic import Field

from skyway.bounds import LATEST
from skyway.contracts.message import FleetMoment
from skyway.contracts.mission import OPEN_MISSION_STATES, MissionState
from skyway.contracts.mission_reports import FreeFrom
from skyway.contracts.statistics import Span, span_between
from skyway.delivery.plan import Fly
from skyway.ids import DeliveryId, DroneId, MissionId, ProviderId, StationId
from skyway.json_model import JsonModel, QueryModel
from skyway.runtime.http.paging import Page, PageQuery
from skyway.scheduling.stays import first_slot
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.unit_of_work import free_from
from skyway_composition.pads.store import Reservation

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

#: The longest span that one call shows; our own choice.
LONGEST_SPAN: Final = timedelta(days=31)


class FutureSpanQuery(QueryModel):
    """``?from=&to=``; by default 31 days from now on."""

    from_at: Annotated[
        FleetMoment | None,
        Field(alias="from", description="Start of the span, fleet time; without it now."),
    ] = None
    to_at: Annotated[
        FleetMoment | None,
        Field(
            alias="to",
            description="End of the span, fleet time; without it 31 days after the start. "
            "A span is at most 31 days long.",
        ),
    ] = None

    def span(self, now: datetime) -> Span:
        """The requested span.

        Raises
        ------
        InvalidInput
            It ends before it begins, or it is too long.
        """
        from_at = self.from_at or now
        to_at = self.to_at or min(from_at + LONGEST_SPAN, LATEST)
        return span_between(from_at, to_at, longest=LONGEST_SPAN)


class ScheduleQuery(FutureSpanQuery, PageQuery):
    """A span, and a page of the drones that have missions in it."""


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


class PadEntry(JsonModel):
    """A reservation of a pad in [start_at, end_at)."""

    start_at: Annotated[datetime, Field(description="Start of the reservation, fleet time.")]
    end_at: Annotated[
        datetime, Field(description="End of the reservation, fleet time; the pad is free then.")
    ]
    mission_id: Annotated[
        MissionId | None,
        Field(
            description="Mission that holds the pad, shown to operators only; null while the pad "
            "is held for an offer."
        ),
    ]


class PadSchedule(JsonModel):
    """The reservations of one pad, by their start."""

    pad: Annotated[int, Field(description="Number of the pad at its station, from 0.")]
    entries: Annotated[tuple[PadEntry, ...], Field(description="Its reservations, in order.")]


class StationSchedule(JsonModel):
    """The pads of a station and their reservations in a span that are not over."""

    station_id: Annotated[StationId, Field(description="Id of the station.")]
    from_at: Annotated[FleetMoment, Field(description="Start of the span, fleet time.")]
    to_at: Annotated[FleetMoment, Field(description="End of the span, fleet time.")]
    pads: Annotated[tuple[PadSchedule, ...], Field(description="Each pad, in order of its number.")]


def station_schedule(
    station_id: StationId,
    pads: int,
    reservations: Iterable[Reservation],
    *,
    span: Span,
    shows_missions: bool,
) -> StationSchedule:
    """The schedule of a station with this many pads, from its reservations in order of start."""
    by_pad: dict[int, list[PadEntry]] = defaultdict(list)
    for each in reservations:
        if each.booked.start_ms < span.end_ms and span.start_ms < each.booked.end_ms:
            by_pad[each.booked.pad].append(
                PadEntry(
                    start_at=ms_to_moment(each.booked.start_ms),
                    end_at=ms_to_moment(each.booked.end_ms),
                    mission_id=each.mission_id if shows_missions else None,
                )
            )
    return StationSchedule(
        station_id=station_id,
        from_at=span.from_at,
        to_at=span.to_at,
        pads=tuple(PadSchedule(pad=pad, entries=tuple(by_pad[pad])) for pad in range(pads)),
    )
