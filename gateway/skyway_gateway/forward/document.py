"""The gateway's whole OpenAPI document: its own operations and those that it forwards.

The operations of the other services come from their own documents. `make openapi` copies them into
`operations.json`, so that the running gateway shows them without asking anybody.
"""

import json
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.resources import files
from typing import Annotated, Any, Final

from pydantic import Field

from skyway.ids import KeyId
from skyway.json_model import JsonModel
from skyway.runtime.http.body_bounds import BODY_LIMIT_BYTES, BodyBounds
from skyway.runtime.http.csv_answers import Column, columns_of
from skyway.runtime.http.openapi_document import tags_of
from skyway.runtime.http.openapi_examples import example_of
from skyway_gateway.access.scopes import with_scopes
from skyway_gateway.forward.table import FORWARDED, PROVIDER_CREATION, Forwarded, Service

#: A JSON document, whose members have no common static type.
Document = dict[str, Any]

#: Where `make openapi` keeps what `forwarded_document` makes.
RESOURCE: Final = "operations.json"

_PROVIDERS: Final = "/v1/providers"
_INTERNAL: Final = "/internal/"
_METHODS: Final = ("get", "post", "put", "patch", "delete")
_SCHEMAS: Final = "#/components/schemas/"
_WITH_KEY: Final = "ProviderWithKey"
#: The schema of a call without a body.
_NO_BODY: Final = {"type": "null"}
#: The answers that only a caller who shows a key can get.
_OF_CALLERS: Final = ("401", "403")


class ProviderKey(JsonModel):
    """The answer also holds the provider's API key, which is shown only here."""

    key_id: Annotated[KeyId, Field(description="The id of the provider's API key.")]
    key: Annotated[str, Field(description="The API key itself, shown only in this answer.")]


def stored_document() -> Document:
    """The forwarded operations as `make openapi` last wrote them."""
    text = (files("skyway_gateway.forward") / RESOURCE).read_text(encoding="utf-8")
    document: Document = json.loads(text)
    return document


@cache
def columns_of_list(path: str) -> tuple[Column, ...]:
    """The columns of a forwarded list as CSV, by the schema of its items."""
    document = stored_document()
    schemas = document["components"]["schemas"]
    content = document["paths"][path]["get"]["responses"]["200"]["content"]
    name = content["application/json"]["schema"]["$ref"].removeprefix(_SCHEMAS)
    return tuple(columns_of(schemas[name]["properties"]["items"]["items"], schemas))


def most_body_bytes(row: Forwarded, document: Document) -> int:
    """The most bytes of the body of a call, by its schema in the stored document."""
    operation = document["paths"][row.path][row.method.lower()]
    content = operation.get("requestBody", {"content": {"application/json": {"schema": _NO_BODY}}})
    schema = content["content"]["application/json"]["schema"]
    limit_bytes = BODY_LIMIT_BYTES if row.limit_bytes is None else row.limit_bytes
    schemas = document["components"]["schemas"]
    return BodyBounds.of_schema(schema, schemas, limit_bytes=limit_bytes).size_bytes


def forwarded_document(services: Mapping[Service, Document]) -> Document:
    """The operations that the gateway forwards, and the schemas that they need.

    Parameters
    ----------
    services
        The whole document of each service that answers them.
    """
    paths: Document = {}
    schemas: Document = {}
    for row in (PROVIDER_CREATION, *FORWARDED):
        document = services[row.service]
        operation = document["paths"][row.path][row.method.lower()]
        paths.setdefault(row.path, {})[row.method.lower()] = _for_callers(row, operation)
        _merge(schemas, _needed_schemas(operation, document["components"]["schemas"]))
    paths[_PROVIDERS]["post"] = _with_key(paths[_PROVIDERS]["post"], schemas)
    answers: Document = {}
    for document in services.values():
        _merge(answers, document["components"]["responses"])
    _merge(schemas, _needed_schemas(answers, services["registry"]["components"]["schemas"]))
    components = {"responses": answers, "schemas": dict(sorted(schemas.items()))}
    return {"paths": _sorted_paths(paths), "components": components}


def whole_document(own: Document, forwarded: Document) -> Document:
    """The gateway's own document with the forwarded operations, without internal calls."""
    paths = {path: {**calls} for path, calls in own["paths"].items()}
    paths = {path: calls for path, calls in paths.items() if not path.startswith(_INTERNAL)}
    for path, calls in forwarded["paths"].items():
        paths.setdefault(path, {}).update(calls)
    schemas, answers = ({**own["components"][name]} for name in ("schemas", "responses"))
    _merge(schemas, forwarded["components"]["schemas"])
    _merge(answers, forwarded["components"]["responses"])
    parts = {
        "paths": _sorted_paths(paths),
        **({"webhooks": own["webhooks"]} if "webhooks" in own else {}),
    }
    components = {
        **own["components"],
        "responses": answers,
        "schemas": dict(sorted(_needed_schemas([parts, answers], schemas).items())),
    }
    return with_scopes({**own, "tags": tags_of(parts), **parts, "components": components})


def _for_callers(row: Forwarded, operation: Document) -> Document:
    """An operation as the gateway's callers make it: with their key, or with none."""
    shown = {**operation, "description": f"{operation['description']}\n\n{_callers(row)}"}
    if row.roles:
        return shown
    answers = operation["responses"]
    kept = {status: answers[status] for status in answers if status not in _OF_CALLERS}
    return {**shown, "security": [], "responses": kept}


def _with_key(operation: Document, schemas: Document) -> Document:
    """The operation that answers a new provider with its API key, which the gateway adds."""
    provider, key = schemas["Provider"], ProviderKey.model_json_schema()
    schemas[_WITH_KEY] = {
        **provider,
        "title": _WITH_KEY,
        "description": key["description"],
        "properties": {**provider["properties"], **key["properties"]},
        "required": [*provider["required"], *key["required"]],
    }
    schema = {"$ref": _SCHEMAS + _WITH_KEY}
    content = {"application/json": {"schema": schema, "example": example_of(schema, schemas)}}
    answers = operation["responses"]
    about = operation["description"].replace("\n", f" {ProviderKey.__doc__}\n", 1)
    return {
        **operation,
        "description": about,
        "responses": {**answers, "201": {**answers["201"], "content": content}},
    }


def _callers(row: Forwarded) -> str:
    if not row.roles:
        return "No API key is needed."
    return f"Callers: {', '.join(row.roles)}."


def _sorted_paths(paths: Document) -> Document:
    return {
        path: {method: paths[path][method] for method in _METHODS if method in paths[path]}
        for path in sorted(paths)
    }


def _merge(schemas: Document, more: Document) -> None:
    for name, schema in more.items():
        if schemas.setdefault(name, schema) != schema:
            raise ValueError(f"two services have different things of the name {name}")


def _needed_schemas(part: object, schemas: Document) -> Document:
    """The schemas to which a part of a document refers, and those to which these refer."""
    needed: Document = {}
    waiting = list(_references([part]))
    while waiting:
        name = waiting.pop()
        if name not in needed:
            needed[name] = schemas[name]
            waiting.extend(_references([schemas[name]]))
    return needed


def _references(values: Iterable[object]) -> Iterator[str]:
    for value in values:
        if isinstance(value, dict):
            reference = value.get("$ref")
            if isinstance(reference, str) and reference.startswith(_SCHEMAS):
                yield reference.removeprefix(_SCHEMAS)
            mapping = value.get("mapping")
            if isinstance(mapping, dict):
                yield from (str(each).removeprefix(_SCHEMAS) for each in mapping.values())
            yield from _references(value.values())
        elif isinstance(value, list):
            yield from _references(value)
