"""Adds to FastAPI's OpenAPI document: bodies, problems, examples, descriptions."""

import json
import re
from collections.abc import Iterator, Sequence
from http import HTTPStatus
from typing import Any, Final

from fastapi.dependencies.models import Dependant
from fastapi.routing import APIRoute, iter_route_contexts
from pydantic import BaseModel
from pydantic.json_schema import models_json_schema
from starlette.routing import BaseRoute

from skyway.contracts.problem_details import ProblemDetails
from skyway.contracts.rest_tags import TAGS
from skyway.drone.model import ChargePoint
from skyway.geo import Position
from skyway.runtime.http.answers import add_problem_answers, shared_problem_answers
from skyway.runtime.http.openapi_examples import add_examples
from skyway.runtime.http.service_router import InternalBody

#: A JSON document, whose members have no common static type.
Document = dict[str, Any]

_REFERENCE: Final = "#/components/schemas/{model}"
#: What pydantic calls the schema of `Page[Delivery]`: ``Page_Delivery_``.
_PAGE: Final = re.compile(r"\bPage_(\w+?)_(?=\")")
#: The document is read from the server that it describes.
_SERVERS: Final = [{"url": "/", "description": "The server that shows this document"}]
#: FastAPI's default description of an answer without one.
_UNSAID: Final = "Successful Response"
#: Models of which pydantic shows no docstring.
_TUPLES: Final = (Position, ChargePoint)
_REPEATABLE: Final = (
    "Repeats are answered like the first call with this key and body, for 24 hours; "
    "1 to 255 characters."
)
_HEADERS: Final = {
    "idempotency-key": _REPEATABLE,
    "if-match": "The ETag of the version that is to be replaced; another version is refused.",
    "last-event-id": "The id of the last event received; the stream goes on after it.",
    "accept": "The media type wanted.",
}


def schema_of(model: type[BaseModel]) -> Document:
    """A reference to a model's schema, for a body or answer that FastAPI does not read itself."""
    return {"$ref": _REFERENCE.format(model=model.__name__)}


def body_of(model: type[BaseModel]) -> Document:
    """The `openapi_extra` of a route that reads its JSON body itself."""
    content = {"application/json": {"schema": schema_of(model)}}
    return {"requestBody": {"required": True, "content": content}}


def complete_document(
    document: Document, routes: list[BaseRoute], models: Sequence[type[BaseModel]] = ()
) -> Document:
    """The document with tags, servers, bodies of `internal_body`, problem answers and examples.

    `models` are those to which routes refer by `schema_of` and `body_of`.
    """
    bodies = dict(_internal_bodies(routes))
    for (path, method), model in bodies.items():
        operation = document["paths"].get(path, {}).get(method)
        if operation is not None:
            operation |= body_of(model)
    for path, operations in document["paths"].items():
        for operation in operations.values():
            operation["summary"] = operation["summary"].capitalize()
            add_problem_answers(path, operation)
    for calls in document.get("webhooks", {}).values():
        for call in calls.values():
            # Customers answer webhooks, and how they answer an invalid event is not specified.
            call["responses"].pop("422", None)
    components = document.setdefault("components", {})
    text = json.dumps(document["paths"])
    components["responses"] = {
        name: answer
        for name, answer in shared_problem_answers().items()
        if f'"#/components/responses/{name}"' in text
    }
    _add_schemas(document, [*bodies.values(), *models, ProblemDetails])
    document = _with_items(_with_page_names(document))
    _complete_descriptions(document)
    add_examples(document)
    head = {name: document[name] for name in ("openapi", "info")}
    return {**head, "servers": _SERVERS, "tags": tags_of(document), **document}


def tags_of(document: Document) -> list[Document]:
    """The tags that the operations of a document use, each with its description."""
    used = {
        tag
        for operations in document["paths"].values()
        for operation in operations.values()
        for tag in operation.get("tags", ())
    }
    return [{"name": tag, "description": about} for tag, about in TAGS.items() if tag in used]


