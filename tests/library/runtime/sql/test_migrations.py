"""Migrations of a service's database."""

import asyncio

import pytest
from sqlalchemy.exc import DBAPIError

from skyway.runtime.sql.migrations import migrate
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
