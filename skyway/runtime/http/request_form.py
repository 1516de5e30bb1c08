"""Which forms of a request every server and proxy reads alike; all others are refused.

llhttp, the parser, reads more forms than its callers, and a proxy in front, may agree on.
"""

import re
from collections.abc import Sequence
from typing import Final

_FIRST_LINE: Final = re.compile(rb"[A-Z]+ [^ ]+ HTTP/1\.[01]\r?\n")


class FirstLine:
    """The first line of a request as it comes in: no empty lines before it, single spaces in it."""

    def __init__(self) -> None:
        #: What has come of the line; None once the line is complete.
        self._line: bytes | None = b""

    def goes_on_well(self, data: bytes) -> bool:
        """Whether the line may be well formed with these next bytes of the request."""
        if self._line is None:
            return True
        line, end, _ = data.partition(b"\n")
        self._line += line + end
        if not end:
            return not self._line.startswith(b"\r")
        is_well_formed = _FIRST_LINE.fullmatch(self._line) is not None
        self._line = None
        return is_well_formed


def is_understood_alike(
    target: bytes, headers: Sequence[tuple[bytes, bytes]], version: str
) -> bool:
    """Whether the head of the request has one meaning only; the names are in lower case.

    A request has one host, its target is a path without a fragment, and chunks are its only
    encoding. The parser takes a body after an Upgrade for another protocol.
    """
    names = [name for name, _ in headers]
    encodings = [value.lower() for name, value in headers if name == b"transfer-encoding"]
    has_body = bool(encodings) or b"content-length" in names
    return (
        (names.count(b"host") == 1 or (b"host" not in names and version == "1.0"))
        and target.startswith((b"/", b"*"))
        and b"#" not in target
        and encodings in ([], [b"chunked"])
        and not (has_body and b"upgrade" in names)
    )
