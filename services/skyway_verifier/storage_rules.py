"""The rules that hold for every service's database and for every outbox.

Stored texts and secrets still have the form in which they were written.
"""

import base64
import re
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import cache
from itertools import groupby
from typing import Any, Final

from sqlalchemy import (
    BigInteger,
    Column,
    ColumnElement,
    CompoundSelect,
    Float,
    ForeignKeyConstraint,
    MetaData,
    String,
    Table,
    Text,
    and_,
    bindparam,
    cast,
    exists,
    func,
    literal,
    or_,
    select,
    text,
    union_all,
)

from skyway.bounds import LATEST
from skyway.runtime.sql.claims import LONGEST_CLAIM_MS
from skyway.units import NEVER_MS, moment_to_ms
from skyway_verifier.rule import Finder, Rule, Subjects, Survey, statement_text

#: The most faults of pages that SQLite lists.
_MOST_FAULTS: Final = 100


#: A year after the last moment that a message may name: sums of moments and durations.
_LAST_MOMENT_MS: Final = moment_to_ms(LATEST) + 366 * 86_400_000
#: Every reader of JSON holds such a number exactly.
_LARGEST_WHOLE: Final = 2**53
#: Far beyond everything that is measured, and below infinity.
_LARGEST_DOUBLE: Final = 1e300

#: The clocks of machines differ by less, and senders wait a minute at most. Wall ms.
_CLOCKS_DIFFER_MS: Final = 600_000

#: How the names of columns begin whose moments may be ahead, or that are spans, or measure only.
_AHEAD: Final = (
    *("expires_", "ends_", "due_", "next_", "claimed_until_", "until_", "held_until_", "retry_"),
    *("give_up_", "earliest_", "promised_", "eta_", "start_", "end_", "planned_", "released_"),
    *("served_", "from_", "free_", "duration_", "saved_", "stored_"),
)


def storage_rules(
    metadata: MetaData, *, triggers: Iterable[str] = (), ahead: Collection[Column[int]] = ()
) -> tuple[Rule, ...]:
    """The rules of a database; SQLite also has `triggers`. Moments of `ahead` may be ahead."""
    tables = metadata.sorted_tables
    return (
        Rule(
            "every page of the database is whole",
            _damaged_pages,
            "The storage is damaged. Stop the service, copy its database files away, check the "
            "disk, and restore the newest backup (docs/reference/operations.md). If only an index "
            "is named, `REINDEX` makes it again.",
        ),
        Rule(
            "every index and trigger of the newest migration exists",
            _missing_parts(tables, frozenset(triggers)),
            "Somebody dropped it, so the database no longer refuses wrong rows. Make it again as "
            "the migration does, and look for rows that it would have refused.",
        ),
        Rule(
            "every row that is referred to exists",
            _orphans_of(tables),
            "A row was deleted while others refer to it. Restore that row from a backup, or delete "
            "the rows that refer to it if their delivery is over and settled with its customer.",
        ),
        Rule(
            "every text is stored as text",
            _wrong_types(tables),
            "Something else than Skyway wrote this column. Restore the row from a backup.",
        ),
        Rule(
            "every moment and number is one that Skyway writes",
            union_of(found for table in tables for found in _out_of_bounds(table)),
            "The row cannot be shown, and a list with it may be answered 500. Restore the row from "
            "a backup, or set the column to what a neighbouring row has.",
        ),
        Rule(
            "no claim lasts longer than ten minutes",
            later_than(
                lambda survey: survey.wall_ms + LONGEST_CLAIM_MS,
                [table.c.claimed_until_ms for table in tables if "claimed_until_ms" in table.c],
            ),
            "Such a claim does not count, so the row is worked on all the same. Set `claimed_by` "
            "to NULL and `claimed_until_ms` to 0 in this row, and check the clocks of all "
            "machines.",
        ),
        *(
            Rule(
                f"what is stored as past is past, by {name} time",
                later_than(latest_ms, [*_past_moments(tables, ahead, wall=name == "wall")]),
                "The moment is later than now, so what depends on its age is never done. Restore "
                "the row from a backup, or set the column to what a neighbouring row has. Check "
                "the clocks of all machines, and `SKYWAY_CLOCK_FILE`.",
            )
            for name, latest_ms in (
                ("wall", lambda survey: survey.wall_ms + _CLOCKS_DIFFER_MS),
                ("fleet", lambda survey: survey.fleet_ms),
            )
        ),
    )


def replica_rule(replicas: Table) -> Rule:
    """The rule of a table of live replicas."""
    joined_ms, seen_ms = replicas.c.joined_wall_ms, replicas.c.seen_wall_ms
    is_wrong = or_(joined_ms < 0, joined_ms > seen_ms)
    return Rule(
        "a replica was seen since it joined",
        select(replicas.c.replica_id).where(is_wrong),
        "Delete the row of `replicas`: a replica that lives adds it again within a second.",
    )


