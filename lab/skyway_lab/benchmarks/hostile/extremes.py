"""Values at the edges of their types, and documents in which some values are replaced by them."""

import copy
import random
from collections.abc import Iterator
from typing import Any, Final

#: Not readable: no JSON, no object, not this schema, too large, too deep.
UNREADABLE: Final = (
    b"{",
    b"null",
    b"[]",
    b"\x00",
    b"\xff\xfe\xfa",
    b'{"schema_version": 2}',
    b'{"seq": 1e999}',
    b'{"seq": ' + b"9" * 6_000 + b"}",
    b"[" * 20_000,
    b'{"detail": "\\ud800"}',
    b'{"detail": "' + b"x" * 200_000 + b'"}',
)

_MOMENTS: Final = (
    "0001-01-01T00:00:00Z",
    "1969-12-31T23:59:59Z",
    "9999-12-31T23:59:59Z",
    "9999-12-31T23:59:59-12:00",
    "2026-03-02T08:00:00+14:00",
    "2026-02-30T00:00:00Z",
)
_NUMBERS: Final = (
    *(0, 1, -1, 2**31, 2**40, 2**53 - 1, 2**53, 2**63, -(2**63), 2**70),
    *(1e308, -1e308, 5e-324, float("nan"), float("inf")),
)
_TEXTS: Final = (
    "",
    "\u0000",
    "x" * 10_000,
    "\u202e",
    "'; DROP TABLE missions; --",
    "😀",
    "\x1b]0;title\x07\x1b[2J",
    "[bold red]markup[/]",
    "../../etc/passwd",
    "%2f..%2f",
    "$share/all/#",
    "a\r\nSet-Cookie: b",
    "\ud800",
)
_OTHERS: Final[tuple[Any, ...]] = (None, True, [], {}, [[]] * 1_000, {"a": {"b": {"c": {}}}})


#: One or two of each other type, for fields of any type.
_OF_OTHER_TYPES: Final[tuple[Any, ...]] = (*_OTHERS, 2**70, -1, "", "\u0000")


def extremes_like(value: object) -> tuple[object, ...]:
    """All values that look like this one."""
    match value:
        case bool():
            return (not value,)
        case int() | float():
            return _NUMBERS
        case str() if value[:2] == "20":
            return _MOMENTS
        case str():
            return _TEXTS
        case list():
            return tuple([number for _ in value] for number in _NUMBERS[:4])
        case _:
            return ({"\u0000": 2**70}, {"x" * 10_000: "\ud800"})


def extremes_for(value: object) -> tuple[object, ...]:
    """All values that look like this one, and some of other types."""
    return (*extremes_like(value), *_OF_OTHER_TYPES)


def all_texts() -> tuple[str, ...]:
    """All texts for a path or a query."""
    return (*_TEXTS, *_MOMENTS, *(str(number) for number in _NUMBERS))


def extreme_like(value: object, chance: random.Random) -> object:
    """Another value that looks like this one."""
    return chance.choice(extremes_like(value))


def extreme(value: object, chance: random.Random) -> object:
    """A value that looks like this one, or is of another type."""
    if chance.random() < 0.75:
        return extreme_like(value, chance)
    return copy.deepcopy(chance.choice((*_OTHERS, *_NUMBERS, *_TEXTS, *_MOMENTS)))


def extreme_text(chance: random.Random) -> str:
    """A text for a path or a query."""
    return chance.choice(all_texts())


def with_extremes(document: Any, chance: random.Random, *, most: int = 3) -> Any:  # any JSON value
    """The document with 1 to `most` of its values replaced, at any depth."""
    changed = {"": copy.deepcopy(document)}
    for _ in range(chance.randint(1, most)):
        holder, key = chance.choice(list(_places(changed)))
        holder[key] = extreme(holder[key], chance)
    return changed[""]


def _places(value: Any) -> Iterator[tuple[Any, Any]]:  # a list or an object, and an index or name
    """Where each value within this one stands."""
    match value:
        case dict():
            entries = list(value.items())
        case list():
            entries = list(enumerate(value[:20]))
        case _:
            return
    for key, inner in entries:
        yield value, key
        yield from _places(inner)
