"""Pads over REST: which pads of a station are occupied, and until when."""

from datetime import datetime
from typing import Annotated

from fastapi import Depends, Query
from pydantic import Field

from skyway.ids import MissionId, StationId
from skyway.json_model import JsonModel
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.closures.store import outages
from skyway_composition.pads.occupancy import Outage, outages_by_pad
from skyway_composition.pads.store import Reservation, pads_of, reservations_of


class PadNow(JsonModel):
    """A pad at the present moment."""

    pad: Annotated[int, Field(description="Number of the pad at its station, from 0.")]
    taken_until_at: Annotated[
        datetime | None,
        Field(description="End of the current reservation, fleet time; null without one."),
    ]
    mission_id: Annotated[
        MissionId | None,
        Field(
            description="Mission that holds the pad now, shown to operators only; null while the "
            "pad is held for an offer."
        ),
    ]
    is_out_of_order: Annotated[bool, Field(description="Whether the pad is out of order now.")]
    works_again_at: Annotated[
        datetime | None,
        Field(description="End of the outage, fleet time; null without outage or known end."),
    ]


class StationPads(JsonModel):
    """The pads of a station at a moment."""

    station_id: Annotated[StationId, Field(description="Id of the station.")]
    pads: Annotated[int, Field(description="Number of pads of the station.")]
    pads_taken: Annotated[
        int, Field(description="Number of pads that are reserved now or out of order, each once.")
    ]
    at: Annotated[datetime, Field(description="The moment of this answer, fleet time.")]
    items: Annotated[tuple[PadNow, ...], Field(description="Each pad, in order of its number.")]


class ReservationInfo(JsonModel):
    """A pad that is reserved in [start_at, end_at)."""

    station_id: Annotated[StationId, Field(description="Station of the pad.")]
    pad: Annotated[int, Field(description="Number of the pad at its station, from 0.")]
    start_at: Annotated[datetime, Field(description="Start of the reservation, fleet time.")]
    end_at: Annotated[
        datetime, Field(description="End of the reservation, fleet time; the pad is free then.")
    ]
    mission_id: Annotated[
        MissionId | None,
        Field(description="Mission that holds the reservation; shown to operators only."),
    ]


def pad_routes(*, db: Database, gate: ServiceGate, clock: FleetClock) -> ServiceRouter:
    """GET /v1/stations/{station_id}/pads and .../reservations."""
    router = ServiceRouter(tags=("pads",))

    @router.get("/v1/stations/{station_id}/pads")
    async def get_station_pads(
        station_id: StationId, caller: Annotated[Caller, Depends(gate)]
    ) -> StationPads:
        """Show which pads of a station are occupied now."""
        caller.must_be("customer", "provider", "operator", "service", "drone")
        at = clock.now()
        now_ms = moment_to_ms(at)
        async with db.read() as connection:
            pads = await pads_of(connection, station_id)
            if pads is None:
                raise NotFound("station", station_id)
            coming = await reservations_of(
                connection, station_id, ending_after_ms=now_ms, after=None, limit=10_000
            )
            broken = outages_by_pad(await outages(connection, at_ms=now_ms, station_id=station_id))
        taken = {each.booked.pad: each for each in coming if each.booked.start_ms <= now_ms}
        occupied = taken.keys() | broken.get(station_id, {}).keys()
        return StationPads(
            station_id=station_id,
            pads=pads,
            pads_taken=sum(pad < pads for pad in occupied),
            at=at,
            items=tuple(
                _pad_now(pad, taken.get(pad), broken.get(station_id, {}).get(pad), caller)
                for pad in range(pads)
            ),
        )

    @router.get("/v1/stations/{station_id}/reservations")
    async def list_station_reservations(
        station_id: StationId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[PageQuery, Query()],
    ) -> Page[ReservationInfo]:
        """List the reservations of a station that are not over, by their start."""
        caller.must_be("customer", "provider", "operator", "service")
        after = query.after(int, int)
        async with db.read() as connection:
            if await pads_of(connection, station_id) is None:
                raise NotFound("station", station_id)
            rows = await reservations_of(
                connection,
                station_id,
                ending_after_ms=moment_to_ms(clock.now()),
                after=(int(after[0]), int(after[1])) if after else None,
                limit=query.limit + 1,
            )
        return page_of(
            rows,
            query,
            item=lambda row: _reservation_info(row, caller),
            sort_key=lambda row: (row.booked.start_ms, row.booked.pad),
        )

    return router


def _pad_now(pad: int, held: Reservation | None, outage: Outage | None, caller: Caller) -> PadNow:
    works_again_ms = None if outage is None else outage.until_ms
    return PadNow(
        pad=pad,
        taken_until_at=None if held is None else ms_to_moment(held.booked.end_ms),
        mission_id=None if held is None else _shown(held, caller),
        is_out_of_order=outage is not None,
        works_again_at=None if works_again_ms is None else ms_to_moment(works_again_ms),
    )


def _reservation_info(row: Reservation, caller: Caller) -> ReservationInfo:
    return ReservationInfo(
        station_id=row.booked.station_id,
        pad=row.booked.pad,
        start_at=ms_to_moment(row.booked.start_ms),
        end_at=ms_to_moment(row.booked.end_ms),
        mission_id=_shown(row, caller),
    )


def _shown(row: Reservation, caller: Caller) -> MissionId | None:
    return row.mission_id if caller.role == "operator" else None
