"""A CHECK constraint is replaced without touching rows or the tables that refer to them."""

from collections.abc import Callable
from pathlib import Path

import pytest
from sqlalchemy import text
from sqlalchemy.engine import Connection
from sqlalchemy.exc import IntegrityError

from skyway.runtime.sql.check_constraints import replace_check
from skyway.runtime.sql.database import Database

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
