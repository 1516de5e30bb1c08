"""All SQL of the audit log: entries are only added."""

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import func, insert, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import SubjectId
from skyway.runtime.http.paging import PageQuery
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.access.key import KeyRole
from skyway_gateway.audit.entry import AuditEntry
from skyway_gateway.tables import audit


@dataclass(frozen=True, slots=True)
class AuditFilter:
    """Which entries a list shows; `path` is how their paths begin."""

    role: KeyRole | None = None
    subject_id: SubjectId | None = None
    path: str | None = None


async def add(tx: Tx, entry: AuditEntry) -> None:
    """Add an entry."""
    row = {
        **entry.model_dump(exclude={"at", "wall_at"}),
        "at_ms": moment_to_ms(entry.at),
        "at_wall_ms": moment_to_ms(entry.wall_at),
    }
    await tx.execute(insert(audit).values(row))


async def page(
    connection: AsyncConnection, query: PageQuery, wanted: AuditFilter
) -> Sequence[AuditEntry]:
    """Up to limit + 1 entries, the newest first."""
    statement = select(audit)
    if wanted.role is not None:
        statement = statement.where(audit.c.role == wanted.role)
    if wanted.subject_id is not None:
        statement = statement.where(audit.c.subject_id == wanted.subject_id)
    if wanted.path is not None:
        # Not LIKE: SQLite's does not tell upper from lower case.
        begins = func.substr(audit.c.path, 1, len(wanted.path)) == wanted.path
        statement = statement.where(begins)
    if (after := query.after(str)) is not None:
        statement = statement.where(audit.c.entry_id < after[0])
    statement = statement.order_by(audit.c.entry_id.desc()).limit(query.limit + 1)
    return [_entry(row) for row in await connection.execute(statement)]


def _entry(row: AnyRow) -> AuditEntry:
    return AuditEntry(
        entry_id=row.entry_id,
        at=ms_to_moment(row.at_ms),
        wall_at=ms_to_moment(row.at_wall_ms),
        role=row.role,
        subject_id=row.subject_id,
        method=row.method,
        path=row.path,
        status=row.status,
        body=row.body,
        traceparent=row.traceparent,
    )
