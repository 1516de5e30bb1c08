"""The fields of a body: those of its example, and those that its schema allows besides."""

import copy
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

#: The names and indexes that lead to a value within a body; none lead to the body itself.
Place = tuple[str | int, ...]

#: A schema may hold itself, so deeper values are left out.
_DEEPEST: Final = 6
_BY_FORMAT: Final[Mapping[str, str]] = {
    "date-time": "2026-03-02T08:17:00Z",
    "uri": "http://127.0.0.1:9/",
}
_BY_TYPE: Final[Mapping[str, Any]] = {
    "string": "x",
    "integer": 1,
    "number": 1.0,
    "boolean": False,
}


def with_all_fields(
    body: Any,  # any JSON value
    schema: Mapping[str, Any],
    schemas: Mapping[str, Any],
    depth: int = 0,
) -> Any:
    """The body with every field of its schema; `schemas` are those of the whole document."""
    schema = resolved(schema, schemas)
    if depth > _DEEPEST:
        return body
    if isinstance(body, dict) and "properties" in schema:
        properties = schema["properties"]
        extra = {name: sample(each, schemas, depth) for name, each in properties.items()}
        return {
            name: with_all_fields(value, properties.get(name, {}), schemas, depth + 1)
            for name, value in (extra | body).items()
        }
    if isinstance(body, list) and isinstance(schema.get("items"), dict):
        return [with_all_fields(each, schema["items"], schemas, depth + 1) for each in body]
    return body


def places(value: Any, at: Place = ()) -> Iterator[Place]:  # any JSON value
    """Where each value of a body stands, the body itself first; of a list the first three."""
    yield at
    entries: Sequence[tuple[str | int, Any]] = ()
    if isinstance(value, dict):
        entries = [*value.items()]
    elif isinstance(value, list):
        entries = [*enumerate(value[:3])]
    for key, inner in entries:
        yield from places(inner, (*at, key))


def value_at(body: Any, place: Place) -> Any:  # any JSON value
    """The value at this place."""
    for key in place:
        body = body[key]
    return body


def with_value(body: Any, full: Any, place: Place, value: object) -> Any:  # any JSON value
    """The body with this value at this place; what lies around it comes from the full body."""
    if not place:
        return value
    changed = copy.deepcopy(body)
    holder = changed
    for depth, key in enumerate(place[:-1]):
        if isinstance(holder, dict) and holder.get(key) is None:
            holder[key] = copy.deepcopy(value_at(full, place[: depth + 1]))
        holder = holder[key]
    holder[place[-1]] = value
    return changed


def alternatives(schema: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The kinds of body that the schema allows, without null."""
    choices = schema.get("anyOf") or schema.get("oneOf") or [schema]
    return [each for each in choices if each.get("type") != "null"]


def sample(schema: Mapping[str, Any], schemas: Mapping[str, Any], depth: int = 0) -> Any:
    """A value that the schema allows, or nearly."""
    schema = resolved(schema, schemas)
    if depth > _DEEPEST:
        return None
    for name in ("examples", "enum"):
        if schema.get(name):
            return schema[name][0]
    if "const" in schema:
        return schema["const"]
    if "properties" in schema:
        members = schema["properties"].items()
        return {name: sample(each, schemas, depth + 1) for name, each in members}
    if isinstance(schema.get("items"), dict):
        return [sample(schema["items"], schemas, depth + 1)]
    return _BY_FORMAT.get(schema.get("format", ""), _BY_TYPE.get(schema.get("type", ""), {}))


def resolved(schema: Mapping[str, Any], schemas: Mapping[str, Any]) -> Mapping[str, Any]:
    """The schema itself, not a reference, and of several the first that is not null."""
    while True:
        choices = schema.get("anyOf") or schema.get("oneOf") or schema.get("allOf")
        if "$ref" in schema:
            schema = schemas[schema["$ref"].rpartition("/")[2]]
        elif choices:
            schema = next((each for each in choices if each.get("type") != "null"), {})
        else:
            return schema
