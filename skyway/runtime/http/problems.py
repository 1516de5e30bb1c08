"""The table from errors to HTTP answers, which are RFC 9457 problem documents."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any, Final

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.routing import iter_route_contexts
from pydantic import ValidationError
from starlette.exceptions import HTTPException
from starlette.routing import compile_path

from skyway.complaints import BROKEN_JSON, sentence_of
from skyway.contracts.problem_details import (
    PROBLEM_MEDIA_TYPE,
    FieldProblem,
    ProblemDetails,
)
from skyway.errors import InvalidInput, SkywayError
from skyway.runtime.errors import (
    AccessDenied,
    BudgetSpent,
    Conflict,
    IdempotencyKeyReused,
    KeyNeeded,
    Misdirected,
    MqttUnavailable,
    NotFound,
    Overloaded,
    PreconditionFailed,
    RemoteProblem,
    RowRefused,
    ScopeMissing,
    ServiceUnavailable,
    TooLarge,
    Unauthenticated,
)
from skyway.runtime.tracing import current_trace_id

#: One bad body must not turn into a megabyte of answer.
_MAX_FIELD_PROBLEMS: Final = 20
_MAX_TEXT: Final = 300


@dataclass(frozen=True, slots=True)
class _Kind:
    status: int
    name: str
    title: str


_INVALID: Final = _Kind(422, "invalid-input", "The request breaks a limit")
_BROKEN_JSON: Final = _Kind(400, "broken-json", "The body is not JSON")
_FAILED: Final = _Kind(500, "internal-error", "Something failed on our side")
_UNAVAILABLE: Final = _Kind(503, "service-unavailable", "A part of the system does not answer")

_TABLE: Final[Mapping[type[SkywayError], _Kind]] = {
    InvalidInput: _INVALID,
    Unauthenticated: _Kind(401, "unauthenticated", "Who is calling is not known"),
    AccessDenied: _Kind(403, "access-denied", "The caller may not do this"),
    NotFound: _Kind(404, "not-found", "There is no such thing"),
    Conflict: _Kind(409, "conflict", "The state of things does not allow this"),
    RowRefused: _Kind(409, "taken", "Somebody else holds this"),
    Misdirected: _Kind(421, "misdirected", "Another server serves this"),
    PreconditionFailed: _Kind(412, "precondition-failed", "It changed since it was read"),
    TooLarge: _Kind(413, "too-large", "The body exceeds the limit"),
    BudgetSpent: _Kind(429, "too-many-requests", "A budget of the caller is spent"),
    IdempotencyKeyReused: _Kind(
        422, "idempotency-key-reused", "The Idempotency-Key was used for another request"
    ),
    ServiceUnavailable: _UNAVAILABLE,
    MqttUnavailable: _UNAVAILABLE,
}
#: Names of the problems that the framework itself raises, by status.
_BY_STATUS: Final = {
    kind.status: kind for kind in (*_TABLE.values(), _INVALID, _FAILED, _UNAVAILABLE)
}
_HEADERS: Final = {401: {"WWW-Authenticate": "Bearer"}, 503: {"Retry-After": "1"}}


def problem_of(error: SkywayError) -> ProblemDetails:
    """The problem document of an error; an error that is not in the table is a bug."""
    if isinstance(error, RemoteProblem):
        return _remote_problem(error)
    kind = next((_TABLE[cls] for cls in type(error).__mro__ if cls in _TABLE), _FAILED)
    if kind is _FAILED:
        return our_failure()
    if isinstance(error, InvalidInput):
        at_fault = tuple(FieldProblem(field=one.field, detail=one.detail) for one in error.faults)
        return _problem(kind, _summary(at_fault), errors=at_fault)
    if isinstance(error, Conflict):
        problem = _problem(kind, error.detail, code=error.code)
        return ProblemDetails.model_validate({**error.members, **problem.model_dump()})
    if isinstance(error, ScopeMissing):
        problem = _problem(kind, error.detail, code="SCOPE_MISSING")
        return ProblemDetails.model_validate({"scope": error.scope, **problem.model_dump()})
    if isinstance(error, KeyNeeded):
        return _problem(kind, error.detail, code="KEY_NEEDED")
    if isinstance(error, BudgetSpent | ServiceUnavailable):
        return _problem(kind, str(error), code=error.code)
    return _problem(kind, str(error))


def problem_headers(error: SkywayError) -> dict[str, str]:
    """The headers of an error's answer that depend on more than its status."""
    if not isinstance(error, BudgetSpent | Overloaded):
        return {}
    headers = error.headers if isinstance(error, BudgetSpent) else {}
    return {**headers, "Retry-After": str(max(1, math.ceil(error.retry_after_s)))}


def our_failure() -> ProblemDetails:
    """The problem document of a bug: no details, only where to find it in the logs."""
    return _problem(_FAILED, "the request was not carried out; the logs say why under its trace_id")


def status_problem(status: int, detail: str | None) -> ProblemDetails:
    """The problem document of a plain HTTP status."""
    phrase = HTTPStatus(status).phrase
    kind = _BY_STATUS.get(status, _Kind(status, phrase.lower().replace(" ", "-"), phrase))
    return _problem(kind, detail)


def problem_of_kind(name: str, detail: str | None) -> ProblemDetails:
    """The problem document of the type ``urn:skyway:problem:<name>``."""
    for kind in (*_TABLE.values(), _INVALID, _BROKEN_JSON, _FAILED):
        if kind.name == name:
            return _problem(kind, detail)
    return status_problem(HTTPStatus[name.upper().replace("-", "_")], detail)


