"""A replica beside a newer one: it may start while newer migrations have only added something."""

import asyncio

import asyncpg
import pytest
from sqlalchemy import text

from skyway.runtime.errors import ExitCode, UnknownRevision, exit_code_of
from skyway.runtime.sql.database import Database
from skyway.runtime.sql.migrations import migrate
from tests.library.runtime.sql.migration_package import Package, has_table

on_postgresql = pytest.mark.parametrize(
    "database_url",
    [pytest.param("postgresql", marks=pytest.mark.integration)],
    indirect=True,
)

PADS = "CREATE TABLE pads (number INTEGER)"


async def upgrade_and_go_back(url: str, package: Package, *, oldest_code: str | None) -> None:
    """Migrate with the present version, then with the next one; the present one is left."""
    await migrate(url, package.name)
    package.revise("0002", PADS, before="0001", oldest_code=oldest_code)
    await migrate(url, package.name)
    package.forget("0002")


async def test_an_older_replica_starts_after_a_migration_that_only_adds(
    database_url: str, package: Package, caplog: pytest.LogCaptureFixture
) -> None:
    await upgrade_and_go_back(database_url, package, oldest_code=None)

    await migrate(database_url, package.name)

    assert "database is newer" in caplog.messages
    assert await has_table(database_url, "pads")


async def test_an_older_replica_is_refused_after_a_migration_that_takes_away(
    database_url: str, package: Package
) -> None:
    await upgrade_and_go_back(database_url, package, oldest_code="0002")

    with pytest.raises(UnknownRevision, match=r"0002, this version has 0001 .* restore") as refused:
        await migrate(database_url, package.name)

    assert exit_code_of(refused.value) == ExitCode.BAD_DATABASE
    assert await has_table(database_url, "pads")


async def test_the_replica_before_the_contracting_one_may_still_start(
    database_url: str, package: Package
) -> None:
    await migrate(database_url, package.name)
    package.revise("0002", PADS, before="0001")
    package.revise("0003", "DROP TABLE stations", before="0002", oldest_code="0002")
    await migrate(database_url, package.name)
    package.forget("0003")

    await migrate(database_url, package.name)
    package.forget("0002")
    with pytest.raises(UnknownRevision, match="0003, this version has 0001"):
        await migrate(database_url, package.name)


async def test_a_later_migration_that_adds_does_not_let_older_replicas_in_again(
    database_url: str, package: Package
) -> None:
    await migrate(database_url, package.name)
    package.revise("0002", PADS, before="0001", oldest_code="0002")
    await migrate(database_url, package.name)
    package.revise("0003", "CREATE TABLE lamps (lamp TEXT)", before="0002")
    await migrate(database_url, package.name)
    package.forget("0003")
    await migrate(database_url, package.name)
    package.forget("0002")

    with pytest.raises(UnknownRevision, match="0003"):
        await migrate(database_url, package.name)


async def test_a_database_from_before_the_mark_is_known_by_its_revision(
    database_url: str, package: Package
) -> None:
    await migrate(database_url, package.name)
    async with Database(database_url) as db, db.write() as tx:
        await tx.execute(text("ALTER TABLE alembic_version DROP COLUMN oldest_code"))
    package.revise("0002", PADS, before="0001")
    await migrate(database_url, package.name)
    package.forget("0002")

    await migrate(database_url, package.name)

    assert await has_table(database_url, "pads")


async def test_an_unknown_database_without_the_mark_is_refused(
    database_url: str, package: Package
) -> None:
    await migrate(database_url, package.name)
    async with Database(database_url) as db, db.write() as tx:
        await tx.execute(text("ALTER TABLE alembic_version DROP COLUMN oldest_code"))
        await tx.execute(text("UPDATE alembic_version SET version_num = '0009'"))

    with pytest.raises(UnknownRevision, match="0009"):
        await migrate(database_url, package.name)


@on_postgresql
async def test_a_second_run_waits_for_the_lock_of_the_first(
    database_url: str, package: Package
) -> None:
    other = await asyncpg.connect(database_url)
    first = other.transaction()
    await first.start()
    await other.execute("SELECT pg_advisory_xact_lock(x'736b79776179'::bigint)")
    second = asyncio.create_task(migrate(database_url, package.name))
    waiting = "SELECT count(*) FROM pg_locks WHERE locktype = 'advisory' AND NOT granted"
    try:
        async with asyncio.timeout(30):
            while await other.fetchval(waiting) == 0:
                pass

        assert not await has_table(database_url, "stations")
    finally:
        await first.commit()
        await other.close()
        await second

    assert await has_table(database_url, "stations")


@on_postgresql
async def test_a_migration_waits_for_a_table_only_shortly(
    database_url: str, package: Package
) -> None:
    package.revise(
        "0002", "INSERT INTO stations SELECT current_setting('lock_timeout')", before="0001"
    )

    await migrate(database_url, package.name)

    async with Database(database_url) as db, db.read() as connection:
        kept = (await connection.execute(text("SELECT name FROM stations"))).scalar_one()
    assert kept == "3s"
