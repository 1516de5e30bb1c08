"""The SQL of brandings: one row for each customer that has set one."""

from sqlalchemy import select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import SubjectId
from skyway.runtime.sql.database import Tx
from skyway_gateway.tables import brandings
from skyway_gateway.tracking.branding import Branding


async def branding_of(connection: AsyncConnection, customer_id: SubjectId) -> Branding:
    """The branding of a customer; without name and colour if there is none."""
    this = brandings.c.customer_id == customer_id
    row = (await connection.execute(select(brandings).where(this))).one_or_none()
    return Branding() if row is None else Branding(name=row.name, colour=row.colour)


async def put_branding(tx: Tx, customer_id: SubjectId, branding: Branding) -> None:
    """Replace the branding of a customer."""
    values = branding.model_dump()
    statement = tx.insert(brandings).values(customer_id=customer_id, **values)
    await tx.execute(statement.on_conflict_do_update(index_elements=["customer_id"], set_=values))
