"""Looks for all that breaks an invariant."""

from collections.abc import Mapping, Sequence
from typing import Final

from sqlalchemy import select, text
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.mission import Cancellation
from skyway.runtime.sql.database import Database
from skyway_composition.tables import cancellations, custody
from skyway_composition.verify.pads import pad_violations
from skyway_composition.verify.rules import RULES

_DELIVERED_ALL_THE_SAME: Final = "I6 a package that a cancellation released is not delivered"


async def violations(db: Database) -> Sequence[Mapping[str, str]]:
    """Every violation: the rule that is broken, and by whom."""
    found: list[Mapping[str, str]] = []
    async with db.survey() as connection:
        if db.dialect == "postgresql":
            # One moment's data for all checks, as SQLite's reader has anyway.
            await connection.execute(text("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ"))
        for rule, statement in RULES.items():
            subjects = (await connection.execute(statement)).scalars()
            found.extend({"rule": rule, "subject": str(subject)} for subject in set(subjects))
        found += await pad_violations(connection)
        released = await _released_and_delivered(connection)
    found.extend({"rule": _DELIVERED_ALL_THE_SAME, "subject": each} for each in released)
    return found


async def _released_and_delivered(connection: AsyncConnection) -> set[str]:
    """The packages of which a customer was told that they stay, and that went away."""
    delivered = await connection.execute(
        select(custody.c.package_id, cancellations.c.answer)
        .join(cancellations, cancellations.c.delivery_id == custody.c.delivery_id)
        .where(custody.c.custodian_kind == "RECIPIENT")
    )
    return {
        row.package_id
        for row in delivered
        if row.package_id in Cancellation.read(row.answer).released
    }
