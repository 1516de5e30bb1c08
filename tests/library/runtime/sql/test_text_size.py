"""The size of a stored text is that of the text, however long it is."""

import pytest
from sqlalchemy import Column, MetaData, Table, Text, select

from skyway.runtime.sql.database import Database
from skyway.runtime.sql.text_size import text_size

METADATA = MetaData()
PAGES = Table("pages", METADATA, Column("page", Text))


@pytest.mark.parametrize("text", ["", "false", "true", "skyway " * 10_000])
async def test_a_text_has_its_size(database: Database, text: str) -> None:
    async with database.write() as tx:
        await tx.connection.run_sync(METADATA.create_all)
        await tx.execute(PAGES.insert(), [{"page": text}])

    async with database.read() as connection:
        found = await connection.execute(select(text_size(PAGES.c.page)))

        assert found.scalar_one() == len(text)


async def test_no_text_has_no_size(database: Database) -> None:
    async with database.write() as tx:
        await tx.connection.run_sync(METADATA.create_all)
        await tx.execute(PAGES.insert(), [{"page": None}])

    async with database.read() as connection:
        found = await connection.execute(select(text_size(PAGES.c.page)))

        assert found.scalar_one() is None