def name_of(table: Table, *values: object) -> str:
    """The name of a row: its table and its key."""
    return f"{table.name} {'/'.join(map(str, values))}"


async def _damaged_pages(survey: Survey) -> list[str]:
    if survey.dialect == "sqlite":
        found = await survey.rows(text(f"PRAGMA integrity_check({_MOST_FAULTS})"))
        return [str(row[0]) for row in found if row[0] != "ok"]
    failures = await survey.texts(
        "SELECT checksum_failures FROM pg_stat_database"
        " WHERE datname = current_database() AND checksum_failures > 0"
    )
    return [f"{count} pages did not match their checksum" for (count,) in failures]


def _missing_parts(tables: Iterable[Table], triggers: frozenset[str]) -> Finder:
    indexes = {str(index.name) for table in tables for index in table.indexes}

    async def find(survey: Survey) -> set[str]:
        listed, parts = "SELECT indexname FROM pg_indexes", indexes
        if survey.dialect == "sqlite":
            listed = "SELECT name FROM sqlite_master WHERE type IN ('index', 'trigger')"
            parts = indexes | triggers
        return parts - {name for (name,) in await survey.texts(listed)}

    return find


def _orphans_of(tables: Iterable[Table]) -> Finder:
    """Rows whose foreign keys lead nowhere, also where the database did not check them."""
    keys = [(table, key) for table in tables for key in table.foreign_key_constraints]
    return union_of(sorted((_orphans(table, key) for table, key in keys), key=str))


def _orphans(table: Table, key: ForeignKeyConstraint) -> Subjects:
    child, parent = table.alias("child"), key.referred_table.alias("parent")  # perhaps the same
    pairs = [(child.c[each.parent.name], parent.c[each.column.name]) for each in key.elements]
    own = _joined(child.c[each.name] for each in table.primary_key)
    missing = _joined(column for column, _ in pairs)
    subject = literal(f"{table.name} ") + own + f" without {key.referred_table.name} " + missing
    return select(subject).where(
        *(column.is_not(None) for column, _ in pairs),
        ~exists().where(and_(*(column == referred for column, referred in pairs))),
    )


def _joined(columns: Iterable[ColumnElement[Any]]) -> ColumnElement[str]:
    """The values of columns as one text."""
    texts: list[ColumnElement[str]] = [cast(column, String) for column in columns]
    joined = texts[0]
    for each in texts[1:]:
        joined = joined + "/" + each
    return joined


def _wrong_types(tables: Iterable[Table]) -> Finder:
    """Other values in text columns. SQLite stores any type anywhere; PostgreSQL does not."""
    query = union_of(
        select(literal(f"{table.name}.{column.name} ") + _joined(table.primary_key)).where(
            func.typeof(column).not_in(("text", "null"))
        )
        for table in tables
        for column in table.c
        if isinstance(column.type, Text)
    )
    statement = cache(lambda: statement_text(query, "sqlite"))

    async def find(survey: Survey) -> set[str]:
        if survey.dialect != "sqlite":
            return set()
        return {subject for (subject,) in await survey.texts(statement())}

    return find


def union_of(queries: Iterable[Subjects]) -> Subjects:
    """All subjects of several queries as one query."""
    return select(union_all(*queries).subquery())


def _out_of_bounds(table: Table) -> Iterator[Subjects]:
    """The rows with a moment outside of the calendar, or with a number that JSON does not hold."""
    limits = [
        or_(column < low, and_(column > high, column != NEVER_MS))
        for column in table.c
        for low, high in _bounds_of(column)
    ]
    if limits:
        yield select(literal(f"{table.name} ") + _joined(table.primary_key)).where(or_(*limits))


def _bounds_of(column: Column[Any]) -> Iterator[tuple[float, float]]:
    """The least and the greatest value; a double that is not a number is greater than all."""
    if isinstance(column.type, BigInteger) and column.name.endswith("_ms"):
        yield 0, _LAST_MOMENT_MS
    elif isinstance(column.type, BigInteger):
        yield -_LARGEST_WHOLE, _LARGEST_WHOLE
    elif isinstance(column.type, Float):
        yield -_LARGEST_DOUBLE, _LARGEST_DOUBLE


