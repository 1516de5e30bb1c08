"""All SQL of links to drones."""

from collections.abc import Collection, Iterable, Mapping
from typing import Any, Final

from sqlalchemy import BigInteger, Row, Text, bindparam, case, func, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.drone_report import Connection, DroneState
from skyway.ids import DroneId, ProviderId
from skyway.json_model import JsonCache
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway_composition.links.link import DroneLink, InstructionPlace
from skyway_composition.tables import drone_links

#: Those of `drone_ids` that report a mission, or have landed away from every station.
OCCUPIED: Final = select(drone_links.c.drone_id).where(
    in_list(drone_links.c.drone_id, "drone_ids"), drone_links.c.is_occupied
)

#: Those of `drone_ids` that another hold than `own_hold` keeps for a customer at `now_ms`.
HELD: Final = select(drone_links.c.drone_id).where(
    in_list(drone_links.c.drone_id, "drone_ids"),
    drone_links.c.held_by.is_not(None),
    drone_links.c.held_by != bindparam("own_hold", type_=Text),
    drone_links.c.held_until_ms > bindparam("now_ms", type_=BigInteger),
)

# Built once, because every booking and every drone message runs these statements, and building
# takes longer than running.
_LINKS_OF: Final = (
    select(drone_links)
    .where(in_list(drone_links.c.drone_id, "drone_ids"))
    .order_by(drone_links.c.drone_id)
    .with_for_update()
)
_SAVE_LINK: Final = update(drone_links).where(drone_links.c.drone_id == bindparam("of_drone"))
#: Counts one more instruction, with a new mission, to a drone that is not held at `now_ms`, and
#: returns its place.
COUNT_NEXT: Final = (
    update(drone_links)
    .where(
        drone_links.c.drone_id == bindparam("of_drone"),
        func.coalesce(drone_links.c.held_until_ms, 0) <= bindparam("now_ms", type_=BigInteger),
    )
    .values(
        provider_id=bindparam("of_provider"),
        stream=case((drone_links.c.stream < 1, 1), else_=drone_links.c.stream),
        last_seq=drone_links.c.last_seq + 1,
        calendar_version=drone_links.c.calendar_version + 1,
    )
    .returning(
        drone_links.c.drone_id,
        drone_links.c.provider_id,
        drone_links.c.stream,
        drone_links.c.last_seq,
        drone_links.c.last_event_seq,
    )
)


# The next message of a drone comes soon, most often to this replica. About 3 KiB each.
_STATES: Final = JsonCache(DroneState, most=4_000)
_CONNECTIONS: Final = JsonCache(Connection, most=4_000)


async def lock_or_add_links(
    tx: Tx, providers: Mapping[DroneId, ProviderId], drone_ids: Collection[DroneId]
) -> dict[DroneId, DroneLink]:
    """Lock the links to these drones; a drone in `providers` gets a link if it has none."""
    links = await lock_links(tx, drone_ids)
    added = [each for each in sorted(providers) if each not in links]
    if not added:
        return links
    for drone_id in added:
        await _begin(tx, drone_id, providers[drone_id])
    return await lock_links(tx, drone_ids)


async def claim_next_place(
    tx: Tx, drone_id: DroneId, provider_id: ProviderId, *, now_ms: int
) -> InstructionPlace | None:
    """Claim the place of the next instruction to this provider's locked drone: a new mission.

    Returns None while the drone is held for a customer at `now_ms`, fleet time.
    """
    drone = {"of_drone": drone_id, "of_provider": provider_id, "now_ms": now_ms}
    claimed = (await tx.execute(COUNT_NEXT, drone)).one_or_none()
    return None if claimed is None else InstructionPlace(*claimed)


async def lock_links(tx: Tx, drone_ids: Collection[DroneId]) -> dict[DroneId, DroneLink]:
    """Lock the links to these drones and return them; a drone without a link is left out."""
    found = await tx.execute(_LINKS_OF, {"drone_ids": sorted(drone_ids)})
    return {row.drone_id: _link(row) for row in found}


async def link_to(connection: AsyncConnection, drone_id: DroneId) -> DroneLink | None:
    """The link to a drone; None without one."""
    found = await connection.execute(select(drone_links).where(drone_links.c.drone_id == drone_id))
    row = found.one_or_none()
    return None if row is None else _link(row)


