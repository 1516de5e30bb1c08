"""All SQL of what waits: which calendars to look at, how missions move, and better orders."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import (
    ColumnElement,
    and_,
    bindparam,
    delete,
    exists,
    func,
    literal_column,
    or_,
    select,
    union_all,
    update,
)
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.candidate import Candidate
from skyway.ids import DeliveryId, DroneId, MissionId, NetworkId, ProviderId, StationId
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway_composition.missions.mission.record import PROMISED, MissionRecord, read_record
from skyway_composition.missions.mission.share import Share
from skyway_composition.tables import (
    better_orders,
    drone_links,
    guests,
    is_live,
    is_open,
    is_queued,
    missions,
    networks,
)
from skyway_composition.tables.missions import DAY_MS

_next: Final = (
    select(missions.c.drone_id, func.min(missions.c.start_ms).label("start_ms"))
    .where(is_queued)
    .group_by(missions.c.drone_id)
    .subquery("next")
)
_before: Final = select(missions).where(is_live).subquery("before")
_queued: Final = missions.alias("queued")
#: A plan of an earlier network, or a provisional promise that has to become firm.
_is_outdated: Final = exists().where(
    _queued.c.drone_id == _next.c.drone_id,
    # A literal: with a parameter PostgreSQL does not take the index of queued missions, and reads
    # all missions that ever were.
    _queued.c.state == literal_column("'QUEUED'"),
    networks.c.network_id == _queued.c.network_id,
    or_(
        networks.c.version != _queued.c.planned_version,
        networks.c.conditions != _queued.c.planned_conditions,
        _queued.c.firm_ms <= bindparam("now_ms"),
    ),
)
#: The drones whose calendar may have to change.
TO_LOOK_AT: Final = (
    select(_next.c.drone_id)
    .select_from(_next.outerjoin(_before, _before.c.drone_id == _next.c.drone_id))
    .where(
        or_(
            and_(
                _before.c.mission_id.is_(None),
                _next.c.start_ms < bindparam("soon_ms"),
            ),
            and_(
                _before.c.released_ms > _next.c.start_ms - bindparam("hand_over_ms"),
                _before.c.proposal.is_(None),
            ),
            _is_outdated,
            # Its drone may be silent for ever.
            _next.c.start_ms < bindparam("overdue_ms"),
        )
    )
    .order_by(_next.c.start_ms)
)


async def drones_to_look_at(
    connection: AsyncConnection, *, now_ms: int, soon_ms: int, hand_over_ms: int, overdue_ms: int
) -> list[DroneId]:
    """The drones whose next mission may begin, does not fit, or has an outdated plan.

    Also drones with a QUEUED mission whose promise becomes firm by `now_ms`. A mission may begin
    when its drone is idle and its start lies before `soon_ms`. Drones whose next mission should
    have begun before `overdue_ms` are found too.
    """
    moments = {"now_ms": now_ms, "soon_ms": soon_ms, "hand_over_ms": hand_over_ms}
    found = await connection.execute(TO_LOOK_AT, moments | {"overdue_ms": overdue_ms})
    return list(found.scalars())


async def drones_with_queue(connection: AsyncConnection) -> list[DroneId]:
    """The drones that have a QUEUED mission."""
    found = await connection.execute(select(missions.c.drone_id).distinct().where(is_queued))
    return [DroneId(each) for each in found.scalars()]


async def save_start(tx: Tx, mission_id: MissionId, candidate: Candidate) -> None:
    """Save which provider's drone flies a QUEUED mission that was planned again, from where."""
    await tx.execute(
        update(missions)
        .where(missions.c.mission_id == mission_id)
        .values(
            provider_id=candidate.provider_id,
            drone_id=candidate.drone_id,
            candidate=candidate.model_dump_json(),
        )
    )


