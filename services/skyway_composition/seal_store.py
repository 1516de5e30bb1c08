"""Seals a database for the move of its cell: from then on, the database refuses each change.

Triggers refuse the change. So a server that has not noticed the move cannot change the database,
not even with a transaction that it began long before the move. Only the list of live replicas may
still change.
"""

import time
from collections.abc import Iterator
from typing import Final, Literal

from sqlalchemy import Table, delete, select, text
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.errors import SkywayError
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.minting import mint
from skyway.runtime.sql.database import Database, Tx
from skyway.runtime.sql.trouble import SEALED, SEALED_STATE
from skyway_composition.cell_store import HELD, open_missions, unsent_messages
from skyway_composition.tables import seals

#: SEALED: the id of the seal of this database. COPIED: the id of the seal of the copied database.
SealKind = Literal["SEALED", "COPIED"]

#: How long to wait for the transactions of servers, seconds. Statements of a server that come later
#: wait behind this.
_LOCK_TIMEOUT_S: Final = 3

_REFUSE: Final = f"""
CREATE OR REPLACE FUNCTION refuse_when_sealed() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN RAISE EXCEPTION '{SEALED}' USING ERRCODE = '{SEALED_STATE}'; END $$
"""


async def seal(db: Database) -> str:
    """Refuse all changes from now on; the id of the seal. A sealed database keeps its seal.

    Raises
    ------
    SkywayError
        The server has not finished its work, or has a transaction that does not end.
    """
    try:
        async with db.write() as tx:
            if tx.dialect == "postgresql":
                await tx.execute(text(f"SET LOCAL lock_timeout = '{_LOCK_TIMEOUT_S}s'"))
            if (present := await seal_id(tx.connection, "SEALED")) is not None:
                return present
            for statement in _triggers(tx, "CREATE"):
                await tx.execute(text(statement))
            await _must_be_idle(tx.connection)
            return await put_seal(tx, "SEALED", mint("sea"))
    except ServiceUnavailable as error:
        raise SkywayError(f"{error}: try again when its server has less to do") from error


async def unseal(tx: Tx) -> bool:
    """Accept changes again; False if the database was not sealed."""
    if await seal_id(tx.connection, "SEALED") is None:
        return False
    for statement in _triggers(tx, "DROP"):
        await tx.execute(text(statement))
    await tx.execute(delete(seals).where(seals.c.kind == "SEALED"))
    return True


async def seal_id(connection: AsyncConnection, kind: SealKind) -> str | None:
    """The id of a seal of this kind; None if there is no such seal."""
    found = await connection.execute(select(seals.c.seal_id).where(seals.c.kind == kind))
    known: str | None = found.scalar_one_or_none()
    return known


async def put_seal(tx: Tx, kind: SealKind, new_id: str) -> str:
    """Store the id of a seal of this kind in place of an earlier one; returns the id."""
    await tx.execute(delete(seals).where(seals.c.kind == kind))
    row = {"kind": kind, "seal_id": new_id, "made_wall_ms": time.time_ns() // 1_000_000}
    await tx.execute(seals.insert().values(row))
    return new_id


async def _must_be_idle(source: AsyncConnection) -> None:
    missions, messages = await open_missions(source), await unsent_messages(source)
    if missions or messages:
        raise SkywayError(
            f"{missions} missions are not over and {messages} messages are unsent: close the cells "
            "of this server (skyway cell close), and copy when its work is done"
        )


def _triggers(tx: Tx, verb: Literal["CREATE", "DROP"]) -> Iterator[str]:
    """The statements that make or drop the triggers of all tables."""
    if tx.dialect == "postgresql":
        if verb == "CREATE":
            yield _REFUSE
        for table in HELD:
            yield _on_postgresql(table, verb)
    else:
        for table in HELD:
            for change in ("INSERT", "UPDATE", "DELETE"):
                yield _on_sqlite(table, verb, change)


def _on_postgresql(table: Table, verb: Literal["CREATE", "DROP"]) -> str:
    if verb == "DROP":
        return f"DROP TRIGGER IF EXISTS sealed ON {table.name}"
    return (
        f"CREATE TRIGGER sealed BEFORE INSERT OR UPDATE OR DELETE ON {table.name} "
        "FOR EACH ROW EXECUTE FUNCTION refuse_when_sealed()"
    )


def _on_sqlite(table: Table, verb: Literal["CREATE", "DROP"], change: str) -> str:
    name = f"sealed_{table.name}_{change.lower()}"
    if verb == "DROP":
        return f"DROP TRIGGER IF EXISTS {name}"
    body = f"BEGIN SELECT RAISE(ABORT, '{SEALED}'); END"
    return f"CREATE TRIGGER {name} BEFORE {change} ON {table.name} {body}"
