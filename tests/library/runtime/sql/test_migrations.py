"""Migrations of a service's database, and the CHECK constraints that they replace."""

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest
from sqlalchemy import text
from sqlalchemy.engine import Connection
from sqlalchemy.exc import DBAPIError, IntegrityError

from skyway.runtime.sql.database import Database
from skyway.runtime.sql.migrations import migrate, replace_check
from tests.library.runtime.sql.migration_package import Package, has_table


async def test_an_empty_database_gets_every_table(database_url: str, package: Package) -> None:
    package.revise("0002", "CREATE TABLE pads (number INTEGER)", before="0001")

    await migrate(database_url, package.name)

    assert await has_table(database_url, "stations")
    assert await has_table(database_url, "pads")


async def test_a_database_is_migrated_from_where_it_stands(
    database_url: str, package: Package
) -> None:
    await migrate(database_url, package.name)
    await migrate(database_url, package.name)
    package.revise("0002", "CREATE TABLE pads (number INTEGER)", before="0001")

    await migrate(database_url, package.name)

    assert await has_table(database_url, "pads")


async def test_a_migration_that_fails_leaves_nothing(database_url: str, package: Package) -> None:
    package.revise("0002", "CREATE TABLE pads (number INTEGER)", "NO SQL", before="0001")

    with pytest.raises(DBAPIError):
        await migrate(database_url, package.name)

    assert not await has_table(database_url, "stations")
    assert not await has_table(database_url, "pads")


async def test_replicas_that_start_together_migrate_once(
    database_url: str, package: Package
) -> None:
    await asyncio.gather(*(migrate(database_url, package.name) for _ in range(3)))

    assert await has_table(database_url, "stations")


TABLES = (
    """CREATE TABLE lamps (lamp TEXT PRIMARY KEY, colour TEXT,
    CONSTRAINT lamp_colour CHECK (colour IN ('RED', (lower('x')))),
    CONSTRAINT lamp_name CHECK (lamp <> ''))""",
    "CREATE TABLE bulbs (bulb TEXT PRIMARY KEY, lamp TEXT REFERENCES lamps (lamp))",
    "INSERT INTO lamps VALUES ('one', 'RED')",
    "INSERT INTO bulbs VALUES ('b', 'one')",
)


async def _change(db: Database, change: Callable[[Connection], None]) -> None:
    async with db.write() as tx:
        await tx.connection.run_sync(change)


async def test_new_values_are_allowed_and_others_still_refused(database_url: str) -> None:
    async with Database(database_url) as db:
        async with db.write() as tx:
            for statement in TABLES:
                await tx.execute(text(statement))

        await _change(
            db, lambda it: replace_check(it, "lamps", "lamp_colour", "colour IN ('RED', 'GREEN')")
        )

        async with db.write() as tx:
            await tx.execute(text("INSERT INTO lamps VALUES ('two', 'GREEN')"))
        for row in ("('three', 'BLUE')", "('', 'RED')"):
            with pytest.raises(IntegrityError):
                async with db.write() as tx:
                    await tx.execute(text(f"INSERT INTO lamps VALUES {row}"))
        async with db.read() as connection:
            assert len((await connection.execute(text("SELECT * FROM bulbs"))).all()) == 1


async def test_a_constraint_that_does_not_exist_is_an_error(tmp_path: Path) -> None:
    async with Database(f"sqlite:///{tmp_path}/lamps.db") as db:
        async with db.write() as tx:
            for statement in TABLES:
                await tx.execute(text(statement))

        with pytest.raises(LookupError, match="lamp_size"):
            await _change(db, lambda it: replace_check(it, "lamps", "lamp_size", "TRUE"))
