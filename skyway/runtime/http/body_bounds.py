"""How large a body of a route can be, by its schema, and the check that a body is no larger.

A body is counted before it is parsed. So a wrong body costs at most what the largest valid body
costs, however many wrong things it holds.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, Self

from fastapi import Request
from pydantic import TypeAdapter

#: The most bytes of a body whose route allows no more (docs/reference/rest.md).
BODY_LIMIT_BYTES: Final = 256 * 1024
#: Every route reads so much, so that the answer can name a few unknown fields.
_LEAST_BYTES, _LEAST_VALUES = 4 * 1024, 200

#: Bytes of one character as ``\\uXXXX``, of a number, of a moment, and around a member.
_CHARACTER, _NUMBER, _MOMENT, _AROUND = 6, 25, 40, 4
#: Without a limit in the schema, only the limit of the bytes bounds the rest.
_UNBOUNDED: Final = 10**15
#: The least bytes of a value, on average over a body: where the schema bounds the number of values,
#: and where it does not. Real reports and shortlists take more than 16. A body of 16,384 values is
#: parsed and refused in less than 5 ms.
_VALUE_BYTES, _UNBOUNDED_VALUE_BYTES = 8, 16

#: The most bytes of a body, for the caller of this request.
BodyLimit = Callable[[Request], int]

#: A JSON schema, whose members have no common static type.
Schema = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class BodyBounds:
    """The most that a valid body holds.

    Parameters
    ----------
    size_bytes
        Its bytes, with each character escaped and without spaces.
    values
        Its values, without the outermost: items of lists and members of objects.
    texts
        Its texts and the names of its members.
    members
        The members of its largest object.
    """

    size_bytes: int
    values: int = 0
    texts: int = 0
    members: int = 0

    @classmethod
    def of_schema(cls, schema: Schema, definitions: Schema, *, limit_bytes: int) -> Self:
        """The bounds of the bodies that this JSON schema allows.

        Parameters
        ----------
        definitions
            The schemas to which it refers, by name.
        limit_bytes
            The limit of a route, however large valid bodies may be.
        """
        found = _bounds(schema, definitions, ())
        size_bytes = min(max(found.size_bytes, _LEAST_BYTES), limit_bytes)
        counts = (found.values, found.texts, found.members)
        return cls(size_bytes, *(_most_of(each, size_bytes) for each in counts))

    @classmethod
    def of_type(cls, annotation: Any) -> Self:
        """The bounds of the bodies that pydantic reads as this type; any annotation."""
        schema = TypeAdapter(annotation).json_schema()
        return cls.of_schema(schema, schema.get("$defs", {}), limit_bytes=BODY_LIMIT_BYTES)

    def excess(self, body: "BodyText") -> str | None:
        """What the body holds too much of; None if it holds no more than a valid body can.

        The text is not parsed: brackets and commas outside of texts are counted.
        """
        if body.plain.count(b'"') > 2 * self.texts + 1:
            return f"holds more than {self.texts:,} texts and names"
        outside = body.outside
        if outside.count(b",") + outside.count(b"[") + outside.count(b"{") > self.values + 1:
            return f"holds more than {self.values:,} values"
        return None


class BodyText:
    """The JSON of a body, as it is looked at before and after it is parsed."""

    def __init__(self, raw: bytes) -> None:
        self.raw = raw

    @cached_property
    def plain(self) -> bytes:
        """The text without escaped quotes and backslashes: removing them takes a millisecond."""
        raw = self.raw
        return raw.replace(rb"\\", b"").replace(rb"\"", b"") if b"\\" in raw else raw

    @cached_property
    def outside(self) -> bytes:
        """What is outside of texts and names; made after quotes are counted, as it takes long."""
        return b"".join(self.plain.split(b'"')[::2])

    @property
    def members(self) -> int:
        """How many members its objects have, those that stand twice counted twice."""
        return self.outside.count(b":")


def _most_of(count: int, size_bytes: int) -> int:
    """How many values a body of this size may hold, if its schema allows this count."""
    value_bytes = _UNBOUNDED_VALUE_BYTES if count >= _UNBOUNDED else _VALUE_BYTES
    return min(max(count, _LEAST_VALUES), size_bytes // value_bytes)


def _bounds(schema: Schema, definitions: Schema, inside: tuple[str, ...]) -> BodyBounds:
    """The bounds of one value; `inside` are the definitions that hold it."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        if name in inside:
            return BodyBounds(_UNBOUNDED, _UNBOUNDED, _UNBOUNDED)
        return _bounds(definitions[name], definitions, (*inside, name))
    for choices in ("anyOf", "oneOf"):
        if choices in schema:
            return _largest(_bounds(each, definitions, inside) for each in schema[choices])
    if "enum" in schema or "const" in schema:
        values = schema.get("enum", [schema.get("const")])
        return BodyBounds(max(len(str(each)) for each in values) + 2, texts=1)
    match schema.get("type"):
        case "string":
            return BodyBounds(_text_bytes(schema), texts=1)
        case "array":
            return _bounds_of_list(schema, definitions, inside)
        case "object":
            return _bounds_of_object(schema, definitions, inside)
        case "number" | "integer" | "boolean" | "null":
            return BodyBounds(_NUMBER)
    return BodyBounds(_UNBOUNDED, _UNBOUNDED, _UNBOUNDED)


