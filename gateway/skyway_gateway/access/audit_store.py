"""The entries of the audit log and their SQL: entries are only added, each with a hash."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Final, Literal, get_args

from pydantic import Field
from sqlalchemy import func, insert, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.message import FleetMoment, WallMoment
from skyway.delivery.qos import ProviderChoice, QoS
from skyway.delivery.request import DeliveryRequest, Package
from skyway.ids import SubjectId
from skyway.json_model import JsonModel
from skyway.runtime.hash_chain import next_hash
from skyway.runtime.http.paging import PageQuery
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.access.api_key import KeyRole
from skyway_gateway.tables import audit, audit_head

#: The longest body (bytes) and path (characters) in an entry; longer ones are cut.
LONGEST_BODY: Final = 4096
LONGEST_PATH: Final = 500

#: The role and the subject of a caller whom nobody knows.
UNKNOWN: Final = "unknown"

AuditRole = KeyRole | Literal["unknown"]

#: The roles of people, by themselves.
ROLES: Final[Mapping[str, AuditRole]] = {role: role for role in get_args(KeyRole)}

#: JSON members with secret text, also where the body is cut inside that text.
_SECRET: Final = re.compile(
    r'("(?:\w*(?:password|secret|token)|key|code)"\s*:\s*)"(?:[^"\\]|\\.)*"?', re.IGNORECASE
)

_HIDDEN: Final = "***"
_PERSONAL_PATHS: Final = ("/v1/deliveries", "/v1/quotes")
#: The members of bodies about deliveries that say nothing about people.
_NOT_PERSONAL: Final = frozenset(
    ("station_id", "quote_id", "offer_id", "package_ids", "reason", "hold", "dry_run")
).union(*(form.model_fields for form in (DeliveryRequest, Package, QoS, ProviderChoice)))


class AuditEntry(JsonModel):
    """A call of an operator or a provider, and its answer, or a call with a refused key."""

    entry_id: Annotated[
        str, Field(description="The id of the entry; later entries have larger ids.")
    ]
    at: FleetMoment
    wall_at: WallMoment
    role: Annotated[
        AuditRole, Field(description="The role of the caller; unknown for a key nobody ever had.")
    ]
    subject_id: Annotated[
        SubjectId,
        Field(
            description="Who called: a provider or an operator; for a refused key its holder, or "
            "`unknown`."
        ),
    ]
    method: Annotated[str, Field(description="The HTTP method of the call.")]
    path: Annotated[str, Field(description="with its query")]
    status: Annotated[
        int, Field(description="The HTTP status of the answer; 0 when the call was not answered.")
    ]
    body: Annotated[
        str | None,
        Field(
            description="as it came, without secrets, cut where it is long; for a refused key why "
            "(`refused`), the `address`, and the `key_id` of a key that has ended"
        ),
    ]
    traceparent: Annotated[str | None, Field(description="The W3C trace context of the call.")]


def body_text(raw: bytes, *, path: str = "") -> str | None:
    """The text of a body for the log, without secrets; None for an empty body.

    Of a call about deliveries only the members of `_NOT_PERSONAL` are shown. An entry is never
    changed, so even a name in a misspelt member would stay.
    """
    if not raw:
        return None
    text = raw[:LONGEST_BODY].decode(errors="replace").replace("\0", "\ufffd")
    if path.startswith(_PERSONAL_PATHS):
        return _without_people(text)
    return _SECRET.sub(r'\1"***"', text)


def _without_people(text: str) -> str:
    try:
        body = json.loads(text)
        return json.dumps(_shown(body) if isinstance(body, dict) else _HIDDEN)
    except (ValueError, RecursionError):  # not JSON, cut, or nested too deeply
        return _HIDDEN


def _shown(value: Any) -> Any:  # any JSON value
    """The value, with `***` for what may say something about people."""
    if isinstance(value, dict):
        return {
            name: _shown(inner) if name in _NOT_PERSONAL else _HIDDEN
            for name, inner in value.items()
        }
    return [_shown(each) for each in value] if isinstance(value, list) else value


def path_text(path: str, query: bytes) -> str:
    """The text of a path and its query for the log."""
    text = f"{path}?{query.decode('latin-1')}" if query else path
    return text[:LONGEST_PATH].encode(errors="replace").decode().replace("\0", "\ufffd")


#: The columns that the hash of an entry covers, in this order.
_HASHED: Final = (
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

_COUNT_ENTRY: Final = (
    update(audit_head)
    .values(entries=audit_head.c.entries + 1)
    .returning(audit_head.c.entries, audit_head.c.hash)
)


@dataclass(frozen=True, slots=True)
class RefusedLogin:
    """An entry about a refused key; `source` is written once in each `minute` of wall time."""

    entry: AuditEntry
    minute: int
    source: str


async def add_refused(tx: Tx, login: RefusedLogin, *, most: int) -> None:
    """Add an entry about a refused key, unless its minute has it, or has `most` of all replicas."""
    # Other replicas wait here, so that both see what the other has added.
    await tx.execute(select(audit_head.c.entries).with_for_update())
    same = select(audit.c.refused_source).where(audit.c.refused_minute == login.minute)
    noted = set((await tx.execute(same)).scalars())
    if login.source not in noted and len(noted) < most:
        await add(tx, login.entry, minute=login.minute, source=login.source)


async def add(
    tx: Tx, entry: AuditEntry, *, minute: int | None = None, source: str | None = None
) -> None:
    """Add an entry after the last one; other replicas wait for the COMMIT of this one."""
    head = (await tx.execute(_COUNT_ENTRY)).one()
    row = {
        **entry.model_dump(exclude={"at", "wall_at"}),
        "at_ms": moment_to_ms(entry.at),
        "at_wall_ms": moment_to_ms(entry.wall_at),
        "number": head.entries,
    }
    row["hash"] = entry_hash(head.hash, row)
    row |= {"refused_minute": minute, "refused_source": source}
    await tx.execute(insert(audit).values(row))
    await tx.execute(update(audit_head).values(hash=row["hash"]))


def entry_hash(previous: str, row: Mapping[str, Any]) -> str:
    """The hash of an entry after the one with the hash `previous`; the row is one of `audit`.

    Any: columns have every type.
    """
    return next_hash(previous, json.dumps([row[name] for name in _HASHED]))


class AuditQuery(PageQuery):
    """The query of the audit log; `path` is how the entries' paths begin."""

    role: Annotated[AuditRole | None, Field(description="Only calls of this role.")] = None
    subject_id: Annotated[
        SubjectId | None, Field(description="Only calls of this provider or operator.")
    ] = None
    path: Annotated[
        str | None,
        Field(
            min_length=1,
            max_length=LONGEST_PATH,
            description="Only calls whose path begins with this text.",
        ),
    ] = None


async def page(connection: AsyncConnection, query: AuditQuery) -> Sequence[AuditEntry]:
    """Up to limit + 1 entries, the newest first."""
    statement = select(audit)
    if query.role is not None:
        statement = statement.where(audit.c.role == query.role)
    if query.subject_id is not None:
        statement = statement.where(audit.c.subject_id == query.subject_id)
    if query.path is not None:
        # Not LIKE: on SQLite it ignores case.
        begins = func.substr(audit.c.path, 1, len(query.path)) == query.path
        statement = statement.where(begins)
    if (after := query.after_id()) is not None:
        statement = statement.where(audit.c.entry_id < after)
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
