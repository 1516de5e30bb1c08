"""All SQL of reservations of pads."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from sqlalchemy import bindparam, delete, insert, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import MissionId, NetworkId, StationId
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway_composition.pads.booked_pad import BookedPad, merged
from skyway_composition.tables import pad_reservations, stations

#: A pad reserved in [start_ms, end_ms): station, pad, start_ms, end_ms.
PadHeld = tuple[StationId, int, int, int]

#: Used when no mission's pads count as free.
_NO_MISSION: Final = MissionId("")

# Built once, because every booking runs these statements and building takes longer than running.
_LASTING: Final = select(
    pad_reservations.c.station_id,
    pad_reservations.c.pad,
    pad_reservations.c.start_ms,
    pad_reservations.c.end_ms,
).where(
    pad_reservations.c.end_ms > bindparam("moment_ms"),
    pad_reservations.c.mission_id != bindparam("without"),
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
_FREE: Final = delete(pad_reservations).where(
    pad_reservations.c.mission_id == bindparam("of_mission")
)
_GIVE_UP: Final = _FREE.where(
    pad_reservations.c.station_id == bindparam("of_station"),
    pad_reservations.c.pad == bindparam("of_pad"),
    pad_reservations.c.start_ms == bindparam("from_ms"),
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

    The end raises `Taken` for `pad_taken` when a reservation overlaps another one of the same pad.
    """
    tx.add(pad_reservations, _rows(booked))


async def hold(tx: Tx, mission_id: MissionId, booked: Iterable[BookedPad]) -> None:
    """Reserve exactly these pads for a mission; its other reservations are deleted.

    Raises
    ------
    Taken
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
    without_mission_id: MissionId | None = None,
) -> list[PadHeld]:
    """The reservations at these stations that end after a moment."""
    selection = {
        "station_ids": station_ids,
        "moment_ms": moment_ms,
        "without": without_mission_id or _NO_MISSION,
    }
    return [*await connection.execute(_BOOKED_AT, selection)]


async def booked_everywhere(
    connection: AsyncConnection,
    network_id: NetworkId,
    *,
    moment_ms: int,
    without_mission_id: MissionId | None = None,
) -> list[PadHeld]:
    """The reservations at all stations of a network that end after a moment."""
    selection = {
        "network_id": network_id,
        "moment_ms": moment_ms,
        "without": without_mission_id or _NO_MISSION,
    }
    return [*await connection.execute(_BOOKED_EVERYWHERE, selection)]


async def _held_by(tx: Tx, mission_id: MissionId) -> set[BookedPad]:
    found = await tx.execute(_HELD_BY, {"of_mission": mission_id})
    return {BookedPad(row.station_id, row.pad, row.start_ms, row.end_ms) for row in found}


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
