"""Hashes of a delivery's events and of the audit log; which requests have a stored answer."""

import hashlib
import json
from collections.abc import Iterable, Iterator
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None

#: The columns that the hash of an entry of the audit log covers, in this order.
_HASHED = (
    "entry_id",
    "at_ms",
    "at_wall_ms",
    "role",
    "subject_id",
    "method",
    "path",
    "status",
    "body",
    "traceparent",
    "number",
)
#: Rows that are changed in one statement.
_BATCH = 1_000

_events = sa.table(
    "events", *map(sa.column, ("delivery_id", "sequence", "body", "recorded_wall_ms"))
)
_deliveries = sa.table("deliveries", *map(sa.column, ("delivery_id", "events_hash")))
_audit = sa.table("audit", *map(sa.column, (*_HASHED, "hash")))


def upgrade() -> None:
    op.add_column("idempotency", sa.Column("location", sa.Text(), nullable=True))
    op.add_column(
        "deliveries", sa.Column("events_hash", sa.Text(), server_default="", nullable=False)
    )
    op.add_column(
        "deliveries",
        sa.Column("has_idempotency_key", sa.Boolean(), server_default=sa.false(), nullable=False),
    )
    _store(_deliveries, "delivery_id", _events_hashes(op.get_bind()))
    _number_audit()


def _events_hashes(connection: sa.Connection) -> Iterator[dict[str, Any]]:
    """The hash of the events of each delivery; columns have values of every type."""
    delivery_id, chained = None, ""
    query = sa.select(_events).order_by(_events.c.delivery_id, _events.c.sequence)
    for row in connection.execute(query):
        if row.delivery_id != delivery_id:
            if delivery_id is not None:
                yield {"of_row": delivery_id, "new_events_hash": chained}
            delivery_id, chained = row.delivery_id, ""
        chained = _next_hash(chained, str(row.recorded_wall_ms), row.body)
    if delivery_id is not None:
        yield {"of_row": delivery_id, "new_events_hash": chained}


def _number_audit() -> None:
    op.add_column("audit", sa.Column("number", sa.BigInteger(), server_default="0", nullable=False))
    op.add_column("audit", sa.Column("hash", sa.Text(), server_default="", nullable=False))
    head = op.create_table(
        "audit_head",
        sa.Column("only", sa.SmallInteger(), autoincrement=False, nullable=False),
        sa.Column("entries", sa.BigInteger(), nullable=False),
        sa.Column("hash", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("only"),
    )
    connection, number, chained = op.get_bind(), 0, ""
    rows: list[dict[str, Any]] = []
    for number, row in enumerate(
        connection.execute(sa.select(_audit).order_by(_audit.c.entry_id)), start=1
    ):
        values = {**row._mapping, "number": number}
        chained = _next_hash(chained, json.dumps([values[name] for name in _HASHED]))
        rows.append({"of_row": row.entry_id, "new_number": number, "new_hash": chained})
    _store(_audit, "entry_id", rows)
    op.bulk_insert(head, [{"only": 1, "entries": number, "hash": chained}])
    op.create_index("audit_number", "audit", ["number"], unique=True)


def _store(table: sa.TableClause, key: str, rows: Iterable[dict[str, Any]]) -> None:
    """Change rows, each found by its key `of_row`; the new values have names with `new_`."""
    left = [*rows]
    for start in range(0, len(left), _BATCH):
        batch = left[start : start + _BATCH]
        new: dict[str, Any] = {name: sa.bindparam(name) for name in batch[0] if name != "of_row"}
        values = {name.removeprefix("new_"): value for name, value in new.items()}
        statement = table.update().where(table.c[key] == sa.bindparam("of_row")).values(values)
        op.get_bind().execute(statement, batch)


def _next_hash(previous: str, *parts: str) -> str:
    hashed = hashlib.sha256(previous.encode())
    for part in parts:
        text = part.encode()
        hashed.update(b"%d:" % len(text))
        hashed.update(text)
    return hashed.hexdigest()
