"""Reads at which stations pads are occupied at a moment: reserved, or out of order."""

from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import StationId
from skyway_composition.closures.store import outages
from skyway_composition.pads.occupancy import Occupancy, outages_by_pad
from skyway_composition.pads.store import booked_at, pads_of_all, used_stations


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
