"""The dearest wrong bodies of an operation: as many wrong things as its schema lets pass."""

import json
from collections.abc import Iterator, Mapping
from typing import Any, Final

from skyway_lab.benchmarks.hostile.bodies import alternatives, resolved

#: Pieces that fill a body: what is repeated, with its brackets around all of them.
_FILLINGS: Final[Mapping[str, tuple[bytes, bytes, bytes]]] = {
    "items": (b"[", b"1,", b"1]"),
    "objects": (b"[", b"{},", b"1]"),
    "texts": (b"[", b'"",', b"1]"),
    "escapes": (b'["', rb"\u0041", b'"]'),
    "backslashes": (b'["', rb"\\", b'"]'),
    "quotes": (b'["', rb"\"", b'"]'),
    "control characters": (b'["', rb"\u0001", b'"]'),
    "one long text": (b'"', b"x", b'"'),
    "one long number": (b"", b"9", b""),
    "nested lists": (b"", b"[", b""),
    "nested objects": (b"", b'{"a":', b""),
}
#: Larger bodies are not made: the same things would be counted for longer.
_LARGEST_BYTES: Final = 256 * 1024
#: Unknown members beside the known ones of each object.
_UNKNOWN: Final = 3
_DEEPEST: Final = 6


def worst_bodies(
    schema: Mapping[str, Any], schemas: Mapping[str, Any], *, limit_bytes: int
) -> Iterator[tuple[str, bytes]]:
    """Each body with its name; a little smaller than the limit, so that it is looked at."""
    most_bytes = min(limit_bytes, _LARGEST_BYTES)
    for name, (before, piece, after) in _FILLINGS.items():
        count = (most_bytes - len(before) - len(after)) // len(piece)
        yield name, before + piece * count + after
    yield "unknown members", _members(most_bytes)
    for number, each in enumerate(alternatives(resolved_once(schema, schemas))):
        for share in (1.0, 0.3, 0.1):
            body = json.dumps(wrong(each, schemas, most=int(most_bytes * share / 8)))
            if len(body) <= most_bytes:
                yield f"all values of form {number} wrong, {share:.0%} of all items", body.encode()


def resolved_once(schema: Mapping[str, Any], schemas: Mapping[str, Any]) -> Mapping[str, Any]:
    """The schema to which this one refers, with all its alternatives."""
    while "$ref" in schema:
        schema = schemas[schema["$ref"].rpartition("/")[2]]
    return schema


def wrong(
    schema: Mapping[str, Any], schemas: Mapping[str, Any], *, most: int, depth: int = 0
) -> Any:  # any JSON value
    """A value of the right shape, with at most `most` values, that are all of the wrong type."""
    schema = resolved(schema, schemas)
    if depth > _DEEPEST or most < 1:
        return []
    if "properties" in schema:
        names = [*schema["properties"], *(f"unknown_{number}" for number in range(_UNKNOWN))]
        share = max(most // len(names), 1)
        return {
            name: wrong(schema["properties"].get(name, {}), schemas, most=share, depth=depth + 1)
            for name in names
        }
    if isinstance(schema.get("items"), dict):
        item = wrong(schema["items"], schemas, most=most, depth=depth + 1)
        size = max(len(json.dumps(item)) // 8, 1)
        return [item] * max(min(schema.get("maxItems", most), most // size), 1)
    return [] if schema.get("type") in ("string", "number", "integer", "boolean") else "x"


def _members(most_bytes: int) -> bytes:
    count = (most_bytes - 2) // len('"x00000":1,')
    return b"{" + b",".join(b'"x%05d":1' % number for number in range(count)) + b"}"
