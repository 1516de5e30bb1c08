"""The features of a FeatureCollection's text, decoded block after block.

A whole document as Python objects is ten times its text, and slow because of it.
"""

import json
import re
from collections.abc import Iterator
from typing import Any

from skyway.network.column_fields import Doubtful

_HEAD = re.compile(
    r'[ \t\n\r]*\{[ \t\n\r]*"type"[ \t\n\r]*:[ \t\n\r]*"FeatureCollection"[ \t\n\r]*,'
    r'[ \t\n\r]*"features"[ \t\n\r]*:[ \t\n\r]*\[[ \t\n\r]*'
)
_NEXT = re.compile(r',[ \t\n\r]*(?=\{[ \t\n\r]*"type"[ \t\n\r]*:[ \t\n\r]*"Feature")')

#: Characters decoded together: few enough for their objects to stay in a processor's cache.
_BLOCK = 50_000


class FeatureText:
    """A text that begins with its type and its features, as Skyway writes them.

    Raises
    ------
    Doubtful
        It begins otherwise, or is no JSON; `json.loads` of the whole tells.
    """

    def __init__(self, text: str) -> None:
        head = _HEAD.match(text)
        if head is None:
            raise Doubtful
        self._text = text
        self._at = head.end()

    def blocks(self) -> Iterator[list[Any]]:
        """The features, a block at a time."""
        text, at = self._text, self._at
        try:
            # What looks like a feature's beginning but is none leaves halves that are no JSON.
            while (following := _NEXT.search(text, at + _BLOCK)) is not None:
                yield json.loads(f"[{text[at : following.start()]}]")
                at = following.end()
            block, length = json.JSONDecoder().raw_decode(f"[{text[at:]}")
        except ValueError as error:
            raise Doubtful from error
        yield block
        self._at = at + length - 1

    def other_members(self) -> dict[str, Any]:
        """What follows the features, once all blocks were taken."""
        rest = self._text[self._at :].lstrip(" \t\n\r")
        if rest.strip(" \t\n\r") == "}":
            return {}
        try:
            others: dict[str, Any] = json.loads("{" + rest.removeprefix(","))
        except ValueError as error:
            raise Doubtful from error
        # Nothing after a comma is no JSON; a second `features` would count instead of the first.
        if not others or not rest.startswith(",") or {"type", "features"} & others.keys():
            raise Doubtful
        return others