def _internal_bodies(
    routes: list[BaseRoute],
) -> Iterator[tuple[tuple[str, str], type[BaseModel]]]:
    for route in iter_route_contexts(routes):
        if not isinstance(route.original_route, APIRoute):
            continue
        for model in _models_in(route.original_route.dependant):
            for method in route.methods or ():
                yield (route.path_format or "", method.lower()), model


def _models_in(dependant: Dependant) -> Iterator[type[BaseModel]]:
    if isinstance(dependant.call, InternalBody):
        yield dependant.call.model
    for inner in dependant.dependencies:
        yield from _models_in(inner)


def _add_schemas(document: Document, models: list[type[BaseModel]]) -> None:
    distinct = sorted(set(models), key=lambda model: model.__name__)
    _, defined = models_json_schema(
        [(model, "validation") for model in distinct], ref_template=_REFERENCE
    )
    schemas = document["components"].setdefault("schemas", {})
    for unused in ("HTTPValidationError", "ValidationError"):
        schemas.pop(unused, None)
    for name, schema in defined["$defs"].items():
        schemas.setdefault(name, _without_nulls(schema))
    document["components"]["schemas"] = dict(sorted(schemas.items()))


def _with_page_names(document: Document) -> Document:
    """The document in which the schema of a page of deliveries is called ``DeliveryPage``."""
    named: Document = json.loads(_PAGE.sub(r"\1Page", json.dumps(document)))
    return named


def _with_items(value: Any) -> Any:
    """The JSON value in which tuples name the types of their items, for older tools. Any: JSON."""
    if isinstance(value, list):
        return [_with_items(each) for each in value]
    if not isinstance(value, dict):
        return value
    whole = {name: _with_items(each) for name, each in value.items()}
    if isinstance(whole.get("prefixItems"), list):
        first = whole["prefixItems"][0]
        whole.setdefault("items", {n: first[n] for n in ("type", "$ref") if n in first})
    return whole


def _without_nulls(value: Any) -> Any:
    """The JSON value without members that are null: FastAPI leaves such defaults out. Any: JSON."""
    if isinstance(value, dict):
        return {name: _without_nulls(each) for name, each in value.items() if each is not None}
    if isinstance(value, list):
        return [_without_nulls(each) for each in value]
    return value


def _complete_descriptions(document: Document) -> None:
    """Describe properties, parameters and answers with the descriptions of their types."""
    schemas = document["components"]["schemas"]
    for model in _TUPLES:
        if model.__name__ in schemas:
            schemas[model.__name__].setdefault("description", str(model.__doc__))
    for schema in schemas.values():
        for each in schema.get("properties", {}).values():
            _describe(each)
    for operations in document["paths"].values():
        for operation in operations.values():
            for parameter in operation.get("parameters", ()):
                _describe_parameter(parameter)
            for status, answer in operation["responses"].items():
                if answer.get("description") in (_UNSAID, ""):
                    answer["description"] = _said(status, answer, schemas)


def _describe(schema: Document) -> None:
    """The description of a schema; of a nullable value, that of its other form."""
    forms = schema.get("anyOf", ())
    described = [form for form in forms if "description" in form and "$ref" not in form]
    if len(described) == 1:
        about = described[0]["description"]
        forms[forms.index(described[0])] = {
            name: value for name, value in described[0].items() if name != "description"
        }
        schema.setdefault("description", about)


def _describe_parameter(parameter: Document) -> None:
    schema = parameter["schema"]
    _describe(schema)
    about = schema.pop("description", None) or _HEADERS.get(parameter["name"].lower())
    if about is not None:
        parameter.setdefault("description", about)


def _said(status: str, answer: Document, schemas: Document) -> str:
    """The first paragraph about the answer's schema."""
    for media in answer.get("content", {}).values():
        name = media.get("schema", {}).get("$ref", "").rpartition("/")[2]
        if name in schemas and "description" in schemas[name]:
            about: str = schemas[name]["description"]
            return " ".join(about.split("\n\n", maxsplit=1)[0].split())
    return "Done; the answer has no body." if status == "204" else HTTPStatus(int(status)).phrase
