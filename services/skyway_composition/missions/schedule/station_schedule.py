"""A station's schedule: the reservations of each of its pads."""

from collections import defaultdict
from collections.abc import Iterable
from datetime import datetime
from typing import Annotated

from pydantic import Field

from skyway.contracts.message import FleetMoment
from skyway.contracts.statistics import Span
from skyway.ids import MissionId, StationId
from skyway.json_model import JsonModel
from skyway.units import ms_to_moment
from skyway_composition.pads.store import Reservation


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
