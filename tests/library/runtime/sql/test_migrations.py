"""Migrations upgrade a database to the tables that the code uses."""

import asyncio
from pathlib import Path

import pytest
from sqlalchemy import text
from sqlalchemy.exc import DBAPIError

from skyway.runtime.errors import UnknownRevision
from skyway.runtime.sql.database import Database
from skyway.runtime.sql.migrations import migrate

REVISION = """
from alembic import op
revision = {revision!r}
down_revision = {before!r}

def upgrade() -> None:
{statements}
"""


class Package:
    """A service's package whose migrations a test writes."""

    def __init__(self, folder: Path, name: str) -> None:
        self.name = name
        self._versions = folder / name / "migrations" / "versions"
        self._versions.mkdir(parents=True)
        (folder / name / "__init__.py").touch()
        (folder / name / "migrations" / "__init__.py").touch()

    def revise(self, revision: str, *statements: str, before: str | None = None) -> None:
        lines = "\n".join(f"    op.execute({statement!r})" for statement in statements)
        script = REVISION.format(revision=revision, before=before, statements=lines)
        (self._versions / f"{revision}.py").write_text(script)

    def forget(self, revision: str) -> None:
        (self._versions / f"{revision}.py").unlink()


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Package:
    # A name of its own: a package once imported is not looked for in another folder.
    made = Package(tmp_path, f"service_{tmp_path.name}")
    made.revise("0001", "CREATE TABLE stations (name TEXT)")
    monkeypatch.syspath_prepend(tmp_path)
    return made


async def has_table(url: str, table: str) -> bool:
    async with Database(url) as db, db.read() as connection:
        try:
            await connection.execute(text(f"SELECT 1 FROM {table}"))
        except DBAPIError:
            return False
    return True


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


async def test_a_database_of_another_version_is_left_alone(
    database_url: str, package: Package
) -> None:
    package.revise("0002", "CREATE TABLE pads (number INTEGER)", before="0001")
    await migrate(database_url, package.name)
    package.forget("0002")

    with pytest.raises(UnknownRevision, match="0002"):
        await migrate(database_url, package.name)

    assert await has_table(database_url, "pads")
