"""What FastAPI's OpenAPI document leaves out: problem answers, and bodies read by dependencies."""

from collections.abc import Iterator
from typing import Any, Final

from fastapi.dependencies.models import Dependant
from fastapi.routing import APIRoute, iter_route_contexts
from pydantic import BaseModel
from pydantic.json_schema import models_json_schema
from starlette.routing import BaseRoute

from skyway.contracts.problem_details import PROBLEM_MEDIA_TYPE, ProblemDetails
from skyway.runtime.http.json_bodies import InternalBody

#: A JSON document, whose members have no common static type.
Document = dict[str, Any]

_REFERENCE: Final = "#/components/schemas/{model}"
_WITH_BODY: Final = {
    "400": "The body is not JSON",
    "413": "The body exceeds the limit",
    "415": "The Content-Type is not JSON",
}
_WITH_SECURITY: Final = {
    "401": "Who is calling is not known",
    "403": "The caller may not do this",
}
_INVALID: Final = "A field breaks a limit; `errors` names it"
_OTHERWISE: Final = "Any other problem"


def complete_document(document: Document, routes: list[BaseRoute]) -> Document:
    """The document with the bodies of `internal_body` and the problem answers of every call."""
    bodies = dict(_internal_bodies(routes))
    for (path, method), model in bodies.items():
        operation = document["paths"].get(path, {}).get(method)
        if operation is not None:
            schema = {"$ref": _REFERENCE.format(model=model.__name__)}
            operation["requestBody"] = {
                "required": True,
                "content": {"application/json": {"schema": schema}},
            }
    for operations in document["paths"].values():
        for operation in operations.values():
            _add_problems(operation)
    _add_schemas(document, [*bodies.values(), ProblemDetails])
    return document


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


def _add_problems(operation: Document) -> None:
    responses: Document = operation["responses"]
    # FastAPI's own description of a 422 is not what we answer.
    if "HTTPValidationError" in str(responses.get("422")):
        del responses["422"]
    problems = {"default": _OTHERWISE}
    if "requestBody" in operation:
        problems |= _WITH_BODY
    if "requestBody" in operation or "parameters" in operation:
        problems["422"] = _INVALID
    if "security" in operation:
        problems |= _WITH_SECURITY
    schema = {"$ref": _REFERENCE.format(model=ProblemDetails.__name__)}
    for status, description in sorted(problems.items()):
        content = {PROBLEM_MEDIA_TYPE: {"schema": schema}}
        responses.setdefault(status, {"description": description, "content": content})


def _add_schemas(document: Document, models: list[type[BaseModel]]) -> None:
    distinct = sorted(set(models), key=lambda model: model.__name__)
    _, defined = models_json_schema(
        [(model, "validation") for model in distinct], ref_template=_REFERENCE
    )
    schemas = document.setdefault("components", {}).setdefault("schemas", {})
    for unused in ("HTTPValidationError", "ValidationError"):
        schemas.pop(unused, None)
    for name, schema in defined["$defs"].items():
        schemas.setdefault(name, schema)
    document["components"]["schemas"] = dict(sorted(schemas.items()))
