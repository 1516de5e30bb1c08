"""Every call of the OpenAPI documents, and apps that answer them without a database.

Callers are operators. What is wrong with a request is found before its route asks a database; a
route that goes on fails, which is answered with 500.
"""

import copy
import json
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import httpx
from fastapi import FastAPI, Request
from fastapi.dependencies.models import Dependant
from fastapi.routing import APIRoute, request_response
from skyway_gateway.access.routes import caller_of_key, caller_with_key
from starlette.middleware import Middleware

from skyway.runtime.http.identity import Caller, KeyHolder, ServiceGate
from skyway.runtime.http.openapi_examples import example_of
from skyway.runtime.http.request_boundary import RequestBoundary
from tools.write_openapi import app_of

SERVICES: Final = ("gateway", "provider-registry", "composition")

#: Bodies with more members than the example of the document.
BODIES: Final = {
    "POST /v1/compositions": lambda: json.loads(
        (Path(__file__).parents[1] / "data/good_problem.json").read_text("utf-8")
    ),
}
#: Members that exclude each other.
APART: Final = {"reports": "grid", "weights": "objective", "objective": "weights"}

#: A path within a JSON value.
Place = tuple[str | int, ...]


@dataclass(frozen=True)
class Call:
    """One operation of a service's document."""

    service: str
    method: str
    path: str
    operation: dict[str, Any]

    def __str__(self) -> str:
        return f"{self.method.upper()} {self.path}"

    @property
    def url(self) -> str:
        """The path with an id for each parameter."""
        url = self.path
        for each in self.operation.get("parameters", ()):
            if each["in"] == "path":
                url = url.replace(f"{{{each['name']}}}", "id_1")
        return url

    @property
    def body(self) -> dict[str, Any] | None:
        """The JSON body in the document; None without one."""
        content: dict[str, Any] = self.operation.get("requestBody", {}).get("content", {})
        return content.get("application/json")

    @property
    def schema_name(self) -> str:
        """The name of the schema of the body."""
        assert self.body is not None
        return str(self.body["schema"]["$ref"]).rpartition("/")[2]

    @property
    def query(self) -> list[dict[str, Any]]:
        """The parameters of the query."""
        return [each for each in self.operation.get("parameters", ()) if each["in"] == "query"]


@cache
def document_of(service: str) -> dict[str, Any]:
    """The document of a service, with the operations that it answers itself."""
    app = app_of(service)
    app.publish = None
    return app.openapi()


def calls(*services: str) -> list[Call]:
    """Every public call that these services answer."""
    return [
        Call(service, method, path, operation)
        for service in services or SERVICES
        for path, operations in document_of(service)["paths"].items()
        if not path.startswith("/internal/")
        for method, operation in operations.items()
    ]


def _operator(request: Request) -> Caller:
    caller = Caller("operator", "op")
    request.state.holder, request.state.caller = KeyHolder(caller, "key_1"), caller
    return caller


def _gates(dependant: Dependant) -> Iterator[Any]:
    if isinstance(dependant.call, ServiceGate) or dependant.call in (
        caller_of_key,
        caller_with_key,
    ):
        yield dependant.call
    for inner in dependant.dependencies:
        yield from _gates(inner)


@cache
def _open_app(service: str) -> FastAPI:
    app = app_of(service)
    app.user_middleware = [Middleware(RequestBoundary)]
    for route in app.routes:
        if isinstance(route, APIRoute):
            app.dependency_overrides |= dict.fromkeys(_gates(route.dependant), _operator)
            route.dependency_overrides_provider = app
            route.app = request_response(route.get_route_handler())
    return app


@asynccontextmanager
async def client_of(service: str) -> AsyncIterator[httpx.AsyncClient]:
    """Calls a service as an operator."""
    transport = httpx.ASGITransport(_open_app(service))
    async with httpx.AsyncClient(transport=transport, base_url="http://skyway") as client:
        yield client


def example_body(call: Call) -> Any:
    """An example of the body, with every member."""
    assert call.body is not None
    given = [call.body[name] for name in ("example", "examples") if name in call.body]
    if not given:
        return example_of(call.body["schema"], schemas_of(call))
    shown = given[0] if "example" in call.body else next(iter(given[0].values()))["value"]
    return copy.deepcopy(shown)


def schemas_of(call: Call) -> dict[str, Any]:
    """The schemas of a call's document, by name."""
    schemas: dict[str, Any] = document_of(call.service)["components"]["schemas"]
    return schemas


def forms_of(schema: dict[str, Any], schemas: dict[str, Any]) -> list[dict[str, Any]]:
    """The schema without references and choices: each form that a value may have."""
    if "$ref" in schema:
        return forms_of(schemas[schema["$ref"].rpartition("/")[2]], schemas)
    for choice in ("anyOf", "oneOf"):
        if choice in schema:
            return [form for each in schema[choice] for form in forms_of(each, schemas)]
    return [schema]


@dataclass(frozen=True)
class Member:
    """A member within a body, at its place, with the forms that its value may have."""

    body: Any
    place: Place
    forms: list[dict[str, Any]]

    def changed_to(self, value: Any) -> Any:
        """The body with another value of this member."""
        return changed(self.body, self.place, value)

    @property
    def name(self) -> str:
        """The place as problem documents name it."""
        return ".".join(map(str, self.place))


def members_of(call: Call) -> Iterator[Member]:
    """Each member within the body of a call; bodies have an example where one is missing."""
    assert call.body is not None
    body = BODIES[str(call)]() if str(call) in BODIES else example_body(call)
    return members_in(call.body["schema"], body, body, schemas_of(call))


def members_in(
    schema: dict[str, Any], value: Any, body: Any, schemas: dict[str, Any], place: Place = ()
) -> Iterator[Member]:
    """Each member within a value of this schema, which is at a place of the body."""
    for form in forms_of(schema, schemas):
        properties = form.get("properties", {})
        if properties and isinstance(value, dict) and _is_of(value, properties):
            for name, inner in properties.items():
                here = (*place, name)
                alone = {each: kept for each, kept in value.items() if each != APART.get(name)}
                without = changed(body, place, alone)
                yield Member(without, here, forms_of(inner, schemas))
                example = value.get(name) or example_of(inner, schemas, name=name)
                whole = changed(without, here, example)
                yield from members_in(inner, example, whole, schemas, here)
        elif form.get("type") == "array" and isinstance(value, list) and value:
            inner = form.get("prefixItems", [form.get("items", {})])[0]
            yield Member(body, (*place, 0), forms_of(inner, schemas))
            yield from members_in(inner, value[0], body, schemas, (*place, 0))


def _is_of(value: dict[str, Any], properties: dict[str, Any]) -> bool:
    """Whether a value may be of the form with these properties: their constants say so."""
    return set(value) <= set(properties) and all(
        value.get(name, each["const"]) == each["const"]
        for name, each in properties.items()
        if "const" in each
    )


def changed(body: Any, place: Place, value: Any) -> Any:
    """A copy of the body with this value at a place; missing objects above it are made."""
    if not place:
        return value
    first, *others = place
    copied: Any = copy.copy(body) if body else ([] if first == 0 else {})
    if first == 0:
        return [changed(copied[0] if copied else None, tuple(others), value), *copied[1:]]
    copied[first] = changed(copied.get(first), tuple(others), value)
    return copied
