"""The SQL that finds deliveries with their packages and missions, and sets single columns.

`saving_store` holds the SQL that adds and changes whole deliveries.
"""

from collections import defaultdict
from collections.abc import Sequence
from datetime import datetime
from typing import Final

from sqlalchemy import and_, bindparam, exists, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.candidate import ProviderReason
from skyway.ids import DeliveryId, MissionId
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway.units import moment_to_ms
from skyway_gateway.access.ownership_store import owned
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, FlownMission, PackageStatus
from skyway_gateway.deliveries.lifecycle.states import SETTLED_PACKAGE_STATES, UNDER_WAY_STATES
from skyway_gateway.deliveries.records.delivery_rows import (
    delivery_of,
    mission_of,
    package_of,
    reasons_text,
    stored_of,
)
from skyway_gateway.deliveries.records.stored_delivery import StoredDelivery
from skyway_gateway.tables import deliveries, missions, packages

# Statements that every delivery runs are built once: building one takes as long as running it.

_LOCKED: Final = (
    select(deliveries).where(deliveries.c.delivery_id == bindparam("this")).with_for_update()
)
#: Each visible change of a delivery that `saving_store` does not write counts as a version.
NEXT_VERSION: Final = {"version": deliveries.c.version + 1}
_PACKAGES: Final = (
    select(packages).where(in_list(packages.c.delivery_id, "ids")).order_by(packages.c.number)
)
#: Refused missions were never flown; `refusals` lists them.
_MISSIONS: Final = (
    select(missions.c.delivery_id, missions.c.state, missions.c.body)
    .where(in_list(missions.c.delivery_id, "ids"), missions.c.state != "REFUSED")
    .order_by(missions.c.attempt, missions.c.trip)
)
_REPORTED: Final = select(missions.c.report_seq).where(missions.c.mission_id == bindparam("this"))


async def lock(tx: Tx, delivery_id: DeliveryId) -> StoredDelivery:
    """A delivery, locked: no other transaction changes it until this one ends.

    Raises
    ------
    NotFound
        There is no such delivery.
    """
    found = (await tx.execute(_LOCKED, {"this": delivery_id})).all()
    if not found:
        raise NotFound("delivery", delivery_id)
    [delivery] = await with_parts(tx.connection, found)
    return stored_of(found[0], delivery)


async def one_of(connection: AsyncConnection, caller: Caller, delivery_id: DeliveryId) -> Delivery:
    """The caller's own delivery.

    Raises
    ------
    NotFound
        There is no such delivery, or it is not the caller's.
    """
    statement = select(deliveries).where(
        deliveries.c.delivery_id == delivery_id, owned(caller, deliveries.c.customer_id)
    )
    found = (await connection.execute(statement)).all()
    if not found:
        raise NotFound("delivery", delivery_id)
    [delivery] = await with_parts(connection, found)
    return delivery


async def last_report(tx: Tx, mission_id: MissionId) -> int | None:
    """The number of a mission's last report; None for a mission that is not stored yet."""
    found: int | None = (await tx.execute(_REPORTED, {"this": mission_id})).scalar()
    return found


async def with_parts(connection: AsyncConnection, found: Sequence[AnyRow]) -> Sequence[Delivery]:
    """The deliveries of these rows, with their packages and missions, in the same order."""
    ids = [row.delivery_id for row in found]
    if not ids:
        return []
    packed: dict[str, list[PackageStatus]] = defaultdict(list)
    for row in await connection.execute(_PACKAGES, {"ids": ids}):
        packed[row.delivery_id].append(package_of(row))
    flown: dict[str, list[FlownMission]] = defaultdict(list)
    # A delivery that was never booked has no missions to look for.
    booked = [row.delivery_id for row in found if row.state != "REQUESTED" or row.attempt > 1]
    for row in await connection.execute(_MISSIONS, {"ids": booked}) if booked else ():
        flown[row.delivery_id].append(mission_of(row))
    return [delivery_of(row, packed[row.delivery_id], flown[row.delivery_id]) for row in found]


async def note_reasons(tx: Tx, delivery_id: DeliveryId, reasons: Sequence[ProviderReason]) -> None:
    """Store the reasons for giving up the packages that wait, before they are given up."""
    values = {"reasons": reasons_text(reasons), **NEXT_VERSION}
    this = and_(deliveries.c.delivery_id == delivery_id, deliveries.c.is_queued)
    await tx.execute(update(deliveries).where(this).values(values))


async def note_cancelling(tx: Tx, delivery_id: DeliveryId, *, reason: str) -> None:
    """Store that the whole delivery is to be cancelled, before anything is stopped."""
    values = {"cancel_reason": reason, **NEXT_VERSION}
    this = deliveries.c.delivery_id == delivery_id
    await tx.execute(update(deliveries).where(this).values(values))


async def overdue(
    connection: AsyncConnection, *, before: datetime, limit: int
) -> Sequence[DeliveryId]:
    """Deliveries without the delayed flag that have a package with an ETA before this moment."""
    is_overdue = exists().where(
        packages.c.delivery_id == deliveries.c.delivery_id,
        packages.c.eta_ms < moment_to_ms(before),
        packages.c.state.not_in(SETTLED_PACKAGE_STATES),
    )
    statement = select(deliveries.c.delivery_id).where(
        deliveries.c.state.in_(UNDER_WAY_STATES), ~deliveries.c.is_delayed, is_overdue
    )
    found = await connection.execute(statement.order_by(deliveries.c.delivery_id).limit(limit))
    return [DeliveryId(delivery_id) for delivery_id in found.scalars()]
