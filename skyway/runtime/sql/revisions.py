"""The revision of a database, and which versions of Skyway can use its tables.

A migration that only adds leaves the tables usable for older code. A migration that removes
something names a revision in ``oldest_code``: code that has this revision does not need what was
removed. The database remembers that revision beside its own, because older code does not know newer
migrations.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Final

from sqlalchemy import inspect, text
from sqlalchemy.engine import Connection

_TABLE: Final = "alembic_version"
_COLUMN: Final = "oldest_code"


@dataclass(frozen=True, slots=True)
class Standing:
    """Where a database stands.

    Parameters
    ----------
    oldest_code
        Code whose newest revision is this one, or later, can use the tables. None: only code that
        has `revision` itself.
    """

    revision: str
    oldest_code: str | None


def revisions_of(package: str) -> Sequence[str]:
    """The revisions of a package, oldest first; its files are named by them."""
    versions = files(package) / "migrations" / "versions"
    names = (each.name for each in versions.iterdir())
    return sorted(
        name.removesuffix(".py").split("_")[0]
        for name in names
        if name.endswith(".py") and name[0].isdigit()
    )


def read_standing(connection: Connection) -> Standing | None:
    """Where the database stands; None for one that was never migrated."""
    if not inspect(connection).has_table(_TABLE):
        return None
    row = connection.execute(text("SELECT * FROM alembic_version")).mappings().first()
    if row is None:
        return None
    return Standing(row["version_num"], row.get(_COLUMN))


def write_oldest_code(
    connection: Connection, before: Standing | None, named: Iterable[str]
) -> None:
    """Store which code can use the tables, after migrations.

    Parameters
    ----------
    before
        The state of the database before them.
    named
        The ``oldest_code`` of the migrations that remove something.
    """
    after = read_standing(connection)
    if after is None:
        return
    columns = {each["name"] for each in inspect(connection).get_columns(_TABLE)}
    if _COLUMN not in columns:
        connection.execute(text("ALTER TABLE alembic_version ADD COLUMN oldest_code TEXT"))
    # No older code has used an empty database.
    known = after.revision if before is None else before.oldest_code or before.revision
    oldest = max([known, *named])
    connection.execute(text("UPDATE alembic_version SET oldest_code = :oldest"), {"oldest": oldest})
