"""All SQL of personal data: one row for each delivery whose customer gave some."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy import BigInteger, bindparam, exists, select, text, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DeliveryId
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.delivery_tables import IS_OVER, deliveries
from skyway_gateway.personal_data.details import NO_DATA, PersonalData
from skyway_gateway.tables import personal_data, quotes

#: The rows that one step erases at most.
BATCH: Final = 200


@dataclass(frozen=True, slots=True)
class StoredPersonalData:
    """The personal data of a delivery, and when it was erased; None while it was not."""

    data: PersonalData = NO_DATA
    erased_at: datetime | None = None


_OF_DELIVERIES: Final = select(personal_data).where(
    in_list(personal_data.c.delivery_id, "delivery_ids")
)
_ERASE_ONE: Final = (
    update(personal_data)
    .where(personal_data.c.delivery_id == bindparam("this"), personal_data.c.details.is_not(None))
    .values(details=None, erased_ms=bindparam("now_ms", type_=BigInteger))
)

_ERASE_QUOTED: Final = (
    update(quotes).where(quotes.c.delivery_id == bindparam("this")).values(places="[]")
)

#: A delivery changes for the last time when its drone is home. `due_ms` bounds what is looked at:
#: no delivery ends before it is created.
_OLD: Final = (
    select(personal_data.c.delivery_id)
    .where(
        personal_data.c.details.is_not(None),
        personal_data.c.due_ms <= bindparam("now_ms", type_=BigInteger),
        exists().where(
            deliveries.c.delivery_id == personal_data.c.delivery_id,
            text(IS_OVER),
            deliveries.c.updated_ms - deliveries.c.created_ms + personal_data.c.due_ms
            <= bindparam("now_ms", type_=BigInteger),
        ),
    )
    .order_by(personal_data.c.due_ms)
    .limit(BATCH)
)
_ERASE_OLD: Final = (
    update(personal_data)
    .where(personal_data.c.delivery_id.in_(_OLD), personal_data.c.details.is_not(None))
    .values(details=None, erased_ms=bindparam("now_ms", type_=BigInteger))
)


async def one_of(connection: AsyncConnection, delivery_id: DeliveryId) -> StoredPersonalData:
    """The personal data of a delivery, which is empty if there is none."""
    return (await every_of(connection, [delivery_id])).get(delivery_id, StoredPersonalData())


async def every_of(
    connection: AsyncConnection, delivery_ids: Collection[DeliveryId]
) -> Mapping[str, StoredPersonalData]:
    """The personal data of those of these deliveries that have or had some."""
    found = await connection.execute(_OF_DELIVERIES, {"delivery_ids": list(delivery_ids)})
    return {row.delivery_id: _stored_of(row) for row in found}


def add(
    tx: Tx, delivery_id: DeliveryId, data: PersonalData, *, created_at: datetime, kept: timedelta
) -> None:
    """Add the personal data of a delivery that the block adds; `kept` is the time promised."""
    tx.add(personal_data, [{"delivery_id": delivery_id, **_values(data, created_at + kept)}])


async def replace(
    tx: Tx, delivery_id: DeliveryId, data: PersonalData, *, created_at: datetime, kept: timedelta
) -> None:
    """Store personal data in place of what there is, of a delivery that the block has locked."""
    values = _values(data, created_at + kept)
    statement = tx.insert(personal_data).values(delivery_id=delivery_id, **values)
    await tx.execute(statement.on_conflict_do_update(index_elements=["delivery_id"], set_=values))


async def erase(tx: Tx, delivery_id: DeliveryId, *, at: datetime) -> None:
    """Erase the personal data of a delivery, if it has some, and the places of its quote."""
    await tx.execute(_ERASE_ONE, {"this": delivery_id, "now_ms": moment_to_ms(at)})
    await tx.execute(_ERASE_QUOTED, {"this": delivery_id})


async def erase_old(tx: Tx, *, at: datetime) -> int:
    """Erase what is due at this moment of fleet time, some of it; how many rows."""
    return (await tx.execute(_ERASE_OLD, {"now_ms": moment_to_ms(at)})).rowcount


def _stored_of(row: AnyRow) -> StoredPersonalData:
    data = NO_DATA if row.details is None else PersonalData.read(row.details)
    erased_at = None if row.erased_ms is None else ms_to_moment(row.erased_ms)
    return StoredPersonalData(data, erased_at)


def _values(data: PersonalData, due_at: datetime) -> dict[str, object]:
    details = data.model_dump_json(exclude_defaults=True)
    return {"details": details, "due_ms": moment_to_ms(due_at), "erased_ms": None}
