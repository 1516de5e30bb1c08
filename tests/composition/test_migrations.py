from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from skyway_composition.tables import metadata
from sqlalchemy import Connection

from skyway.runtime.sql.database import Database
from skyway.runtime.sql.migrations import migrate


def differences(connection: Connection) -> list[object]:
    return list(compare_metadata(MigrationContext.configure(connection), metadata))


async def test_the_migrations_make_the_tables_of_the_code(database_url: str) -> None:
    await migrate(database_url, "skyway_composition")

    async with Database(database_url) as db, db.read() as connection:
        assert await connection.run_sync(differences) == []
