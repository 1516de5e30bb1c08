"""The routes of a service, and the JSON that they accept: bounded, UTF-8, finite, storable.

A body is counted before it is parsed, and checked before it is validated (`body_bounds`). Python's
parser accepts more than JSON allows (NaN, UTF-16) and more than a database can store (NUL,
lone surrogates, integers beyond 64 bits). Such values would cause an error 500 later. Terminals
would obey control characters.
"""

import asyncio
import json
import math
import re
from collections.abc import Awaitable, Callable, Coroutine, Iterator
from email.message import Message as Header
from functools import cached_property
from http import HTTPStatus
from typing import Annotated, Any, Final, Generic, TypeVar

from fastapi import APIRouter, Request, Response
from fastapi.datastructures import DefaultPlaceholder
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from pydantic import BaseModel, ValidationError
from pydantic_core import from_json
from starlette.exceptions import HTTPException

from skyway.complaints import BROKEN_JSON
from skyway.json_model import JsonModel
from skyway.json_text import STANDS_TWICE, Path, repeated_member, whole_or_infinite
from skyway.runtime.http.body_bounds import BodyBounds, BodyLimit, BodyText
from skyway.runtime.http.csv_answers import (
    CSV,
    Column,
    columns_of_models,
    csv_answer,
    is_known_form,
    item_models,
    prefers,
)

M = TypeVar("M", bound=BaseModel)

#: A media type in `Accept` that is not wanted.
_REFUSED: Final = re.compile(r";\s*q=0(\.0*)?\s*(;|$)")

#: Calls a function with a body, in a thread. Any: what the function makes of it.
InThread = Callable[[Callable[[bytes], Any], bytes], Awaitable[Any]]

#: Our own bodies nest at most about ten levels.
MAX_DEPTH: Final = 100
_TOO_DEEP: Final = f"nests deeper than {MAX_DEPTH} levels"

_MAX_INTEGER: Final = 2**63 - 1

#: `isinstance` takes a third of the time with a pair as with a union of types.
_HOLDERS: Final = (dict, list)

#: Bodies up to this size are parsed without a thread, in a millisecond.
_SMALL_BYTES: Final = 32 * 1024

_SURROGATES = re.compile("[\ud800-\udfff]")

#: Characters that a terminal obeys instead of showing them; tabs and ends of lines are text.
_CONTROL = re.compile("[\x01-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]")

#: For each member that is missing in a larger text, pydantic would copy the whole object.
_COPIED_BYTES: Final = 16 * 1024

#: The forms of unstorable values in raw text whose digits are 0; most bodies have none of them.
#: The first is searched first: a search for the others within a long number takes a millisecond.
_LONG: Final = b"0" * 19
_SUSPICIOUS: Final = (_LONG, rb"\u", rb"\b", rb"\f", b"\x7f", b"\xc2", b"NaN", b"Infinity", b"e000")
_DIGITS: Final = bytes.maketrans(b"123456789E", b"000000000e")


#: The description of a list as CSV, a part of the OpenAPI document.
_CSV_CONTENT: Final = {
    "schema": {
        "type": "string",
        "description": "The items as CSV, one row each, below a row with the names of the columns. "
        "The next page is in the header `Link`.",
    }
}

#: The attribute of a route's function that holds the limit of its body.
_TAKES: Final = "body_limit"
#: The most bytes of a body of a route that reads none.
_NO_BODY: Final = BodyBounds(4 * 1024)

F = TypeVar("F", bound=Callable[..., Any])


def takes_bytes(limit: int | BodyLimit) -> Callable[[F], F]:
    """A decorator for the function of a route: the most bytes of its body.

    Without it the schema of the body gives the limit.
    """

    def marked(endpoint: F) -> F:
        setattr(endpoint, _TAKES, limit)
        return endpoint

    return marked


def body_limit_of(request: Request) -> int:
    """The most bytes of the body, once the route of the request is known."""
    route = request.scope.get("route")
    limit = getattr(getattr(route, "endpoint", None), _TAKES, None)
    if limit is not None:
        return int(limit(request) if callable(limit) else limit)
    return route.bounds.size_bytes if isinstance(route, ServiceRoute) else _NO_BODY.size_bytes


