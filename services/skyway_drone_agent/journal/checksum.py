"""A checksum on each line of a journal: a line that has changed on the disk is never used.

A line stays one JSON object; its last member is the CRC-32 of all text before that member.
"""

import zlib
from typing import Final

_NAME: Final = b',"crc":"'
_END: Final = b'"}'
_LENGTH: Final = len(_NAME) + 8 + len(_END)


class ChangedLine(ValueError):
    """The text of a line has changed since it was written."""


def with_checksum(text: str) -> bytes:
    """The line of a JSON object that is not empty, without its end of line."""
    before = text.removesuffix("}").encode()
    return b"%b%b%08x%b" % (before, _NAME, zlib.crc32(before), _END)


def has_checksum(line: bytes) -> bool:
    """Whether the line ends with a checksum; the torn last line of a journal has none."""
    return line[-_LENGTH:].startswith(_NAME) and line.endswith(_END)


def without_checksum(line: bytes) -> bytes:
    """The JSON object in a line with a checksum.

    Raises
    ------
    ChangedLine
        The checksum is not that of the text before it.
    """
    before = line[:-_LENGTH]
    if with_checksum(before.decode(errors="replace") + "}") != line:
        raise ChangedLine("the checksum is not that of the line")
    return before + b"}"