def problem_response(problem: ProblemDetails, headers: Mapping[str, str] | None = None) -> Response:
    """The HTTP answer that carries a problem document."""
    members = problem.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    body = json.dumps({"type": problem.type, **members}, ensure_ascii=False)
    return Response(
        body.encode(errors="replace"),
        status_code=problem.status,
        headers={**_HEADERS.get(problem.status, {}), **(headers or {})},
        media_type=PROBLEM_MEDIA_TYPE,
    )


def install_problems(app: FastAPI) -> None:
    """Make the app answer every error of a route with its problem document."""
    app.add_exception_handler(SkywayError, _on_skyway_error)
    app.add_exception_handler(RequestValidationError, _on_invalid_request)
    app.add_exception_handler(HTTPException, _on_http_exception)


async def _on_skyway_error(_request: Request, error: Exception) -> Response:
    problem = problem_of(error) if isinstance(error, SkywayError) else our_failure()
    if problem.status == _FAILED.status and not isinstance(error, RemoteProblem):
        raise error  # the boundary logs it and answers
    headers = problem_headers(error) if isinstance(error, SkywayError) else {}
    return problem_response(problem, headers)


async def _on_invalid_request(_request: Request, error: Exception) -> Response:
    complaints = error.errors() if isinstance(error, RequestValidationError) else []
    body = error.body if isinstance(error, RequestValidationError) else None
    errors = _field_problems(complaints, body)
    is_broken = any(each["type"] in (BROKEN_JSON, "json_invalid") for each in complaints)
    kind = _BROKEN_JSON if is_broken else _INVALID
    return problem_response(_problem(kind, _summary(errors), errors=() if is_broken else errors))


async def _on_http_exception(request: Request, error: Exception) -> Response:
    if not isinstance(error, HTTPException):
        raise error
    headers, detail = dict(error.headers or {}), error.detail
    if error.status_code == HTTPStatus.METHOD_NOT_ALLOWED:
        headers["Allow"] = ", ".join(allowed_methods(request))
        detail = f"{request.method} is no method of this path, which has {headers['Allow']}"
    elif detail == HTTPStatus.NOT_FOUND.phrase:
        path = _printable(request.url.path)[:_MAX_TEXT]
        detail = f"no call has the path {path}; GET /openapi.json lists all"
    return problem_response(status_problem(error.status_code, detail), headers)


def allowed_methods(request: Request) -> list[str]:
    """All methods of a path, sorted: the framework names only the methods of one route."""
    app: FastAPI = request.app
    path = request.scope["path"].removeprefix(request.scope.get("root_path", ""))
    methods: set[str] = set()
    for route in iter_route_contexts(app.routes):
        if route.methods and route.path and compile_path(route.path)[0].match(path):
            methods |= route.methods | ({"HEAD"} if "GET" in route.methods else set())
    return sorted(methods)


def _problem(
    kind: _Kind,
    detail: str | None,
    *,
    code: str | None = None,
    errors: tuple[FieldProblem, ...] = (),
) -> ProblemDetails:
    return ProblemDetails(
        type=f"urn:skyway:problem:{kind.name}",
        title=kind.title,
        status=kind.status,
        detail=detail,
        code=code,
        errors=errors,
        trace_id=current_trace_id(),
    )


def _summary(errors: Sequence[FieldProblem]) -> str:
    """The first few fields at fault, and how many more there are."""
    detail = "; ".join(f"{problem.field}: {problem.detail}" for problem in errors[:3])
    return f"{detail}; and {len(errors) - 3} more" if len(errors) > 3 else detail


def _remote_problem(error: RemoteProblem) -> ProblemDetails:
    try:
        return ProblemDetails.model_validate({**error.problem, "status": error.status})
    except ValidationError:
        return status_problem(error.status, str(error))


def _field_problems(
    complaints: Sequence[Mapping[str, Any]],  # pydantic's error dicts, which have no public type
    body: object,
) -> tuple[FieldProblem, ...]:
    """The invalid fields in the caller's own JSON, in the validator's order."""
    places = [complaint["loc"] for complaint in complaints]
    problems = (
        FieldProblem(
            field=_field_name(complaint, body)[:_MAX_TEXT],
            detail=_printable(sentence_of(complaint))[:_MAX_TEXT],
        )
        for complaint in complaints[:_MAX_FIELD_PROBLEMS]
        # A list is not too short because some of its items are wrong.
        if complaint["type"] != "too_short"
        or not any(each[:-1] == complaint["loc"] for each in places)
    )
    return tuple(dict.fromkeys(problems))


def _field_name(complaint: Mapping[str, Any], body: object) -> str:
    place, *path = complaint["loc"]
    if place != "body":
        return _printable(".".join(map(str, path)) or str(place))
    return _printable(".".join(map(str, _parts_of(body, path, complaint["type"]))) or "body")


def _parts_of(value: Any, path: Sequence[int | str], complaint_type: str) -> Iterator[int | str]:
    """The parts that name a member. A validator also names the types of a union that it tried."""
    for number, part in enumerate(path):
        if _holds(value, part):
            value = value[part]
        elif not (complaint_type == "missing" and number == len(path) - 1):
            continue
        yield part


def _holds(value: object, part: int | str) -> bool:
    if isinstance(value, dict):
        return part in value
    return isinstance(value, list) and isinstance(part, int) and part < len(value)


def _printable(text: str) -> str:
    """The text without the half surrogate pairs that UTF-8 cannot encode."""
    return text.encode(errors="replace").decode()
