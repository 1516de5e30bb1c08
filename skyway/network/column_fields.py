"""Checks of whole columns of JSON values: as strict as `fields` and fast, but without messages.

A column that raises `Doubtful` may still be right. `fields` decides, and names the fault.
"""

import gc
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import chain
from operator import itemgetter
from typing import Any

import numpy as np

from skyway.network.columns import Floats

# The values below are `Any`: they come from json.loads and are checked here.

_IDENTIFIER_LETTERS = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-"
_IDENTIFIER_LENGTH_MAX = 64


class Doubtful(Exception):
    """A value in a column is wrong or unusual; only the reader of single values can say what."""


@contextmanager
def collector_paused() -> Iterator[None]:
    """Pause the garbage collector while a big document is made.

    A JSON document has no cycles, and looking for them takes as long as making the document.
    Reference counting goes on. If two threads pause at the same time, the first to end resumes
    the collector for both.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def member(objects: Iterable[Any], name: str) -> list[Any]:
    """The member of this name of each object."""
    objects = list(objects)
    _refuse_others(objects, dict)
    try:
        return [each[name] for each in objects]
    except KeyError as error:
        raise Doubtful(name) from error


def members(objects: Sequence[Any], *names: str) -> list[list[Any]]:
    """The members of these names of each object, a list for each name."""
    _refuse_others(objects, dict)
    try:
        return [list(map(itemgetter(name), objects)) for name in names]
    except KeyError as error:
        raise Doubtful from error


def constants(values: Sequence[Any], expected: Iterable[str]) -> None:
    """Each value is the expected string."""
    _refuse_others(values, str)
    if list(values) != list(expected):
        raise Doubtful


def identifiers(values: Sequence[Any]) -> None:
    """Identifiers as `skyway.ids` defines them, all different."""
    _refuse_others(values, str)
    letters = "".join(values)
    if not letters.isascii() or letters.encode("ascii").translate(None, _IDENTIFIER_LETTERS):
        raise Doubtful
    if not all(map(range(1, _IDENTIFIER_LENGTH_MAX + 1).__contains__, set(map(len, values)))):
        raise Doubtful
    if len(set(values)) < len(values):
        raise Doubtful


def texts_or_none(values: Sequence[Any]) -> None:
    """Strings, or null."""
    _refuse_others(values, str, type(None))


def truths(values: Sequence[Any]) -> None:
    """True or false."""
    _refuse_others(values, bool)


def rows_of_truth(values: Sequence[Any]) -> list[int]:
    """The rows that hold true, where all values are true or false."""
    truths(values)
    return [row for row, value in enumerate(values) if value]


def numbers(values: Sequence[Any], *, low: float, high: float) -> Floats:
    """Finite numbers from low to high, ``(k,)``."""
    _refuse_others(values, float, int)
    try:
        column = np.array(values, np.float64)
    except OverflowError as error:
        raise Doubtful from error
    # NaN lies in no range.
    if not ((column >= low) & (column <= high)).all():
        raise Doubtful
    return column


def whole_numbers(values: Sequence[Any], *, low: int, high: int) -> Floats:
    """Whole numbers from low to high, ``(k,)``."""
    column = numbers(values, low=low, high=high)
    if (column != np.floor(column)).any():
        raise Doubtful
    return column


def arrays(values: Sequence[Any], *, length: int) -> list[Any]:
    """The elements of arrays of this length, one after another."""
    _refuse_others(values, list, tuple)
    if not set(map(len, values)) <= {length}:
        raise Doubtful
    return list(chain.from_iterable(values))


def positions(values: Sequence[Any]) -> tuple[Floats, Floats]:
    """Longitudes and latitudes of GeoJSON positions of two numbers, ``(k,)`` each."""
    flat = arrays(values, length=2)
    return numbers(flat[::2], low=-180.0, high=180.0), numbers(flat[1::2], low=-90.0, high=90.0)


def unknown_members(
    objects: Sequence[Mapping[str, Any]], known: frozenset[str]
) -> dict[int, dict[str, Any]]:
    """The members that Skyway does not read, by the index of their object."""
    unusual = [index for index, each in enumerate(objects) if not each.keys() <= known]
    return {
        index: {name: value for name, value in objects[index].items() if name not in known}
        for index in unusual
    }


def _refuse_others(values: Iterable[Any], *kinds: type) -> None:
    # Exactly these types: `true` is an int to Python, and a subclass may behave differently.
    if not set(map(type, values)) <= set(kinds):
        raise Doubtful
