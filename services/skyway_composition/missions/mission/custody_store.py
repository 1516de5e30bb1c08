"""Who holds each package: a chain from the pickup station to the recipient, and all its SQL.

A chain only grows; its links are never changed. Only the mission of a link changes, if another
mission carries the packages before any drone has them.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any, Final, Literal

from sqlalchemy import RowMapping, insert, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DeliveryId, DroneId, MissionId, PackageId, StationId
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.share_views import owner_of
from skyway_composition.tables import custody

CustodianKind = Literal["STATION", "DRONE", "RECIPIENT"]

# Every booking and every message of a drone needs these statements. Building them takes longer
# than running them, so they are built once.
_CHAINS: Final = (
    select(custody).where(in_list(custody.c.delivery_id, "delivery_ids")).order_by(custody.c.seq)
)

_ADD_CUSTODY: Final = insert(custody)


@dataclass(frozen=True, slots=True)
class Custodian:
    """Who holds a package: a station or a drone by its id, or the recipient at a station."""

    kind: CustodianKind
    custodian_id: str


@dataclass(frozen=True, slots=True)
class Held:
    """The newest link of a package's chain."""

    package_id: PackageId
    seq: int
    custodian: Custodian


@dataclass(frozen=True, slots=True)
class ChainLink:
    """A link of a package's chain: which mission made it, and when."""

    held: Held
    mission_id: MissionId
    at: datetime


def may_load(held: Held | None) -> bool:
    """Whether a drone may take a package on board: from a station only.

    A recipient never passes a package on, and no drone takes a package from another drone.
    """
    return held is None or held.custodian.kind == "STATION"


def carried_by(held: Mapping[PackageId, Held], drone_id: DroneId) -> frozenset[PackageId]:
    """The packages that this drone holds."""
    drone = Custodian("DRONE", drone_id)
    return frozenset(each.package_id for each in held.values() if each.custodian == drone)


def on_board(held: Mapping[PackageId, Held]) -> frozenset[PackageId]:
    """The packages that a drone holds."""
    return _held_by(held, "DRONE")


def delivered(held: Mapping[PackageId, Held]) -> frozenset[PackageId]:
    """The packages that their recipients have."""
    return _held_by(held, "RECIPIENT")


def returned(held: Mapping[PackageId, Held], pickup: StationId) -> frozenset[PackageId]:
    """The packages that were on board and are back at the pickup station."""
    station = Custodian("STATION", pickup)
    return frozenset(
        each.package_id for each in held.values() if each.custodian == station and each.seq > 1
    )


def left_behind(held: Mapping[PackageId, Held], pickup: StationId) -> frozenset[PackageId]:
    """The packages that a drone has left at a station other than the pickup."""
    return frozenset(
        each.package_id
        for each in held.values()
        if each.custodian.kind == "STATION" and each.custodian.custodian_id != pickup
    )


def has_never_left(held: Held | None) -> bool:
    """Whether a package has never left the pickup station."""
    return held is None or (held.custodian.kind == "STATION" and held.seq == 1)


def _held_by(held: Mapping[PackageId, Held], kind: CustodianKind) -> frozenset[PackageId]:
    return frozenset(each.package_id for each in held.values() if each.custodian.kind == kind)


class LiveCustody:
    """The chains of live missions' packages in the transaction that has locked the missions.

    The chains of all their deliveries are read together, once. They grow only through this object.
    """

    def __init__(self, tx: Tx, delivery_ids: Collection[DeliveryId]) -> None:
        self._tx = tx
        self._delivery_ids = frozenset(delivery_ids)
        self._read: dict[DeliveryId, list[ChainLink]] = {}

    async def chain_links(self, record: MissionRecord) -> list[ChainLink]:
        """The chains of all packages of a mission's deliveries, each in its order.

        A guest's packages have the ids under which they fly.
        """
        if not record.shares:
            return await self._chain(record.mission.delivery_id)
        links: list[ChainLink] = []
        for share in record.shares:
            flown = {own: flying for flying, own in share.packages.items()}
            links += [
                replace(each, held=replace(each.held, package_id=flown[each.held.package_id]))
                for each in await self._chain(share.delivery_id)
                if each.held.package_id in flown
            ]
        return sorted(links, key=lambda each: each.held.seq)

    async def held_on(self, record: MissionRecord) -> dict[PackageId, Held]:
        """Who holds each package of a mission's deliveries now, by the ids under which they fly."""
        return {each.held.package_id: each.held for each in await self.chain_links(record)}

    async def add(self, record: MissionRecord, rows: Collection[Held], *, at_ms: int) -> None:
        """Add links to the packages' chains; each number occurs once in a chain."""
        added = _custody_rows(record, rows, at_ms=at_ms)
        if added:
            await self._tx.execute(_ADD_CUSTODY, added)
        for row in added:
            if (chain := self._read.get(row["delivery_id"])) is not None:
                longer = sorted((*chain, _link(row)), key=lambda each: each.held.seq)
                self._read[row["delivery_id"]] = longer

    async def give(self, mission_id: MissionId, *, to: MissionId) -> None:
        """Give a mission's links to the mission that carries its packages now."""
        given = update(custody).where(custody.c.mission_id == mission_id)
        await self._tx.execute(given.values(mission_id=to))
        self._read.clear()

    async def _chain(self, delivery_id: DeliveryId) -> list[ChainLink]:
        if delivery_id not in self._read:
            unread = {delivery_id, *self._delivery_ids} - self._read.keys()
            self._read |= await _chains(self._tx.connection, unread)
        return self._read[delivery_id]


async def held_packages(
    connection: AsyncConnection, delivery_id: DeliveryId
) -> dict[PackageId, Held]:
    """Who holds each package of a delivery now."""
    links = (await _chains(connection, [delivery_id]))[delivery_id]
    return {each.held.package_id: each.held for each in links}


async def _chains(
    connection: AsyncConnection, delivery_ids: Collection[DeliveryId]
) -> dict[DeliveryId, list[ChainLink]]:
    chains: dict[DeliveryId, list[ChainLink]] = {each: [] for each in delivery_ids}
    found = await connection.execute(_CHAINS, {"delivery_ids": [*delivery_ids]})
    for row in found.mappings():
        chains[row["delivery_id"]].append(_link(row))
    return chains


def _link(row: Mapping[str, Any] | RowMapping) -> ChainLink:  # column values of any type
    held = Held(
        row["package_id"], row["seq"], Custodian(row["custodian_kind"], row["custodian_id"])
    )
    return ChainLink(held, row["mission_id"], ms_to_moment(row["at_ms"]))


def begin_at_pickup(tx: Tx, record: MissionRecord, package_ids: Collection[PackageId]) -> None:
    """Add the first links of these packages when the transaction ends: the pickup has them."""
    station = Custodian("STATION", record.request.pickup.station_id)
    rows = [Held(each, 1, station) for each in package_ids]
    tx.add(custody, _custody_rows(record, rows, at_ms=moment_to_ms(record.mission.start_at)))


def _custody_rows(
    record: MissionRecord, rows: Collection[Held], *, at_ms: int
) -> list[dict[str, Any]]:  # column values of any type
    owners = [owner_of(record, held.package_id) for held in rows]
    return [
        {
            "delivery_id": delivery_id,
            "package_id": package_id,
            "seq": held.seq,
            "custodian_kind": held.custodian.kind,
            "custodian_id": held.custodian.custodian_id,
            "mission_id": record.mission_id,
            "at_ms": at_ms,
        }
        for (delivery_id, package_id), held in zip(owners, rows, strict=True)
    ]