def later_than(
    latest_ms: Callable[[Survey], int | None],
    columns: Iterable[Column[int]],
    *conditions: ColumnElement[bool],
) -> Finder:
    """The rows with one of these moments after the latest one; none if that is not known."""
    by_table = [(table, [*of]) for table, of in groupby(columns, lambda each: each.table)]

    @cache
    def late_rows() -> CompoundSelect[Any]:
        return union_all(
            *(
                select(literal(f"{table.name} ") + _joined(table.primary_key)).where(
                    or_(*(each > bindparam("latest_ms") for each in moments)),
                    *conditions,
                    *_is_live(table),
                )
                for table, moments in by_table
            )
        )

    async def find(survey: Survey) -> set[str]:
        if not by_table or (latest := latest_ms(survey)) is None:
            return set()
        rows = await survey.rows(late_rows(), latest_ms=latest)
        return {str(row[0]) for row in rows}

    return find


def _is_live(table: Table) -> Iterator[ColumnElement[bool]]:
    """Rows that are no test delivery's: the sandbox plays these within seconds, by their plans."""
    if "delivery_id" in table.c:
        yield ~func.coalesce(table.c.delivery_id, "").startswith("dlv_test_", autoescape=True)


def _past_moments(
    tables: Iterable[Table], ahead: Collection[Column[int]], *, wall: bool
) -> Iterable[Column[int]]:
    """The columns of moments that have passed when they are stored, of wall or of fleet time."""
    return (
        column
        for table in tables
        for column in table.c
        if column.name.endswith("_ms")
        and not (column.name.startswith(_AHEAD) or any(column is each for each in ahead))
        and column.name.endswith("_wall_ms") == wall
    )


def outbox_rules(outbox: Table, *, channels: Collection[str]) -> tuple[Rule, ...]:
    """The rules of the outbox of a service that sends on these channels."""
    return (
        Rule(
            "a message in the outbox is sent again within ten minutes",
            later_than(lambda survey: survey.wall_ms + _CLOCKS_DIFFER_MS, [outbox.c.due_at_ms]),
            "The message and all later ones of its stream wait. Set `due_at_ms` of this row to 0. "
            "Check the clocks of all machines.",
        ),
        Rule(
            "a message in the outbox has a receiver",
            select(outbox.c.id).where(outbox.c.channel.not_in(sorted(channels))),
            f"Nobody sends this message: `channel` must be one of {', '.join(sorted(channels))}. "
            "Correct it: `address` shows a topic of MQTT or a path of a service.",
        ),
    )


#: Reads a stored text; a ValueError says why it cannot be read. Any: each text has its own type.
Reader = Callable[[Any], object]

_NAME: Final = "every stored text has its form"

_ADVICE: Final = (
    "The text was damaged, and its row cannot be used. Restore the row from a backup. The same "
    "values are often stored twice: in the columns of the row, in an instruction, in an event, or "
    "in the other service."
)


_SHA256: Final = re.compile(r"[0-9a-f]{64}")

#: Version, time, initial vector and signature of a Fernet token; its text comes in whole blocks.
_FERNET_FRAME_BYTES: Final = 1 + 8 + 16 + 32

_FERNET_BLOCK_BYTES: Final = 16

_FERNET_VERSION: Final = 0x80


def form_rule(readers: Mapping[Column[Any], Reader]) -> Rule:
    """The rule that a reader can read each text of its column."""
    by_table: dict[Table, dict[str, Reader]] = defaultdict(dict)
    for column, reader in readers.items():
        by_table[column.table][column.name] = reader

    async def find(survey: Survey) -> list[str]:
        return [
            subject
            for table, columns in by_table.items()
            for subject in await _unreadable(survey, table, columns)
        ]

    return Rule(_NAME, find, _ADVICE)


async def _unreadable(survey: Survey, table: Table, columns: Mapping[str, Reader]) -> list[str]:
    keys = [*table.primary_key]
    found: list[str] = []
    async for row in survey.each(select(*keys, *(table.c[name] for name in columns))):
        key, values = row[: len(keys)], row[len(keys) :]
        for (name, read), value in zip(columns.items(), values, strict=True):
            if value is not None and not _is_readable(read, value):
                found.append(f"{table.name}.{name} of {name_of(table, *key)}")
    return found


def _is_readable(read: Reader, value: object) -> bool:
    try:
        read(value)
    except ValueError:
        return False
    return True


def read_sha256(text: str) -> str:
    """The text of a SHA-256.

    Raises
    ------
    ValueError
        It is not 64 hexadecimal digits.
    """
    if _SHA256.fullmatch(text) is None:
        raise ValueError("not a SHA-256")
    return text


def read_fernet_token(sealed: bytes) -> bytes:
    """The bytes of a Fernet token; nobody can read its text without its key.

    Raises
    ------
    ValueError
        It is not a whole token.
    """
    token = base64.urlsafe_b64decode(sealed)
    text_bytes = len(token) - _FERNET_FRAME_BYTES
    is_whole = text_bytes > 0 and text_bytes % _FERNET_BLOCK_BYTES == 0
    if not is_whole or token[0] != _FERNET_VERSION:
        raise ValueError("not a whole Fernet token")
    return token