class ServiceRoute(APIRoute):
    """A route that refuses a body which no valid body resembles, before FastAPI validates it."""

    @cached_property
    def bounds(self) -> BodyBounds:
        """The most that a valid body holds."""
        if self.body_field is None:
            readers = (each.call for each in self.dependant.dependencies)
            own = (each.bounds for each in readers if isinstance(each, InternalBody))
            return next(own, _NO_BODY)
        field = self.body_field.field_info
        return BodyBounds.of_type(Annotated[field.annotation, field])

    def __init__(self, *args: Any, **kwargs: Any) -> None:  # FastAPI's own
        super().__init__(*args, **kwargs)
        if self.item_models:
            answer = self.responses.get(HTTPStatus.OK.value, {})
            content = {**answer.get("content", {}), CSV: _CSV_CONTENT}
            self.responses = {**self.responses, HTTPStatus.OK.value: {**answer, "content": content}}

    @cached_property
    def item_models(self) -> tuple[type[JsonModel], ...]:
        """The models of the items, if it answers a list."""
        return item_models(self.response_model)

    @cached_property
    def csv_columns(self) -> tuple[Column, ...]:
        """The columns of its list."""
        return columns_of_models(self.item_models)

    @cached_property
    def media_types(self) -> tuple[str, ...]:
        """The types of its good answers; none if the document does not name them."""
        if self.status_code == HTTPStatus.NO_CONTENT or not self.include_in_schema:
            return ()
        own = self.response_class
        if isinstance(own, DefaultPlaceholder):
            own = own.value
        answers = (each for status, each in self.responses.items() if str(status)[0] == "2")
        named = [media for each in answers for media in each.get("content", ())]
        lists = (CSV,) if self.item_models else ()
        return tuple(filter(None, (own.media_type, *named, *lists)))

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """FastAPI's handler; it finds the body parsed, and does not parse it again."""
        handle, media_types = super().get_route_handler(), self.media_types
        has_body = self.body_field is not None

        async def check_and_handle(request: Request) -> Response:
            _refuse_other_types(request, media_types)
            raw = await request.body() if has_body else b""
            if raw:
                require_json_type(request)
                body = BodyText(raw)
                _refuse_excess(body, self.bounds)
                try:
                    value = await request.json()
                except RecursionError as error:
                    raise _complaint((), _TOO_DEEP, None) from error
                except ValueError:
                    value = _parsed_by_python(raw)
                require_storable(body, value, most_members=self.bounds.members)
            answer = await handle(request)
            is_page = self.item_models and answer.media_type == "application/json"
            if is_page and prefers(CSV, request):
                return csv_answer(json.loads(bytes(answer.body)), self.csv_columns, request)
            return answer

        return check_and_handle


class ServiceRouter(APIRouter):
    """Routes that an app uses as they are.

    FastAPI's own way is to include routers: then every route is built twice, and every request is
    matched twice. So the settings of all routes belong to the router, not to the app.
    """

    def __init__(
        self, *, tags: tuple[str, ...] = (), prefix: str = "", include_in_schema: bool = True
    ) -> None:
        super().__init__(
            tags=[*tags],
            prefix=prefix,
            route_class=ServiceRoute,
            include_in_schema=include_in_schema,
            generate_unique_id_function=operation_id,
        )


def operation_id(route: APIRoute) -> str:
    """The operation id of a route: its function's name in camel case, as `listStations`."""
    first, *others = route.name.split("_")
    return first + "".join(word.capitalize() for word in others)


def require_json_type(request: Request) -> None:
    """Refuse a body that is compressed, or whose Content-Type is not JSON, with 415."""
    if (encoding := request.headers.get("content-encoding", "identity")).lower() != "identity":
        detail = f"the body must have no Content-Encoding; it is {encoding}"
        raise HTTPException(415, detail, headers={"Accept-Encoding": "identity"})
    shown = request.headers.get("content-type", "")
    if shown == "application/json":
        return
    header = Header()
    header["content-type"] = shown
    kind = header.get_content_type() if shown else "none"
    if kind != "application/json" and not re.fullmatch(r"application/[^/]+\+json", kind):
        raise HTTPException(415, f"the Content-Type must be application/json; it is {kind}")


def _refuse_other_types(request: Request, media_types: tuple[str, ...]) -> None:
    """Refuse a call that accepts none of these types, with 406; JSON stands for all its kinds."""
    accept = ", ".join(request.headers.getlist("accept")).lower()
    if accept in ("", "*/*") or not media_types:
        return
    accepted = {
        media
        for part in accept.split(",")
        for media, *form in [[each.strip() for each in part.split(";")]]
        if not _REFUSED.search(part) and (media != CSV or is_known_form(form))
    }
    forms = {f"{each.partition('/')[0]}/*" for each in media_types} | {"*/*", *media_types}
    if any(each.endswith("json") for each in media_types):
        forms.add("application/json")
    if not accepted & forms:
        detail = f"this call answers {' or '.join(media_types)}; Accept names {accept[:100]}"
        raise HTTPException(406, detail)


async def read_json(request: Request, *, in_thread: InThread = asyncio.to_thread) -> Any:
    """The body of a route that reads it itself; errors have FastAPI's form.

    A large body is read by `in_thread`. Any: a JSON value of any type.
    """
    raw = await request.body()
    if raw:
        require_json_type(request)
    # A body of megabytes would stop all other requests meanwhile.
    return _parsed(raw) if len(raw) <= _SMALL_BYTES else await in_thread(_parsed, raw)


def _parsed(raw: bytes) -> Any:  # a JSON value of any type
    try:
        value = from_json(raw)  # in less than half of the time that Python's parser needs
    except ValueError:
        value = _parsed_by_python(raw)
    require_storable(BodyText(raw), value, most_members=len(raw))
    return value


