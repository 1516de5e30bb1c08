"""Makes an example for every body and answer of an OpenAPI document from its schemas."""

from collections.abc import Iterator, Mapping
from typing import Any, Final

from skyway.contracts.rest_examples import BY_NAME, BY_SCHEMA

#: A JSON document, whose members have no common static type.
Document = dict[str, Any]
Schema = Mapping[str, Any]

_BY_FORMAT: Final = {
    "date-time": "2026-03-02T09:00:00Z",
    "date": "2026-03-02",
    "uri": "https://example.com/hooks/skyway",
}
_BY_TYPE: Final[Mapping[str, Any]] = {
    "boolean": False,
    "string": "text",
    "object": {},
    "null": None,
}
#: In this order: in Python a boolean is an integer too.
_PYTHON_TYPES: Final[Mapping[str, type]] = {
    "null": type(None),
    "boolean": bool,
    "integer": int,
    "number": float,
    "string": str,
    "array": list,
    "object": dict,
}


def add_examples(document: Document) -> None:
    """Add an example to each body and each good answer that has none."""
    schemas = document.get("components", {}).get("schemas", {})
    for content in _contents(document):
        for media in content.values():
            if media.get("schema") and not {"example", "examples"} & set(media):
                media["example"] = example_of(media["schema"], schemas)


def example_of(schema: Schema, schemas: Mapping[str, Schema], *, name: str = "") -> Any:
    """An example of a schema, for the property `name`; Any: it is of any JSON type.

    It is the first of these that exists: an example of the schema or its model, a value for the
    property's name, the schema's only or first value, a value of its type.
    """
    if "$ref" in schema:
        target = schema["$ref"].rpartition("/")[2]
        if target in BY_SCHEMA:
            return BY_SCHEMA[target]
        return example_of(schemas[target], schemas, name=name)
    if schema.get("examples"):
        return schema["examples"][0]
    if "const" in schema:
        return schema["const"]
    if "enum" in schema:
        named = BY_NAME.get(name)
        return named if named in schema["enum"] else schema["enum"][0]
    if name in BY_NAME and _is_of_type(BY_NAME[name], schema, schemas):
        return BY_NAME[name]
    for choice in ("oneOf", "anyOf", "allOf"):
        if choice in schema:
            forms = [form for form in schema[choice] if form.get("type") != "null"]
            return example_of(forms[0], schemas, name=name)
    return _composed(schema, schemas, name)


def _composed(schema: Schema, schemas: Mapping[str, Schema], name: str) -> Any:
    kind = schema.get("type", "object")
    if "properties" in schema:
        return {
            each: example_of(inner, schemas, name=each)
            for each, inner in schema["properties"].items()
        }
    if isinstance(schema.get("additionalProperties"), dict):
        name = example_of({"type": "string", **schema.get("propertyNames", {})}, schemas)
        return {name: example_of(schema["additionalProperties"], schemas)}
    if kind == "array":
        if "prefixItems" in schema:
            return [example_of(each, schemas) for each in schema["prefixItems"]]
        item = example_of(schema.get("items", {}), schemas, name=name.removesuffix("s"))
        return [item] * max(1, schema.get("minItems", 1))
    if kind in ("number", "integer"):
        least = schema.get("minimum", schema.get("exclusiveMinimum", 0))
        return least + 1 if "exclusiveMinimum" in schema else least
    return _BY_FORMAT.get(schema.get("format", ""), _BY_TYPE[kind])


def _is_of_type(value: object, schema: Schema, schemas: Mapping[str, Schema]) -> bool:
    forms = schema.get("anyOf") or schema.get("oneOf") or [schema]
    is_moment = any(form.get("format") == "date-time" for form in forms)
    if is_moment and isinstance(value, str) and not value[:4].isdigit():
        return False
    named = [each for form in forms for each in form.get("enum", ())]
    if named and value not in named:
        return False
    kinds = {_type_of(form, schemas) for form in forms}
    return _json_type(value) in kinds or (isinstance(value, int) and "number" in kinds)


def _type_of(form: Schema, schemas: Mapping[str, Schema]) -> str | None:
    if "$ref" in form:
        return _type_of(schemas[form["$ref"].rpartition("/")[2]], schemas)
    kind: str | None = form.get("type")
    return kind


def _json_type(value: object) -> str:
    return next(kind for kind, of_type in _PYTHON_TYPES.items() if isinstance(value, of_type))


def _contents(document: Document) -> Iterator[Document]:
    """The contents of all bodies and answers, by media type."""
    for operations in (*document["paths"].values(), *document.get("webhooks", {}).values()):
        for operation in operations.values():
            yield operation.get("requestBody", {}).get("content", {})
            for answer in operation["responses"].values():
                yield answer.get("content", {})