async def free_times(tx: Tx, mission_ids: Collection[MissionId]) -> None:
    """Make these QUEUED missions take no time of their drone until they are saved again.

    Without this, a mission that moves could overlap another one that has not moved yet.
    """
    await tx.execute(
        update(missions)
        .where(in_list(missions.c.mission_id, "mission_ids"), is_queued)
        .values(served_ms=missions.c.start_ms),
        {"mission_ids": [*mission_ids]},
    )


_WAITING_FLEETS: Final = (
    select(missions.c.network_id, missions.c.provider_id, func.count().label("waiting"))
    .group_by(missions.c.network_id, missions.c.provider_id)
    .where(is_queued, missions.c.start_ms > bindparam("after_ms"))
    .order_by(missions.c.network_id, missions.c.provider_id)
)
#: A drone that refuses a mission has refused its guests too.
_REFUSALS: Final = union_all(
    select(missions.c.delivery_id, missions.c.drone_id).where(
        in_list(missions.c.delivery_id, "delivery_ids"), missions.c.state == "REFUSED"
    ),
    select(guests.c.delivery_id, missions.c.drone_id)
    .join(missions, missions.c.mission_id == guests.c.host_id)
    .where(in_list(guests.c.delivery_id, "delivery_ids"), missions.c.state == "REFUSED"),
)
_SEVERAL_TRIPS: Final = (
    select(missions.c.delivery_id)
    .distinct()
    .where(in_list(missions.c.delivery_id, "delivery_ids"), missions.c.trip > 1)
)

_HOSTS_AT: Final = (
    select(missions.c.mission_id, missions.c.pooling_at, missions.c.start_ms)
    .where(
        is_queued,
        missions.c.firm_ms.is_(None),
        missions.c.network_id == bindparam("network_id"),
        in_list(missions.c.pooling_at, "station_ids"),
        in_list(missions.c.provider_id, "provider_ids"),
    )
    .order_by(missions.c.start_ms, missions.c.mission_id)
)
_HOSTS: Final = select(missions).where(in_list(missions.c.mission_id, "mission_ids"), is_queued)


@dataclass(frozen=True, slots=True)
class OpenMissions:
    """Missions that are not over, by drone and start, and the numbers of the drones' calendars.

    A mission that was sent comes before the QUEUED missions of its drone.
    """

    records: Sequence[MissionRecord]
    versions: Mapping[DroneId, int]


async def waiting_fleets(
    connection: AsyncConnection, *, after_ms: int
) -> dict[NetworkId, dict[ProviderId, int]]:
    """How many QUEUED missions begin after this moment, by network and provider."""
    fleets: dict[NetworkId, dict[ProviderId, int]] = {}
    for row in await connection.execute(_WAITING_FLEETS, {"after_ms": after_ms}):
        fleets.setdefault(row.network_id, {})[row.provider_id] = row.waiting
    return fleets


async def open_missions_of(
    connection: AsyncConnection, network_id: NetworkId, provider_ids: Collection[ProviderId]
) -> OpenMissions:
    """The missions of these providers in a network that are not over."""
    is_of_fleet = and_(
        missions.c.network_id == network_id, missions.c.provider_id.in_(provider_ids)
    )
    return await _open_missions(
        connection, or_(and_(is_queued, is_of_fleet), and_(is_live, is_of_fleet))
    )


async def hosts_at(
    connection: AsyncConnection,
    network_id: NetworkId,
    ready_ms: Mapping[StationId, int],
    *,
    provider_ids: Collection[ProviderId],
    limit: int,
) -> list[MissionRecord]:
    """QUEUED missions of these providers with a pickup at these stations that may be shared.

    Their promises are firm.

    At most `limit`. `ready_ms` says when the packages can be at each station, and is 0 for the
    request's own pickup. Missions at this pickup come first. Missions follow that start when the
    packages can be there or later; both are in the order of their starts. The last ones start
    sooner and would have to wait, the shortest wait first.
    """
    waiting = await connection.execute(
        _HOSTS_AT,
        {
            "network_id": network_id,
            "station_ids": sorted(ready_ms),
            "provider_ids": sorted(provider_ids),
        },
    )

    def turn(row: Any) -> tuple[bool, int]:  # a row
        at_ms = ready_ms[row.pooling_at]
        return at_ms > 0, max(0, at_ms - row.start_ms)

    ids = [row.mission_id for row in sorted(waiting, key=turn)[:limit]]
    if not ids:
        return []
    records = map(read_record, await connection.execute(_HOSTS, {"mission_ids": ids}))
    found = {each.mission_id: each for each in records}
    return [found[each] for each in ids if each in found]