def _parsed_by_python(raw: bytes) -> Any:  # a JSON value of any type
    """The value of a text that pydantic refuses. Python names the fault, or accepts more."""
    try:
        return json.loads(raw, parse_int=whole_or_infinite)
    except RecursionError as error:
        raise _complaint((), _TOO_DEEP, None) from error
    except json.JSONDecodeError as error:
        raise _broken(f"is not JSON at line {error.lineno}, column {error.colno}") from error
    except UnicodeDecodeError as error:
        raise _broken("the text is not UTF-8") from error


class InternalBody(Generic[M]):
    """A dependency that reads a service-to-service body of `model`, ignoring unknown fields."""

    def __init__(self, model: type[M]) -> None:
        self.model = model

    @cached_property
    def bounds(self) -> BodyBounds:
        """The most that a valid body holds."""
        return BodyBounds.of_type(self.model)

    async def __call__(self, request: Request) -> M:
        """The body; errors have the form that FastAPI gives them for a public body."""
        raw = await request.body()
        if raw:
            require_json_type(request)
        _refuse_excess(BodyText(raw), self.bounds)
        parsed = None
        try:
            if len(raw) > _COPIED_BYTES:
                parsed = from_json(raw)
                return self.model.model_validate(parsed, extra="ignore")
            return self.model.model_validate_json(raw, extra="ignore")
        except ValidationError as error:
            complaints = error.errors(include_url=False, include_input=False)
            if complaints[0]["type"] == "json_invalid":
                raise _broken(str(complaints[0].get("ctx", {}).get("error"))) from error
            located = [
                {**complaint, "loc": ("body", *complaint["loc"])} for complaint in complaints
            ]
            body = from_json(raw) if parsed is None else parsed
            raise RequestValidationError(located, body=body) from error
        except ValueError as error:  # of `from_json`
            raise _broken(str(error)) from error


def internal_body(model: type[M]) -> InternalBody[M]:
    """For `Annotated[Booking, Depends(internal_body(Booking))]`; OpenAPI shows its schema."""
    return InternalBody(model)


def _refuse_excess(body: BodyText, bounds: BodyBounds) -> None:
    if (excess := bounds.excess(body)) is not None:
        raise _complaint((), excess, None)


def require_storable(body: BodyText, value: object, *, most_members: int) -> None:
    """Refuse a body whose value no database stores, or that readers of JSON read differently.

    Raises
    ------
    RequestValidationError
        A value is wrong; the error names its place.
    """
    try:
        body.raw.decode()
    except UnicodeDecodeError as error:
        raise _broken("the text is not UTF-8") from error
    if b"\0" in body.raw:
        raise _broken("the text is not UTF-8")
    level: list[Any] = [value] if isinstance(value, _HOLDERS) else []
    depth = members = 0
    while level:
        if depth == MAX_DEPTH:
            raise _complaint((), _TOO_DEEP, value)
        members += sum(len(each) for each in level if isinstance(each, dict))
        if any(isinstance(each, dict) and len(each) > most_members for each in level):
            reason = f"holds an object of more than {most_members:,} members"
            raise _complaint((), reason, value)
        level = [
            inner
            for outer in level
            for inner in (outer.values() if isinstance(outer, dict) else outer)
            if isinstance(inner, _HOLDERS)
        ]
        depth += 1
    if members != body.members and (place := repeated_member(body.raw)) is not None:
        raise _complaint(place, STANDS_TWICE, value)
    # A walk through all values takes longer than this search, and so does a pattern.
    zeroed = body.plain.translate(_DIGITS, b"+")
    if any(form in zeroed for form in _SUSPICIOUS):
        for path, reason in _unstorable(value):
            raise _complaint(path, reason, value)


def _unstorable(value: object, path: Path = ()) -> Iterator[tuple[Path, str]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from ((path, f"a name in it {reason}") for reason in _text_faults(key))
            yield from _unstorable(inner, (*path, key))
    elif isinstance(value, list):
        for number, inner in enumerate(value):
            yield from _unstorable(inner, (*path, number))
    elif isinstance(value, str):
        yield from ((path, reason) for reason in _text_faults(value))
    elif isinstance(value, float) and not math.isfinite(value):
        yield path, "must be a finite number"
    elif isinstance(value, int) and abs(value) > _MAX_INTEGER:
        yield path, f"must be a whole number of at most {_MAX_INTEGER}"


def _text_faults(text: str) -> Iterator[str]:
    if text.isprintable():
        return
    if "\0" in text:
        yield "holds the character U+0000"
    if _SURROGATES.search(text):
        yield "holds half of a surrogate pair"
    if found := _CONTROL.search(text):
        yield f"holds the control character U+{ord(found[0]):04X}"


def _complaint(path: Path, reason: str, body: object) -> RequestValidationError:
    complaint = {"type": "unstorable", "loc": ("body", *path), "msg": reason}
    return RequestValidationError([complaint], body=body)


def _broken(reason: str) -> RequestValidationError:
    complaint = {"type": BROKEN_JSON, "loc": ("body",), "msg": reason}
    return RequestValidationError([complaint], body=None)
