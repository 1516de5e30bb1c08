"""Checks that stored texts and secrets still have the form in which they were written."""

import base64
import re
from collections import defaultdict
from collections.abc import Callable, Mapping
from typing import Any, Final

from sqlalchemy import Column, Table, select

from skyway_verifier.rule import Rule, Survey
from skyway_verifier.storage_rules import name_of

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
