"""The migrations make the tables of the code."""

from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from skyway_provider_registry.tables import metadata
from sqlalchemy import Connection

from skyway.runtime.sql.database import Database
from skyway.runtime.sql.migrations import migrate


def differences(connection: Connection) -> list[object]:
    context = MigrationContext.configure(
        connection, opts={"compare_type": True, "compare_server_default": True}
    )
    return list(compare_metadata(context, metadata))


async def test_the_migrated_tables_are_those_of_the_code(database_url: str) -> None:
    await migrate(database_url, "skyway_provider_registry")
    await migrate(database_url, "skyway_provider_registry")

    async with Database(database_url) as db, db.read() as connection:
        found = await connection.run_sync(differences)
    assert found == []
