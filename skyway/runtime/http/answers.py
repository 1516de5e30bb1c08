"""What routes answer beside plain JSON: problems, answers that may be repeated, and GeoJSON.

It also describes the problems of every operation for the OpenAPI document.
"""

from collections.abc import Iterator, Mapping
from http import HTTPStatus
from typing import Annotated, Any, Final

from fastapi import Header, Request, Response
from fastapi.responses import JSONResponse

from skyway.contracts.problem_details import (
    CONFLICT_CODES,
    PROBLEM_MEDIA_TYPE,
    FieldProblem,
    ProblemDetails,
)
from skyway.runtime.http.problems import problem_of_kind
from skyway.runtime.idempotency_store import Answer, KeyedCall

#: A part of an OpenAPI document, whose members have no common static type.
Part = dict[str, Any]

_SCHEMA: Final = {"$ref": f"#/components/schemas/{ProblemDetails.__name__}"}
_CODES: Final = "x-codes"
_TRACE_ID: Final = "4bf92f3577b34da6a3ce929d0e0e4736"
_FIELD: Final = FieldProblem(field="packages.0.mass_kg", detail="must be at least 0")

#: Each shared answer: its name, its status, the problem types that it can carry.
_SHARED: Final[Mapping[str, tuple[str, tuple[str, ...]]]] = {
    "BrokenJson": ("400", ("broken-json",)),
    "Unauthenticated": ("401", ("unauthenticated",)),
    "AccessDenied": ("403", ("access-denied",)),
    "NotFound": ("404", ("not-found",)),
    "PreconditionFailed": ("412", ("precondition-failed",)),
    "TooLarge": ("413", ("too-large",)),
    "UnsupportedMediaType": ("415", ("unsupported-media-type",)),
    "InvalidInput": ("422", ("invalid-input",)),
    "InvalidInputOrReusedKey": ("422", ("invalid-input", "idempotency-key-reused")),
    "TooManyRequests": ("429", ("too-many-requests",)),
    "ServiceUnavailable": ("503", ("service-unavailable",)),
    "OtherProblem": ("default", ("internal-error",)),
}
_DETAILS: Final[Mapping[str, str]] = {
    "broken-json": "body: JSON decode error: Expecting value",
    "unauthenticated": "an API key is needed: Authorization: Bearer sk_...",
    "access-denied": "this is for the role operator, not customer",
    "not-found": "no such thing, or it is not yours",
    "precondition-failed": 'version "3" was expected, the present one is "4"',
    "too-large": "the body is larger than the limit of 262144 bytes",
    "unsupported-media-type": "the Content-Type must be application/json; it is text/plain",
    "invalid-input": f"{_FIELD.field}: {_FIELD.detail}",
    "idempotency-key-reused": "this Idempotency-Key was used before with another body",
    "too-many-requests": "the budget TENANT_REQUESTS is spent; try again in 0.7 s",
    "service-unavailable": "composition is unavailable: it cannot be reached",
    "internal-error": "the request was not carried out; the logs say why, under its trace_id",
}

_NEVER_METERED: Final = ("/healthz", "/readyz")

#: For the `responses` of a route whose body may name a thing that does not exist.
NOT_FOUND: Final[dict[int | str, Part]] = {HTTPStatus.NOT_FOUND.value: {}}

#: The header `Idempotency-Key`, for a parameter of the name `idempotency_key`.
IdempotencyKey = Annotated[str | None, Header()]

GEOJSON: Final = "application/geo+json"


def conflicts(*codes: str) -> dict[int | str, Part]:
    """The 409 answer of a route that can be refused with these codes, for its `responses`."""
    return {HTTPStatus.CONFLICT.value: {_CODES: list(codes)}}


def add_problem_answers(path: str, operation: Part) -> None:
    """Add to an operation every problem answer that it can give."""
    responses: Part = operation["responses"]
    # FastAPI's own description of a 422 is not what we answer.
    if "HTTPValidationError" in str(responses.get("422")):
        del responses["422"]
    if _CODES in responses.get("409", {}):
        responses["409"] = _conflict(responses["409"][_CODES])
    for name in _names(path, operation):
        responses[_SHARED[name][0]] = {"$ref": f"#/components/responses/{name}"}
    operation["responses"] = dict(sorted(responses.items()))


def shared_problem_answers() -> Part:
    """The answers to which the operations refer, by name."""
    return {name: _answer(kinds) for name, (_, kinds) in _SHARED.items()}


def _names(path: str, operation: Part) -> Iterator[str]:
    parameters = {each["name"].lower() for each in operation.get("parameters", ())}
    if "requestBody" in operation:
        yield from ("BrokenJson", "TooLarge", "UnsupportedMediaType")
    if operation.get("security"):
        yield from ("Unauthenticated", "AccessDenied")
    if path not in _NEVER_METERED:
        yield "TooManyRequests"
    if "{" in path or "provider_id" in parameters or "404" in operation["responses"]:
        yield "NotFound"
    if "if-match" in parameters:
        yield "PreconditionFailed"
    if "idempotency-key" in parameters:
        yield "InvalidInputOrReusedKey"
    elif "requestBody" in operation or "parameters" in operation:
        yield "InvalidInput"
    if path not in ("/healthz", "/metrics"):
        yield "ServiceUnavailable"
    yield "OtherProblem"


def _answer(kinds: tuple[str, ...]) -> Part:
    problems = {kind: _problem(kind) for kind in kinds}
    described = "; ".join(
        f"{problem['title']} (`{problem['type']}`)" for problem in problems.values()
    )
    if kinds == ("internal-error",):
        described = f"Any other problem, such as: {described}"
    return _documented(described, problems)


def _conflict(codes: list[str]) -> Part:
    meanings = "\n".join(f"- `{code}`: {CONFLICT_CODES[code]}" for code in codes)
    base = _problem("conflict")
    problems = {code: {**base, "detail": CONFLICT_CODES[code], "code": code} for code in codes}
    title = f"{base['title']} (`{base['type']}`); `code` says why:"
    return {**_documented(f"{title}\n\n{meanings}", problems), _CODES: codes}


def _documented(description: str, problems: Mapping[str, Part]) -> Part:
    examples = {
        name: {"summary": problem["title"], "value": problem} for name, problem in problems.items()
    }
    content = {PROBLEM_MEDIA_TYPE: {"schema": _SCHEMA, "examples": examples}}
    return {"description": description, "content": content}


def _problem(kind: str) -> Part:
    problem = problem_of_kind(kind, _DETAILS.get(kind))
    if kind == "invalid-input":
        problem = problem.model_copy(update={"errors": (_FIELD,)})
    problem = problem.model_copy(update={"trace_id": _TRACE_ID})
    return problem.model_dump(mode="json", exclude_none=True, exclude_defaults=True)


async def keyed_call(request: Request, caller: object, key: str | None) -> KeyedCall:
    """The call of this request; another caller with the same key gets another answer."""
    route = f"{request.method} {request.scope['path']}"
    return KeyedCall(str(caller), route, key, await request.body())


def response_of(answer: Answer) -> Response:
    """The HTTP answer, new or repeated."""
    return Response(answer.body, answer.status, dict(answer.headers), "application/json")


class GeoJsonResponse(JSONResponse):
    """An answer in GeoJSON."""

    media_type = GEOJSON
