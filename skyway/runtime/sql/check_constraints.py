"""Replaces a named CHECK constraint in a migration, on both databases."""

import re

from sqlalchemy import text
from sqlalchemy.engine import Connection


def replace_check(connection: Connection, table: str, name: str, condition: str) -> None:
    """Give the CHECK constraint `name` of a table another condition.

    PostgreSQL drops and adds it. SQLite cannot, and rebuilding a table that others refer to would
    break their foreign keys. So its text in the schema is replaced, as SQLite's own manual does for
    changes that leave the stored rows as they are (https://sqlite.org/lang_altertable.html).

    Raises
    ------
    LookupError
        The table has no such constraint.
    """
    if connection.dialect.name == "postgresql":
        connection.execute(text(f"ALTER TABLE {table} DROP CONSTRAINT {name}"))
        connection.execute(text(f"ALTER TABLE {table} ADD CONSTRAINT {name} CHECK ({condition})"))
        return
    query = text("SELECT sql FROM sqlite_master WHERE type = 'table' AND name = :table")
    before: str = connection.execute(query, {"table": table}).scalar_one()
    after = _with_check(before, name, condition)
    if after is None:
        raise LookupError(f"table {table} has no constraint {name}")
    version = connection.execute(text("PRAGMA schema_version")).scalar_one()
    connection.execute(text("PRAGMA writable_schema = ON"))
    change = text("UPDATE sqlite_master SET sql = :sql WHERE type = 'table' AND name = :table")
    connection.execute(change, {"sql": after, "table": table})
    # Every connection reads the schema again, as after ALTER TABLE.
    connection.execute(text(f"PRAGMA schema_version = {version + 1}"))
    connection.execute(text("PRAGMA writable_schema = OFF"))


def _with_check(schema: str, name: str, condition: str) -> str | None:
    """The text of a table with this condition; None when the constraint is not in it."""
    found = re.search(rf"CONSTRAINT {re.escape(name)} CHECK \(", schema)
    if found is None:
        return None
    depth, end = 1, found.end()
    while depth:
        depth += {"(": 1, ")": -1}.get(schema[end], 0)
        end += 1
    return f"{schema[: found.end()]}{condition}{schema[end - 1 :]}"
