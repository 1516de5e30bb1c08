"""The rows of a database that break the rules of its service."""

from collections.abc import Mapping
from typing import Any

from sqlalchemy import CompoundSelect, Select, String, cast, literal, union_all
from sqlalchemy.ext.asyncio import AsyncConnection

#: A broken rule (`rule`), and what breaks it (`subject`).
Violation = Mapping[str, str]

#: For each rule a query that must find no row. A row's one column is the subject that breaks it.
Rules = Mapping[str, Select[*tuple[Any, ...]]]

#: Finds each violation, as rows of rule and subject.
Check = CompoundSelect[str, str]


def check_of(rules: Rules) -> Check:
    """All rules as one statement. All rules see the data of one moment."""
    return union_all(*(_rows(rule, query) for rule, query in rules.items()))


def _rows(rule: str, query: Select[*tuple[Any, ...]]) -> Select[str, str]:
    (subject,) = query.selected_columns
    return query.with_only_columns(
        literal(rule, String), cast(subject, String), maintain_column_froms=True
    )


async def violations_found(connection: AsyncConnection, check: Check) -> list[Violation]:
    """Each violation once, in the order of rules and subjects."""
    rows = await connection.execute(check)
    return [{"rule": rule, "subject": subject} for rule, subject in sorted({*rows})]
