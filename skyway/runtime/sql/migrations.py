"""Upgrades a service's database to the tables that its code uses."""

import logging
from collections.abc import Callable
from typing import Final

from sqlalchemy import event, text
from sqlalchemy.engine import Connection
from sqlalchemy.ext.asyncio import AsyncEngine

from skyway.runtime.errors import UnknownRevision
from skyway.runtime.sql.revisions import read_standing, revisions_of
from skyway.runtime.sql.server_url import read_url
from skyway.runtime.sql.sqlite_engines import sqlite_engine
from skyway.runtime.sql.trouble import named_trouble, trouble_of_writing

log = logging.getLogger(__name__)

#: Key of the advisory lock under which one replica migrates while the others wait ("skyway").
_LOCK_KEY: Final = 0x736B79776179


#: How long a statement of a migration may take, seconds: an index over a large table takes minutes.
_MIGRATION_S: Final = 3_600.0

#: How long a run waits for an earlier run, seconds; then it logs that and tries again.
_TURN_S: Final = 60

#: How long a statement of a migration waits for a table that others use, seconds. Statements of
#: running replicas queue behind it, so it must fail soon and be tried again.
_LOCK_TIMEOUT_S: Final = 3


async def migrate(db_url: str, package: str) -> None:
    """Upgrade to the newest revision in ``<package>/migrations/versions``, all or nothing.

    A package's migrations folder needs no env.py. Replicas that start together wait for the first.
    A database that a newer version has migrated is left alone.

    Raises
    ------
    ServiceUnavailable
        The database cannot be migrated now.
    UnknownRevision
        A newer version of Skyway has migrated it, and this version cannot use its tables.
    """
    url = read_url(db_url)
    with named_trouble(trouble_of_writing):
        if url.drivername == "postgresql":
            from skyway.runtime.sql.postgresql_engines import postgresql_engine

            # Nearly every start ends here; a server that hangs is noticed within a minute.
            if await _run(postgresql_engine(url), _needs_upgrade, package):
                await _run(postgresql_engine(url, statement_s=_MIGRATION_S), _upgrade, package)
        else:
            engine = sqlite_engine(url)
            event.listen(engine.sync_engine, "begin", _begin_immediate)
            await _run(engine, _upgrade, package)


async def _run(engine: AsyncEngine, step: Callable[[Connection, str], bool], package: str) -> bool:
    """What a step returns, in one transaction and over one connection."""
    try:
        async with engine.begin() as connection:
            return await connection.run_sync(step, package)
    finally:
        await engine.dispose()


def _upgrade(connection: Connection, package: str) -> bool:
    """Run the missing migrations while no other run does; returns whether there were any."""
    if connection.dialect.name == "postgresql":
        connection.execute(text(f"SET LOCAL lock_timeout = '{_TURN_S}s'"))
        connection.execute(text(f"SELECT pg_advisory_xact_lock({_LOCK_KEY})"))
        connection.execute(text(f"SET LOCAL lock_timeout = '{_LOCK_TIMEOUT_S}s'"))
    # Another run may have done it meanwhile.
    is_needed = _needs_upgrade(connection, package)
    if is_needed:
        from skyway.runtime.sql.upgrade import upgrade

        upgrade(connection, package)
    return is_needed


def _begin_immediate(connection: Connection) -> None:
    """Begin to write; an error if the file is read-only.

    A process that opens a read-only file can never write it, even when others can again: all its
    connections share the first view of the file. So a service must not open one. SQLite itself
    reports a read-only file at the first change, and setting the same version is one.
    """
    connection.exec_driver_sql("BEGIN IMMEDIATE")
    version = connection.exec_driver_sql("PRAGMA user_version").scalar_one()
    connection.exec_driver_sql(f"PRAGMA user_version = {version}")


def _needs_upgrade(connection: Connection, package: str) -> bool:
    """Whether the database lacks a migration of this version.

    Raises
    ------
    UnknownRevision
        A newer version has migrated it, and this version cannot use its tables.
    """
    standing, own = read_standing(connection), revisions_of(package)
    if standing is None or standing.revision in own:
        return standing is None or standing.revision != own[-1]
    if standing.oldest_code is None or standing.oldest_code > own[-1]:
        raise UnknownRevision(standing.revision, newest=own[-1])
    # A rolled back or restarted replica beside a newer one: the migrations since only added.
    log.warning("database is newer", extra={"revision": standing.revision, "newest": own[-1]})
    return False
