"""All SQL of tracking links: which link of a delivery is in use, and what it shows."""

from dataclasses import dataclass
from datetime import datetime
from typing import Final

from sqlalchemy import select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.delivery_event import DeliveryEvent
from skyway.ids import DeliveryId
from skyway.runtime.sql.database import Tx
from skyway_gateway.deliveries.lifecycle.delivery import TERMINAL_STATES, Delivery
from skyway_gateway.deliveries.records.delivery_store import with_parts
from skyway_gateway.delivery_tables import deliveries
from skyway_gateway.tables import events, tracking_links
from skyway_gateway.tracking_links import FIRST_LINK

#: The types of the events with which a delivery ends; each delivery has one of them at most.
_ENDS: Final = tuple(f"delivery.{state.lower()}" for state in sorted(TERMINAL_STATES))


@dataclass(frozen=True, slots=True)
class LinkInUse:
    """The number of a delivery's present link, and whether its customer has withdrawn it."""

    number: int = FIRST_LINK
    is_withdrawn: bool = False


async def link_of(connection: AsyncConnection, delivery_id: DeliveryId) -> LinkInUse:
    """The link of a delivery; the first one, if it was never renewed or withdrawn."""
    this = tracking_links.c.delivery_id == delivery_id
    row = (await connection.execute(select(tracking_links).where(this))).one_or_none()
    return LinkInUse() if row is None else LinkInUse(row.number, row.is_withdrawn)


async def renew(tx: Tx, delivery_id: DeliveryId) -> int:
    """Make another link the present one, and return its number."""
    values = {"delivery_id": delivery_id, "number": FIRST_LINK + 1, "is_withdrawn": False}
    statement = tx.insert(tracking_links).values(values)
    changes = {"number": tracking_links.c.number + 1, "is_withdrawn": False}
    statement = statement.on_conflict_do_update(index_elements=["delivery_id"], set_=changes)
    found = await tx.execute(statement.returning(tracking_links.c.number))
    return int(found.scalar_one())


async def withdraw(tx: Tx, delivery_id: DeliveryId) -> None:
    """End the present link; a later renewal makes another one."""
    values = {"delivery_id": delivery_id, "number": FIRST_LINK, "is_withdrawn": True}
    statement = tx.insert(tracking_links).values(values)
    await tx.execute(
        statement.on_conflict_do_update(index_elements=["delivery_id"], set_={"is_withdrawn": True})
    )


async def delivery_named(connection: AsyncConnection, delivery_id: DeliveryId) -> Delivery | None:
    """The delivery with this id, of any customer; None if there is none."""
    this = deliveries.c.delivery_id == delivery_id
    rows = (await connection.execute(select(deliveries).where(this))).all()
    found = await with_parts(connection, rows)
    return found[0] if found else None


async def ended_at(connection: AsyncConnection, delivery_id: DeliveryId) -> datetime | None:
    """When the delivery ended; None while it is not over.

    Reports of the drone's way home change the delivery's row later.
    """
    of_end = (events.c.delivery_id == delivery_id, events.c.type.in_(_ENDS))
    body = (await connection.execute(select(events.c.body).where(*of_end))).scalar_one_or_none()
    return None if body is None else DeliveryEvent.read(body).occurred_at
