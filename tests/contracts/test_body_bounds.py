"""Each text, list and object in a body of `/v1` has a bound: no caller chooses its size.

Networks are left out: `read_network` reads their GeoJSON by columns, and their bytes are limited.
"""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest

FOLDER: Final = Path(__file__).resolve().parents[2] / "openapi"
SERVICES: Final = ("gateway", "provider-registry", "composition")
READ_BY_COLUMNS: Final = "NetworkDocument"

#: What bounds a text: its length, a list of values, a format, or a pattern of fixed length.
_TEXT: Final = {"maxLength", "enum", "const", "format"}
_FIXED_LENGTH: Final = re.compile(r"^\^\[[^]]*\]\{\d+\}\$$")
_CHOICES: Final = ("anyOf", "oneOf", "allOf")

Document = dict[str, Any]


def unbounded(schema: Document, parts: Document, place: str, seen: frozenset[str]) -> Iterator[str]:
    """The places below a schema where a caller chooses the size."""
    if (reference := schema.get("$ref")) is not None:
        name = reference.rpartition("/")[2]
        if name not in seen | {READ_BY_COLUMNS}:
            yield from unbounded(parts[name], parts, place or name, seen | {name})
        return
    for choice in (each for key in _CHOICES for each in schema.get(key, ())):
        yield from unbounded(choice, parts, place, seen)
    match schema.get("type"):
        case "string":
            is_fixed = _FIXED_LENGTH.match(schema.get("pattern", ""))
            if not is_fixed and not _TEXT & schema.keys():
                yield f"{place}: a text without maxLength"
        case "array":
            yield from _of_list(schema, parts, place, seen)
        case "object":
            yield from _of_object(schema, parts, place, seen)


def _of_list(schema: Document, parts: Document, place: str, seen: frozenset[str]) -> Iterator[str]:
    if "maxItems" not in schema:
        yield f"{place}: a list without maxItems"
    for each in (schema.get("items"), *schema.get("prefixItems", ())):
        if isinstance(each, dict):
            yield from unbounded(each, parts, f"{place}[]", seen)


def _of_object(
    schema: Document, parts: Document, place: str, seen: frozenset[str]
) -> Iterator[str]:
    others = schema.get("additionalProperties", "properties" not in schema)
    if others is not False and "maxProperties" not in schema:
        yield f"{place}: an object without maxProperties"
    if isinstance(others, dict):
        yield from unbounded(others, parts, f"{place}{{}}", seen)
    for name, each in schema.get("properties", {}).items():
        yield from unbounded(each, parts, f"{place}.{name}", seen)


def bodies(service: str) -> Iterator[tuple[str, Document, Document]]:
    """Each call of a service that has a body, its schema, and the schemas that it names."""
    document = json.loads((FOLDER / f"{service}.json").read_text())
    for path, calls in document["paths"].items():
        for method, call in calls.items():
            if path.startswith("/v1/") and "requestBody" in call:
                for content in call["requestBody"]["content"].values():
                    yield f"{method} {path}", content["schema"], document["components"]["schemas"]


@pytest.mark.parametrize("service", SERVICES)
def test_every_part_of_a_body_has_a_bound(service: str) -> None:
    found = {
        f"{call}: {place}"
        for call, schema, parts in bodies(service)
        for place in unbounded(schema, parts, "", frozenset())
    }

    assert found == set()


@pytest.mark.parametrize(
    ("schema", "count"),
    [
        ({"type": "string"}, 1),
        ({"type": "string", "pattern": "^a+$"}, 1),
        ({"type": "string", "pattern": "^[A-Z]{3}$"}, 0),
        ({"type": "array", "items": {"type": "string"}}, 2),
        ({"type": "array", "maxItems": 2, "prefixItems": [{"type": "number"}]}, 0),
        ({"type": "object"}, 1),
        ({"type": "object", "additionalProperties": {"type": "string"}}, 2),
        ({"type": "object", "properties": {"a": {"anyOf": [{"type": "string"}]}}}, 1),
    ],
)
def test_what_has_no_bound_is_found(schema: Document, count: int) -> None:
    assert len(list(unbounded(schema, {}, "Body", frozenset()))) == count
