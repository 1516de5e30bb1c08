"""All SQL of reserved pads, and of the occupancy of stations."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import BigInteger, bindparam, delete, func, insert, literal, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DroneId, MissionId, NetworkId, StationId
from skyway.planner.pad_book import OPEN_MS
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway.scheduling.trip import BookedPad, merged, without
from skyway_composition.closures.store import outages
from skyway_composition.pads.occupancy import Occupancy, outages_by_pad
from skyway_composition.tables import is_queued, missions, pad_reservations, stations

#: A pad reserved in [start_ms, end_ms): station, pad, start_ms, end_ms.
PadHeld = tuple[StationId, int, int, int]
#: The same with the mission that has reserved it, or the hold.
PadHeldBy = tuple[StationId, int, int, int, str]

# Built once, because every booking runs these statements and building takes longer than running.
_OWNER: Final = func.coalesce(pad_reservations.c.mission_id, pad_reservations.c.hold_id)
#: Whether a reservation counts at a moment: the pads of a hold that has expired are free.
_COUNTS: Final = func.coalesce(pad_reservations.c.held_until_ms, OPEN_MS) > bindparam("moment_ms")
_LASTING: Final = select(
    pad_reservations.c.station_id,
    pad_reservations.c.pad,
    pad_reservations.c.start_ms,
    pad_reservations.c.end_ms,
    _OWNER,
).where(
    pad_reservations.c.end_ms > bindparam("moment_ms"),
    _COUNTS,
)
_BOOKED_AT: Final = _LASTING.where(in_list(pad_reservations.c.station_id, "station_ids"))
_BOOKED_EVERYWHERE: Final = _LASTING.join(
    stations, stations.c.station_id == pad_reservations.c.station_id
).where(stations.c.network_id == bindparam("network_id"))
#: Locks stations, so that two bookings at one station run one after the other.
LOCK_STATIONS: Final = (
    select(stations.c.station_id)
    .where(in_list(stations.c.station_id, "station_ids"))
    .order_by(stations.c.station_id)
    .with_for_update()
)
_ADD: Final = insert(pad_reservations)
_HELD_BY: Final = select(pad_reservations).where(
    pad_reservations.c.mission_id == bindparam("of_mission")
)
_PADS_OF_QUEUED: Final = (
    select(pad_reservations)
    .join(missions, missions.c.mission_id == pad_reservations.c.mission_id)
    .where(missions.c.drone_id == bindparam("of_drone"), is_queued)
)
_FREE: Final = delete(pad_reservations).where(
    pad_reservations.c.mission_id == bindparam("of_mission")
)
_GIVE_UP: Final = _FREE.where(
    pad_reservations.c.station_id == bindparam("of_station"),
    pad_reservations.c.pad == bindparam("of_pad"),
    pad_reservations.c.start_ms == bindparam("from_ms"),
)

# Built once, because these statements run every second and building takes longer than running.
_PADS_OF: Final = select(stations.c.station_id, stations.c.pads).where(
    in_list(stations.c.station_id, "station_ids")
)

# The database counts, because many missions in flight have many rows at few stations.
_IS_BEGUN: Final = pad_reservations.c.start_ms <= bindparam("at_ms")

_IS_TAKEN: Final = _IS_BEGUN & (pad_reservations.c.pad < stations.c.pads)

_USED: Final = (
    select(
        stations.c.station_id,
        stations.c.pads,
        func.count().filter(_IS_TAKEN),
        func.count().filter(~_IS_BEGUN),
        func.min(pad_reservations.c.end_ms).filter(_IS_TAKEN),
    )
    .join_from(pad_reservations, stations, stations.c.station_id == pad_reservations.c.station_id)
    .where(
        pad_reservations.c.end_ms > bindparam("at_ms"),
        func.coalesce(pad_reservations.c.held_until_ms, OPEN_MS) > bindparam("at_ms"),
    )
    .group_by(stations.c.station_id, stations.c.pads)
)


async def lock_stations(tx: Tx, booked: Iterable[BookedPad]) -> None:
    """Lock stations in sorted order, so that two bookings at one station wait for each other here.

    Without these locks they could deadlock in the exclusion constraint.
    """
    if tx.dialect == "sqlite":
        return  # write transactions run one after the other
    station_ids = sorted({each.station_id for each in booked})
    if station_ids:
        await tx.execute(LOCK_STATIONS, {"station_ids": station_ids})


def reserve(tx: Tx, booked: Mapping[MissionId, Sequence[BookedPad]]) -> None:
    """Reserve pads at locked stations when the transaction ends, all or none.

    The end raises `RowRefused` for `pad_taken` when a reservation overlaps another one of the pad.
    """
    tx.add(pad_reservations, _rows(booked))


async def hold(tx: Tx, mission_id: MissionId, booked: Iterable[BookedPad]) -> None:
    """Reserve exactly these pads for a mission; its other reservations are deleted.

    Raises
    ------
    RowRefused
        Another mission holds one of the pads for some of the time.
    """
    needed = set(merged(booked))
    held = await _held_by(tx, mission_id)
    given_up, added = held - needed, needed - held
    if any(not _is_within(each, held) for each in added):
        # Locked before the rows are deleted; otherwise two missions could deadlock.
        await lock_stations(tx, given_up | added)
    if given_up:
        rows = [
            {
                "of_station": each.station_id,
                "of_pad": each.pad,
                "from_ms": each.start_ms,
                "of_mission": mission_id,
            }
            for each in given_up
        ]
        await tx.execute(_GIVE_UP, rows)
    await _insert(tx, {mission_id: sorted(added)})


async def free(tx: Tx, mission_id: MissionId) -> None:
    """Delete all reservations of a mission."""
    await tx.execute(_FREE, {"of_mission": mission_id})


async def booked_at(
    connection: AsyncConnection,
    station_ids: Sequence[StationId],
    *,
    moment_ms: int,
) -> list[PadHeldBy]:
    """The reservations at these stations that end after a moment.

    Pads that are held for an offer count until the hold expires.
    """
    selection = {"station_ids": station_ids, "moment_ms": moment_ms}
    return [*await connection.execute(_BOOKED_AT, selection)]


async def booked_everywhere(
    connection: AsyncConnection,
    network_id: NetworkId,
    *,
    moment_ms: int,
) -> list[PadHeldBy]:
    """The reservations of a whole network that end after a moment."""
    selection = {"network_id": network_id, "moment_ms": moment_ms}
    return [*await connection.execute(_BOOKED_EVERYWHERE, selection)]


async def pads_of_queued(connection: AsyncConnection, drone_id: DroneId) -> list[BookedPad]:
    """The pads that the QUEUED missions of a drone hold."""
    found = await connection.execute(_PADS_OF_QUEUED, {"of_drone": drone_id})
    return [_booked(row) for row in found]


async def give_way(tx: Tx, mission_id: MissionId, booked: Collection[BookedPad]) -> None:
    """Give up what a mission holds of these pads; the same drone's next mission reserves them."""
    await hold(tx, mission_id, without(await _held_by(tx, mission_id), booked))


