"""Reads at which stations pads are occupied at a moment: reserved, or out of order."""

from typing import Final

from sqlalchemy import bindparam, func, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import StationId
from skyway.planner.pad_book import OPEN_MS
from skyway_composition.closures.store import outages
from skyway_composition.pads.occupancy import Occupancy, outages_by_pad
from skyway_composition.pads.store import booked_at, pads_of_all, used_stations
from skyway_composition.tables import pad_reservations

#: Built once, because it runs at each look of the gateway.
_HELD_NOW: Final = select(
    pad_reservations.c.station_id, pad_reservations.c.pad, pad_reservations.c.end_ms
).where(
    pad_reservations.c.start_ms <= bindparam("at_ms"),
    pad_reservations.c.end_ms > bindparam("at_ms"),
    func.coalesce(pad_reservations.c.held_until_ms, OPEN_MS) > bindparam("at_ms"),
)


async def occupied_stations(
    connection: AsyncConnection, *, at_ms: int
) -> dict[StationId, Occupancy]:
    """The occupancy of each station where a pad is reserved now or later, or is out of order."""
    found = await used_stations(connection, at_ms=at_ms)
    broken = outages_by_pad(await outages(connection, at_ms=at_ms))
    if not broken:
        return found
    others = await pads_of_all(connection, sorted(broken.keys() - found.keys()))
    found |= {station_id: Occupancy(count) for station_id, count in others.items()}
    held = await booked_at(connection, sorted(broken), moment_ms=at_ms)
    for station_id in broken.keys() & found.keys():
        taken = [
            (pad, end_ms)
            for at, pad, start_ms, end_ms, _ in held
            if at == station_id and start_ms <= at_ms
        ]
        found[station_id] = found[station_id].with_outages(taken, broken[station_id])
    return found


async def held_now(connection: AsyncConnection, *, at_ms: int) -> list[tuple[StationId, int, int]]:
    """The pads that are reserved at a moment, each with the end of its reservation."""
    found = await connection.execute(_HELD_NOW, {"at_ms": at_ms})
    return [(row.station_id, row.pad, row.end_ms) for row in found]
