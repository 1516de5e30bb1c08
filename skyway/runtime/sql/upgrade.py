"""Runs the migrations of a service, with Alembic.

It is a module of its own because importing Alembic takes a fifth of a second, and nearly every
start finds nothing to migrate.
"""

from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.runtime.environment import EnvironmentContext
from alembic.script import ScriptDirectory
from alembic.util import CommandError
from sqlalchemy.engine import Connection

from skyway.runtime.errors import UnknownRevision


def upgrade(connection: Connection, package: str) -> None:
    """Run all migrations in ``<package>/migrations/versions`` that the database lacks.

    Raises
    ------
    UnknownRevision
        Another version of Skyway has migrated the database.
    """
    scripts = _scripts(package)

    def steps(revision: str, _context: MigrationContext) -> list[object]:
        try:
            return list(scripts._upgrade_revs("head", revision))  # as alembic's own `upgrade` does
        except CommandError as error:
            raise UnknownRevision(str(error)) from error

    with EnvironmentContext(Config(), scripts, fn=steps) as environment:
        # SQLite can roll back DDL too, which Alembic does not assume.
        environment.configure(connection=connection, transactional_ddl=True)
        with environment.begin_transaction():
            environment.run_migrations()


def _scripts(package: str) -> ScriptDirectory:
    config = Config()
    config.set_main_option("script_location", f"{package}:migrations")
    config.set_main_option("path_separator", "os")
    return ScriptDirectory.from_config(config)