async def _held_by(tx: Tx, mission_id: MissionId) -> set[BookedPad]:
    found = await tx.execute(_HELD_BY, {"of_mission": mission_id})
    return {_booked(row) for row in found}


def _booked(row: AnyRow) -> BookedPad:
    return BookedPad(row.station_id, row.pad, row.start_ms, row.end_ms)


def _is_within(session: BookedPad, held: Iterable[BookedPad]) -> bool:
    """Whether a session lies within a session that is held."""
    return any(
        (session.station_id, session.pad) == (each.station_id, each.pad)
        and each.start_ms <= session.start_ms
        and session.end_ms <= each.end_ms
        for each in held
    )


async def _insert(tx: Tx, booked: Mapping[MissionId, Iterable[BookedPad]]) -> None:
    rows = _rows(booked)
    if rows:
        await tx.execute(_ADD, rows)


def _rows(
    booked: Mapping[MissionId, Iterable[BookedPad]],
) -> list[dict[str, Any]]:  # column values of any type
    return [
        {
            "station_id": each.station_id,
            "pad": each.pad,
            "start_ms": each.start_ms,
            "end_ms": each.end_ms,
            "mission_id": mission_id,
        }
        for mission_id, pads in booked.items()
        for each in pads
    ]


@dataclass(frozen=True, slots=True)
class Reservation:
    """A reserved pad and the mission that holds it; None while it is held for an offer."""

    booked: BookedPad
    mission_id: MissionId | None


async def pads_of(connection: AsyncConnection, station_id: StationId) -> int | None:
    """The number of pads of a station; None when there is no such station."""
    found = await connection.execute(
        select(stations.c.pads).where(stations.c.station_id == station_id)
    )
    pads: int | None = found.scalar_one_or_none()
    return pads


async def reservations_of(
    connection: AsyncConnection,
    station_id: StationId,
    *,
    ending_after_ms: int,
    after: tuple[int, int] | None,
    limit: int,
) -> list[Reservation]:
    """A station's reservations in order of (start, pad), after a given one.

    Pads that are held for an offer count until the hold expires.
    """
    query = (
        select(pad_reservations)
        .where(
            pad_reservations.c.station_id == station_id,
            pad_reservations.c.end_ms > ending_after_ms,
            func.coalesce(pad_reservations.c.held_until_ms, OPEN_MS) > ending_after_ms,
        )
        .order_by(pad_reservations.c.start_ms, pad_reservations.c.pad)
        .limit(limit)
    )
    if after is not None:
        start_ms = after[0]
        pad = literal(after[1], BigInteger)  # an invented cursor may exceed any pad's number
        query = query.where(
            (pad_reservations.c.start_ms > start_ms)
            | ((pad_reservations.c.start_ms == start_ms) & (pad_reservations.c.pad > pad))
        )
    found = await connection.execute(query)
    return [Reservation(_booked(row), row.mission_id) for row in found]


async def used_stations(connection: AsyncConnection, *, at_ms: int) -> dict[StationId, Occupancy]:
    """The occupancy of each station that has a reservation now or later."""
    found = await connection.execute(_USED, {"at_ms": at_ms})
    return {station_id: Occupancy(*use) for station_id, *use in found}


async def pads_of_all(
    connection: AsyncConnection, station_ids: Sequence[StationId]
) -> dict[StationId, int]:
    """The number of pads of these stations."""
    found = await connection.execute(_PADS_OF, {"station_ids": station_ids})
    return {row.station_id: row.pads for row in found}


async def pads_everywhere(connection: AsyncConnection) -> dict[StationId, int]:
    """The number of pads of every station."""
    found = await connection.execute(select(stations.c.station_id, stations.c.pads))
    return {row.station_id: row.pads for row in found}


async def stations_of(
    connection: AsyncConnection, network_ids: Sequence[NetworkId]
) -> set[StationId]:
    """The stations of these networks."""
    query = select(stations.c.station_id).where(stations.c.network_id.in_(network_ids))
    return set((await connection.execute(query)).scalars())


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
