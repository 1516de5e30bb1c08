"""Copies a database of composition into another database, for the move of a cell.

The database is sealed first, so that it cannot change after the copy. One database may be SQLite
and the other PostgreSQL. Everything is copied in one transaction.
"""

from collections.abc import AsyncIterator
from typing import Any, Final

from sqlalchemy import Table, delete, func, select, tuple_
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.errors import SkywayError
from skyway.runtime.sql.database import Database
from skyway_composition.cell_store import HELD, network_ids, open_missions, revision
from skyway_composition.seal_store import put_seal, seal, seal_id, unseal
from skyway_composition.tables import alarms, closures, missions

#: The number of rows that are read and written together.
_TOGETHER: Final = 500


async def copy_database(source: Database, target: Database) -> dict[str, int]:
    """Seal a database and copy all its rows into another; the number of copied rows by table.

    Rows of an earlier copy in the target are replaced, unless a server has worked with them. If the
    copy fails, the source is not sealed, unless it was sealed before.

    Raises
    ------
    SkywayError
        The source has not finished its work or is of another version of Skyway, or the target has
        data of its own.
    """
    async with source.read() as reading, target.read() as writing:
        await _must_be_alike(reading, writing)
        was_sealed = await seal_id(reading, "SEALED") is not None
    sealed = await seal(source)
    try:
        return await _copy(source, target, sealed)
    except BaseException:
        if not was_sealed:
            async with source.write() as tx:
                await unseal(tx)
        raise


async def _copy(source: Database, target: Database, sealed: str) -> dict[str, int]:
    copied: dict[str, int] = {}
    async with source.survey() as reading, target.write() as tx:
        await _must_be_replaceable(tx.connection, reading)
        await unseal(tx)
        for table in reversed(HELD):
            await tx.execute(delete(table))
        for table in HELD:
            copied[table.name] = 0
            async for rows in _rows_of(reading, table):
                await tx.execute(table.insert(), rows)
                copied[table.name] += len(rows)
            found = await tx.execute(select(func.count()).select_from(table))
            if found.scalar_one() != copied[table.name]:
                raise SkywayError(f"{table.name} could not be copied as a whole")
        await put_seal(tx, "COPIED", sealed)
    return copied


async def _must_be_alike(source: AsyncConnection, target: AsyncConnection) -> None:
    """The target has the newest migration of this program."""
    theirs, ours = [await revision(each) for each in (source, target)]
    if theirs is None:
        raise SkywayError("the database to copy has no tables of Skyway: check its URL")
    if theirs != ours:
        raise SkywayError(
            f"the database stands at revision {theirs}, and this version of Skyway needs {ours}: "
            "copy with the version of its server, or upgrade that server first"
        )


async def _must_be_replaceable(target: AsyncConnection, source: AsyncConnection) -> None:
    own = set(await network_ids(target)) - set(await network_ids(source))
    if own or await open_missions(target):
        names = ", ".join(sorted(own)) or "missions that are not over"
        raise SkywayError(f"the other database has data of its own ({names}): name an empty one")
    for table in (missions, closures, alarms):
        newest = select(func.max(*table.primary_key.columns))
        theirs, ours = [(await each.execute(newest)).scalar_one() for each in (target, source)]
        if (theirs or "") > (ours or ""):
            raise SkywayError(
                f"the other database has newer {table.name} than this one: its server has worked "
                "since an earlier copy. If the cell has not moved to it yet, name an empty one"
            )


async def _rows_of(source: AsyncConnection, table: Table) -> AsyncIterator[list[dict[str, Any]]]:
    """All rows of a table in parts, in the order of its key. Any: columns have several types."""
    key = tuple_(*table.primary_key.columns)
    query = select(table).order_by(*table.primary_key.columns).limit(_TOGETHER)
    part = query
    while rows := [row._asdict() for row in await source.execute(part)]:
        yield rows
        last = [rows[-1][column.name] for column in table.primary_key.columns]
        part = query.where(key > tuple_(*last))
