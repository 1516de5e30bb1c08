"""JSON as text: its value, and what readers of JSON would read in different ways."""

import json
import re
import sys
from collections.abc import Iterator
from typing import Any, Final

#: The names and numbers that lead to a member.
Path = tuple[str | int, ...]

#: What is wrong with a member that stands twice.
STANDS_TWICE: Final = "stands twice in one object"

#: The name of a member in JSON without backslashes.
_NAMES: Final = re.compile(rb'"([^"]*)"\s*:')


class BrokenJson(ValueError):
    """A text is not JSON from this place on; lines and columns are counted from 1."""

    def __init__(self, line: int, column: int) -> None:
        super().__init__(f"not JSON at line {line}, column {column}")
        self.line, self.column = line, column


def json_value(text: bytes | str) -> Any:  # any JSON value
    """The value of JSON in UTF-8, with or without a byte order mark.

    A whole number of too many digits for Python is infinite, and `NaN` is read, too: who checks the
    value names its field.

    Raises
    ------
    BrokenJson
        The text is not JSON.
    ValueError
        The text is not UTF-8, or nests too deeply.
    """
    try:
        text = text.decode("utf-8-sig") if isinstance(text, bytes) else text
        return _parsed(text)
    except json.JSONDecodeError as error:
        raise BrokenJson(error.lineno, error.colno) from error
    except UnicodeDecodeError as error:
        raise ValueError("the text is not UTF-8") from error
    except RecursionError as error:
        raise ValueError("the text nests too deeply") from error


def _parsed(text: str) -> Any:  # any JSON value
    from pydantic_core import from_json  # not for those who only ask for help

    try:
        return from_json(text)  # in about half of the time that Python's parser needs
    except ValueError:
        # Python names the place of the fault, or accepts more.
        return json.loads(text, parse_int=whole_or_infinite)


def whole_or_infinite(digits: str) -> int | float:
    """The number of these digits; infinite if Python reads no number of so many digits."""
    return int(digits) if len(digits) <= sys.int_info.default_max_str_digits else float(digits)


def repeated_member(raw: bytes) -> Path | None:
    """The path of a member that stands twice in one object of this JSON; None if there is none.

    Readers of JSON differ: most take the last value of such a member, some the first.
    """
    if b"\\" not in raw:
        names = _NAMES.findall(raw)
        if len(set(names)) == len(names):  # of most messages: no name stands twice at all
            return None
    return next(_repeated(json.loads(raw, object_pairs_hook=tuple), ()), None)


def _repeated(value: Any, above: Path) -> Iterator[Path]:  # JSON with tuples of pairs as objects
    names = set[str | int]()
    for number, each in enumerate(value if isinstance(value, list | tuple) else ()):
        name, inner = each if isinstance(value, tuple) else (number, each)
        if name in names:
            yield (*above, name)
        names.add(name)
        yield from _repeated(inner, (*above, name))
