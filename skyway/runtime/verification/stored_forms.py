"""Checks that stored texts still have the form in which they were written."""

from collections import defaultdict
from collections.abc import Callable, Mapping
from typing import Any, Final

from sqlalchemy import Column, Table, select

from skyway.runtime.verification.rule import Rule
from skyway.runtime.verification.storage_rules import name_of
from skyway.runtime.verification.survey import Survey

#: Reads a stored text; a ValueError says why it cannot be read. Any: each text has its own type.
Reader = Callable[[Any], object]

_NAME: Final = "every stored text has its form"

_ADVICE: Final = (
    "The text was damaged, and its row cannot be used. Restore the row from a backup. The same "
    "values are often stored twice: in the columns of the row, in an instruction, in an event, or "
    "in the other service."
)


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
