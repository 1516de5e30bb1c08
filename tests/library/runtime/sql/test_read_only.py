"""A database that is opened to be read only: one moment, no change, no new file."""

import asyncio
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import text
from sqlalchemy.exc import DBAPIError

from skyway.runtime.errors import DamagedDatabase, ServiceUnavailable
from skyway.runtime.sql.database import Database
from skyway.runtime.sql.read_only import ReadOnlyDatabase

COUNT = text("SELECT count(*) FROM landings")


@pytest.fixture
async def landings(database_url: str) -> str:
    """The URL of a database with a table of one row."""
    async with Database(database_url) as db, db.write() as tx:
        await tx.execute(text("CREATE TABLE landings (pad INTEGER)"))
        await tx.execute(text("INSERT INTO landings VALUES (1)"))
    return database_url


async def test_all_reads_see_the_data_of_one_moment(landings: str) -> None:
    async with Database(landings) as db, ReadOnlyDatabase(landings) as read_only:
        async with read_only.survey() as connection:
            before = (await connection.execute(COUNT)).scalar_one()
            async with db.write() as tx:
                await tx.execute(text("INSERT INTO landings VALUES (2)"))
            after = (await connection.execute(COUNT)).scalar_one()
        async with read_only.survey() as connection:
            later = (await connection.execute(COUNT)).scalar_one()

    assert (before, after, later) == (1, 1, 2)


async def test_nothing_can_be_written(landings: str) -> None:
    async with ReadOnlyDatabase(landings) as read_only:
        with pytest.raises(DBAPIError, match=r"read-?only|readonly"):
            async with read_only.survey() as connection:
                await connection.execute(text("DELETE FROM landings"))


async def test_a_file_that_is_missing_is_not_made(tmp_path: Path) -> None:
    async with ReadOnlyDatabase(f"sqlite:///{tmp_path}/nowhere.db") as read_only:
        with pytest.raises(ServiceUnavailable):
            async with read_only.survey():
                pass

    assert not await asyncio.to_thread((tmp_path / "nowhere.db").exists)


async def test_a_file_with_a_question_mark_in_its_name_is_opened(tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / "why?.db")) as file:
        file.execute("CREATE TABLE landings (pad INTEGER)")

    async with (
        ReadOnlyDatabase(f"sqlite:///{tmp_path}/why%3F.db") as read_only,
        read_only.survey() as connection,
    ):
        assert (await connection.execute(COUNT)).scalar_one() == 0


async def test_a_file_that_is_no_database_is_damaged(tmp_path: Path) -> None:
    (tmp_path / "damaged.db").write_text("this was a database once, and is none any more" * 100)

    async with ReadOnlyDatabase(f"sqlite:///{tmp_path}/damaged.db") as read_only:
        with pytest.raises(DamagedDatabase, match="file is not a database"):
            async with read_only.survey():
                pass
