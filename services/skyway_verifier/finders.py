"""Finders of what breaks a rule: by conditions, by rows, by loaded things; and reading of texts."""

from collections.abc import Awaitable, Callable, Mapping
from datetime import datetime
from typing import Any, Final, TypeVar

from sqlalchemy import ColumnElement, Select, or_, select

from skyway.errors import InvalidInput
from skyway.units import moment_to_ms
from skyway_verifier.rule import Subjects, Survey

T = TypeVar("T")
D = TypeVar("D")

#: What a text raises that does not have its form; another rule names such texts.
_UNREADABLE_TEXT: Final = (ValueError, KeyError, TypeError, OverflowError, InvalidInput)


# Any: columns and rows have every type.
def any_of(subject: ColumnElement[Any], *is_broken: ColumnElement[bool]) -> Subjects:
    """The subjects for which one of these conditions is true."""
    return select(subject).where(or_(*is_broken))


def rows_where(
    query: Select[Any], is_broken: Callable[[Any], bool], *names: str
) -> Callable[[Survey], Awaitable[list[str]]]:
    """The rows for which a condition is true, by their values of these names.

    A row whose texts cannot be read is left out.
    """

    async def find(survey: Survey) -> list[str]:
        return [
            "/".join(str(getattr(row, name)) for name in names)
            async for row in survey.each(query)
            if readable(False, is_broken, row)
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


def readable(default: D, read: Callable[..., T], *values: Any) -> T | D:
    """What is read from these values, or a default if a text among them cannot be read."""
    try:
        return read(*values)
    except _UNREADABLE_TEXT:
        return default


def differs(row: Any, said: Mapping[str, object]) -> bool:
    """Whether a column of a row has another value than what is said of it elsewhere."""
    return any(getattr(row, name) != value for name, value in said.items())


def repeats(row: Any, body: Mapping[str, Any], *names: str) -> bool:
    """Whether the columns of these names repeat the members of a JSON text."""
    return not differs(row, {name: body[name] for name in names})


def ms_of(text: str) -> int:
    """The moment in a JSON text, ms since 1970."""
    return moment_to_ms(datetime.fromisoformat(text))