def _text_bytes(schema: Schema) -> int:
    if schema.get("format") == "date-time":
        return _MOMENT
    return int(_CHARACTER * schema["maxLength"] + 2) if "maxLength" in schema else _UNBOUNDED


def _bounds_of_list(schema: Schema, definitions: Schema, inside: tuple[str, ...]) -> BodyBounds:
    if "prefixItems" in schema:
        return _sum(_bounds(each, definitions, inside) for each in schema["prefixItems"])
    most = schema.get("maxItems", _UNBOUNDED)
    return _times(most, _bounds(schema.get("items", {}), definitions, inside))


def _bounds_of_object(schema: Schema, definitions: Schema, inside: tuple[str, ...]) -> BodyBounds:
    properties: Schema = schema.get("properties", {})
    own = _sum(
        _named(len(name), _bounds(each, definitions, inside)) for name, each in properties.items()
    )
    others = schema.get("additionalProperties", True)
    if others is False:
        return own
    if others is True and properties:
        return _times(2, own)  # a later version may send as much again
    name_bytes = _text_bytes(schema.get("propertyNames", {}))
    other = _named(name_bytes, _bounds({} if others is True else others, definitions, inside))
    most = schema.get("maxProperties", _UNBOUNDED)
    both = _sum([own, _times(most, other)])
    return BodyBounds(both.size_bytes, both.values, both.texts, max(own.members + most, 1))


def _named(name_bytes: int, value: BodyBounds) -> BodyBounds:
    size_bytes = value.size_bytes + name_bytes + _AROUND
    return BodyBounds(size_bytes, value.values, value.texts + 1, value.members)


def _times(most: int, each: BodyBounds) -> BodyBounds:
    """A list of so many of these."""
    return BodyBounds(
        min(2 + most * (each.size_bytes + 1), _UNBOUNDED),
        min(max(most * (each.values + 1), 1), _UNBOUNDED),
        min(most * each.texts, _UNBOUNDED),
        each.members,
    )


def _sum(parts: Iterable[BodyBounds]) -> BodyBounds:
    """An object, or a list of fixed length, with all of these."""
    every = tuple(parts)
    return BodyBounds(
        min(2 + sum(each.size_bytes + 1 for each in every), _UNBOUNDED),
        min(max(sum(each.values + 1 for each in every), 1), _UNBOUNDED),
        min(sum(each.texts for each in every), _UNBOUNDED),
        max([len(every), *(each.members for each in every)]),
    )


def _largest(choices: Iterable[BodyBounds]) -> BodyBounds:
    every = tuple(choices)
    return BodyBounds(
        max(each.size_bytes for each in every),
        max(each.values for each in every),
        max(each.texts for each in every),
        max(each.members for each in every),
    )