async def links_to(
    connection: AsyncConnection, drone_ids: Collection[DroneId]
) -> dict[DroneId, DroneLink]:
    """The links to these drones, not locked; a drone without a link is left out."""
    query = select(drone_links).where(in_list(drone_links.c.drone_id, "drone_ids"))
    found = await connection.execute(query, {"drone_ids": sorted(drone_ids)})
    return {row.drone_id: _link(row) for row in found}


async def held_among(
    connection: AsyncConnection, drone_ids: Collection[DroneId], *, now_ms: int
) -> frozenset[DroneId]:
    """Which of these drones are held for a customer at this moment, fleet time."""
    values = {"drone_ids": [*drone_ids], "own_hold": "", "now_ms": now_ms}
    return frozenset((await connection.execute(HELD, values)).scalars())


async def states_of(
    connection: AsyncConnection, drone_ids: Collection[DroneId]
) -> dict[DroneId, DroneState]:
    """The last state that each of these drones has reported, if any."""
    query = select(drone_links.c.drone_id, drone_links.c.state).where(
        drone_links.c.drone_id.in_(sorted(drone_ids)), drone_links.c.state.is_not(None)
    )
    return {row.drone_id: _STATES.read(row.state) for row in await connection.execute(query)}


async def renewals_of(
    connection: AsyncConnection, drone_ids: Collection[DroneId]
) -> dict[DroneId, int]:
    """When the credentials of these drones were renewed last, if ever: fleet ms."""
    query = select(drone_links.c.drone_id, drone_links.c.renewed_ms).where(
        drone_links.c.drone_id.in_(sorted(drone_ids)), drone_links.c.renewed_ms.is_not(None)
    )
    return {row.drone_id: row.renewed_ms for row in await connection.execute(query)}


async def save_link(tx: Tx, link: DroneLink) -> None:
    """Store a link that this transaction has locked."""
    await tx.execute(_SAVE_LINK, {"of_drone": link.drone_id, **_values(link)})


def save_last_links(
    tx: Tx, links: Iterable[DroneLink], *, changed_calendars: Collection[DroneId] = ()
) -> None:
    """Store locked links at the end of a transaction, which reads no links after this.

    The numbers of `changed_calendars` are raised.
    """
    rows = [
        {
            "drone_id": link.drone_id,
            "calendar_version": int(link.drone_id in changed_calendars),
            **_values(link),
        }
        for link in links
    ]
    tx.update_rows(drone_links, {}, rows, key="drone_id", increments=["calendar_version"])


def _values(link: DroneLink) -> dict[str, Any]:  # column values of any type
    return {
        "provider_id": link.provider_id,
        "stream": link.stream,
        "last_seq": link.last_seq,
        "acked_stream": link.acked_stream,
        "acked_session": link.acked_session,
        "last_event_seq": link.last_event_seq,
        "report_asked_wall_ms": link.report_asked_wall_ms,
        "state": None if link.state is None else _STATES.write(link.state),
        "is_occupied": link.is_occupied,
        "connection": None if link.connection is None else _CONNECTIONS.write(link.connection),
        "renewed_ms": link.renewed_ms,
    }


async def _begin(tx: Tx, drone_id: DroneId, provider_id: ProviderId) -> None:
    fresh = DroneLink(drone_id, provider_id)
    row = {
        "drone_id": drone_id,
        "provider_id": provider_id,
        "stream": fresh.stream,
        "last_seq": fresh.last_seq,
        "acked_stream": fresh.acked_stream,
        "acked_session": fresh.acked_session,
        "last_event_seq": fresh.last_event_seq,
        "report_asked_wall_ms": fresh.report_asked_wall_ms,
    }
    await tx.execute(tx.insert(drone_links).on_conflict_do_nothing(), row)


def _link(row: Row[Any]) -> DroneLink:  # a row of drone_links
    return DroneLink(
        drone_id=row.drone_id,
        provider_id=row.provider_id,
        stream=row.stream,
        last_seq=row.last_seq,
        acked_stream=row.acked_stream,
        acked_session=row.acked_session,
        last_event_seq=row.last_event_seq,
        report_asked_wall_ms=row.report_asked_wall_ms,
        state=None if row.state is None else _STATES.read(row.state),
        connection=None if row.connection is None else _CONNECTIONS.read(row.connection),
        renewed_ms=row.renewed_ms,
        calendar_version=row.calendar_version,
    )
