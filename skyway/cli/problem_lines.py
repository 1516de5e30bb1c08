"""Reads a file that holds one JSON document, or JSON Lines with one on every line."""

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, BinaryIO, Never


@dataclass(frozen=True, slots=True)
class NotJson:
    """What stands where a document should, and the line at fault, counted from 1."""

    line: int
    detail: str


@dataclass(frozen=True, slots=True)
class Document:
    """A JSON value with the number of its first line, counted from 1."""

    line: int
    value: Any  # any JSON value


def documents(file: BinaryIO) -> Iterator[Document | NotJson]:
    """The documents of a file, each as soon as it is read.

    A first line that is JSON by itself is followed by others of its kind.
    """
    for number, line in enumerate(file, start=1):
        if not line.strip():
            continue
        first = _read(line, number)
        if isinstance(first, Document):
            yield first
            yield from _lines(file, first_line=number + 1)
        else:
            yield from _whole_or_lines(b"\n" * (number - 1) + line + file.read())
        return
    yield NotJson(1, "nothing to read")


def _whole_or_lines(raw: bytes) -> Iterator[Document | NotJson]:
    """One document over many lines, or lines of which the first is broken."""
    whole = _read(raw, 1)
    if isinstance(whole, Document):
        yield whole
        return
    lines = raw.splitlines()
    # A broken single document is told by its one brace that is not indented.
    unindented = [line for line in lines if line[:1] == b"{"]
    if len(unindented) > 1 or any(isinstance(_read(line, 1), Document) for line in unindented):
        yield from _lines(lines, first_line=1)
    else:
        yield whole


def _lines(lines: Iterable[bytes], *, first_line: int) -> Iterator[Document | NotJson]:
    for number, line in enumerate(lines, start=first_line):
        if line.strip():
            yield _read(line, number)


def _read(raw: bytes, line: int) -> Document | NotJson:
    try:
        return Document(line, json.loads(raw, parse_constant=_refuse_constant))
    except json.JSONDecodeError as error:
        return NotJson(line + error.lineno - 1, f"not JSON: {error.msg} at column {error.colno}")
    except UnicodeDecodeError as error:
        return NotJson(line, f"not UTF-8: {error.reason}")
    except (ValueError, RecursionError) as error:
        return NotJson(line, f"not JSON: {error}")


def _refuse_constant(name: str) -> Never:
    raise ValueError(f"{name} is not a number in JSON")
