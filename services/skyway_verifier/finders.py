"""Finders of what breaks a rule of `skyway verify`: by conditions, by rows, by loaded things."""

from collections.abc import Awaitable, Callable, Mapping
from typing import Any, Final, TypeVar

from sqlalchemy import ColumnElement, Select, or_, select

from skyway.runtime.sql.connection import AnyRow
from skyway_verifier.rule import Subjects, Survey

T = TypeVar("T")

#: What a text raises that does not have its form; another rule names such texts.
_UNREADABLE_TEXT: Final = (ValueError, KeyError, TypeError)


# Any: columns have every type.
def any_of(subject: ColumnElement[Any], *is_broken: ColumnElement[bool]) -> Subjects:
    """The subjects for which one of these conditions is true."""
    return select(subject).where(or_(*is_broken))


def rows_where(
    query: Select[Any], is_broken: Callable[[Any], bool], *names: str
) -> Callable[[Survey], Awaitable[list[str]]]:
    """The rows for which a condition is true, by their values of these names; Any: rows.

    A row whose texts cannot be read is left out.
    """

    def is_wrong(row: AnyRow) -> bool:
        try:
            return is_broken(row)
        except _UNREADABLE_TEXT:
            return False

    async def find(survey: Survey) -> list[str]:
        return [
            "/".join(str(getattr(row, name)) for name in names)
            async for row in survey.each(query)
            if is_wrong(row)
        ]

    return find


def each_where(
    load: Callable[[Survey], Awaitable[Mapping[Any, T]]], is_broken: Callable[[T], bool]
) -> Callable[[Survey], Awaitable[list[str]]]:
    """The loaded things for which a condition is true, by their keys: texts, or tuples of texts."""

    async def find(survey: Survey) -> list[str]:
        loaded = await survey.once(load)
        wrong = (key for key, each in loaded.items() if is_broken(each))
        return [key if isinstance(key, str) else "/".join(key) for key in wrong]

    return find
