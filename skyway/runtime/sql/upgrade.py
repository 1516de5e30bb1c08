"""Runs the migrations of a service, with Alembic.

It is a module of its own because importing Alembic takes a fifth of a second, and nearly every
start finds nothing to migrate.
"""

from collections.abc import Iterator

from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.runtime.environment import EnvironmentContext
from alembic.script import ScriptDirectory
from sqlalchemy.engine import Connection

from skyway.runtime.sql.revisions import Standing, read_standing, write_oldest_code


def upgrade(connection: Connection, package: str) -> None:
    """Run all migrations in ``<package>/migrations/versions`` that the database lacks."""
    scripts, before = _scripts(package), read_standing(connection)

    def steps(revision: str, _context: MigrationContext) -> list[object]:
        return list(scripts._upgrade_revs("head", revision))  # as alembic's own `upgrade` does

    with EnvironmentContext(Config(), scripts, fn=steps) as environment:
        # SQLite can roll back DDL too, which Alembic does not assume.
        environment.configure(connection=connection, transactional_ddl=True)
        with environment.begin_transaction():
            environment.run_migrations()
    write_oldest_code(connection, before, _named_by_new_migrations(scripts, before))


def _named_by_new_migrations(scripts: ScriptDirectory, before: Standing | None) -> Iterator[str]:
    """The ``oldest_code`` of each migration that ran and has one."""
    for script in scripts.walk_revisions():
        if before is None or script.revision > before.revision:
            oldest = getattr(script.module, "oldest_code", None)
            if oldest is not None:
                yield oldest


def _scripts(package: str) -> ScriptDirectory:
    config = Config()
    config.set_main_option("script_location", f"{package}:migrations")
    config.set_main_option("path_separator", "os")
    return ScriptDirectory.from_config(config)