async def open_missions_on(
    connection: AsyncConnection, drone_ids: Collection[DroneId]
) -> OpenMissions:
    """The missions of these drones that are not over."""
    return await _open_missions(connection, and_(missions.c.drone_id.in_(drone_ids), is_open))


async def _open_missions(connection: AsyncConnection, where: ColumnElement[bool]) -> OpenMissions:
    """One statement reads the missions and the numbers, so that they belong together."""
    found = await connection.execute(
        select(missions, drone_links.c.calendar_version)
        .join(drone_links, drone_links.c.drone_id == missions.c.drone_id)
        .where(where)
        .order_by(missions.c.drone_id, is_queued, missions.c.start_ms)
    )
    rows = found.all()
    return OpenMissions(
        [read_record(row) for row in rows], {row.drone_id: row.calendar_version for row in rows}
    )


async def save_promises(tx: Tx, record: MissionRecord) -> None:
    """Save the promised arrival times of a mission."""
    await tx.execute(
        update(missions)
        .where(missions.c.mission_id == record.mission_id)
        .values(promised=PROMISED.dump_json(record.promised).decode())
    )


def add_guest(tx: Tx, record: MissionRecord, guest: Share) -> None:
    """Add a guest of this mission when the transaction ends.

    The transaction then fails with `RowRefused` (`guest_attempt`) if the attempt was booked before.
    """
    row = {
        "mission_id": guest.mission_id,
        "host_id": record.mission_id,
        "delivery_id": guest.delivery_id,
        "attempt": guest.attempt,
    }
    tx.add(guests, [row])


async def delete_mission(tx: Tx, mission_id: MissionId) -> None:
    """Delete a QUEUED mission that has no steps, pads or custody any more."""
    await tx.execute(delete(missions).where(missions.c.mission_id == mission_id, is_queued))


async def with_several_trips(
    connection: AsyncConnection, delivery_ids: Collection[DeliveryId]
) -> frozenset[DeliveryId]:
    """The deliveries among these that one booking has split over several missions."""
    found = await connection.execute(_SEVERAL_TRIPS, {"delivery_ids": [*delivery_ids]})
    return frozenset(found.scalars())


async def refusals_of(
    connection: AsyncConnection, delivery_ids: Collection[DeliveryId]
) -> frozenset[tuple[DeliveryId, DroneId]]:
    """The drones that have refused missions of these deliveries, with the delivery."""
    found = await connection.execute(_REFUSALS, {"delivery_ids": [*delivery_ids]})
    return frozenset((row.delivery_id, row.drone_id) for row in found)


async def note_better_order(
    tx: Tx, provider_id: ProviderId, *, moves: int, saved_s: float, at_ms: int
) -> None:
    """Note that an order was adopted: the missions that changed drones, and what it saves."""
    row = {
        "provider_id": provider_id,
        "day_ms": at_ms - at_ms % DAY_MS,
        "orders": 1,
        "moves": moves,
        "saved_ms": round(saved_s * 1000),
    }
    added = tx.insert(better_orders)
    sums = {
        name: better_orders.c[name] + added.excluded[name]
        for name in ("orders", "moves", "saved_ms")
    }
    upsert = added.on_conflict_do_update(index_elements=["provider_id", "day_ms"], set_=sums)
    await tx.execute(upsert, row)
