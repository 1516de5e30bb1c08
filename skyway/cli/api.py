"""`skyway api`: calls any route of the REST API with the key of the command line."""

import json
import uuid
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Final
from urllib.parse import parse_qs, urlencode, urlsplit

import typer

from skyway.cli.data_folder import DataOption, data_folder
from skyway.cli.gateway import check_answer, fail, open_answer
from skyway.cli.providers import ProviderOption, provider_path
from skyway.json_text import json_value

if TYPE_CHECKING:
    import httpx

#: Makes the call with a path.
_Call = Callable[[str], "AbstractContextManager[httpx.Response]"]

#: Stands in a path for the id of the provider.
_PROVIDER: Final = "{provider}"


class Method(StrEnum):
    """The HTTP methods of the REST API."""

    GET = "GET"
    POST = "POST"
    PUT = "PUT"
    PATCH = "PATCH"
    DELETE = "DELETE"


#: The methods whose fields are parameters of the query.
_WITHOUT_BODY: Final = (Method.GET, Method.DELETE)

_MethodArgument = Annotated[
    Method, typer.Argument(case_sensitive=False, help="The HTTP method of the call.")
]
_PathArgument = Annotated[
    str,
    typer.Argument(
        help="The path of the call, such as '/v1/providers/{provider}'; {provider} stands for the "
        "id of the provider."
    ),
]
_FieldsArgument = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[NAME=VALUE]...",
        help="Members of the body, or parameters of the query with GET and DELETE. A value that is "
        "JSON is sent as JSON, any other as a text. A dot leads into an object: tariff.base=300.",
    ),
]
_FileOption = Annotated[
    typer.FileBinaryRead | None,
    typer.Option("--file", help="A JSON file with the body; - is standard input."),
]
_AcceptOption = Annotated[
    str | None, typer.Option(help="The media type of the answer, such as text/csv.")
]
_AllOption = Annotated[bool, typer.Option("--all", help="Print all pages of a list.")]
_IdempotencyOption = Annotated[
    str | None,
    typer.Option(help="Send the same key with a POST again, to do the same only once."),
]


def api_command(
    method: _MethodArgument,
    path: _PathArgument,
    fields: _FieldsArgument = None,
    file: _FileOption = None,
    accept: _AcceptOption = None,
    all_pages: _AllOption = False,
    idempotency_key: _IdempotencyOption = None,
    provider: ProviderOption = None,
    data: DataOption = None,
) -> None:
    """Call any route of the REST API, and print its answer.

    An answer that is not JSON is printed as it arrives. `skyway api get /openapi.json` prints the
    description of all routes.
    """
    if not path.startswith("/"):
        fail(f"the path {path!r} does not begin with /")
    if (provider is not None) > (_PROVIDER in path):
        fail(f"--provider has no effect: the path has no {_PROVIDER}")
    if all_pages and method is not Method.GET:
        fail("--all is for lists, which are read with GET")
    if file is not None and (fields or method in _WITHOUT_BODY):
        fail("--file is for POST, PUT and PATCH without NAME=VALUE")
    if idempotency_key is not None and method is not Method.POST:
        fail("--idempotency-key is for POST")
    folder = data_folder(data)
    if _PROVIDER in path:
        path = path.replace(_PROVIDER, provider_path(folder, provider).rpartition("/")[2])
    pairs = [_pair(each) for each in fields or ()]
    body = None if file is None else file.read()
    if method in _WITHOUT_BODY:
        path = _with_query(path, pairs)
    elif pairs:
        body = json.dumps(_members(pairs)).encode()
    if method is Method.POST:
        idempotency_key = idempotency_key or str(uuid.uuid4())
    call = partial(
        open_answer,
        method,
        folder=folder,
        body=body,
        idempotency_key=idempotency_key,
        accept=accept,
    )
    _print(_pages(call, path, all_pages=all_pages))


def _pair(field: str) -> tuple[str, str]:
    name, equals, value = field.partition("=")
    if not equals or not all(name.split(".")):
        fail(f"{field!r} is not NAME=VALUE")
    return name, value


def _members(pairs: Iterable[tuple[str, str]]) -> dict[str, Any]:
    """The JSON object with these members; each dot in a name leads into an object."""
    members: dict[str, Any] = {}
    for name, text in pairs:
        *above, last = name.split(".")
        place = members
        for each in above:
            place = place.setdefault(each, {})
            if not isinstance(place, dict):
                fail(f"{name}: {each} has another value already")
        if last in place:
            fail(f"{name} has a value already")
        try:
            place[last] = json_value(text)
        except ValueError:
            place[last] = text
    return members


def _with_query(path: str, pairs: Sequence[tuple[str, str]]) -> str:
    if not pairs:
        return path
    return f"{path}{'&' if '?' in path else '?'}{urlencode(pairs)}"


def _pages(call: _Call, path: str, *, all_pages: bool) -> Iterator["httpx.Response"]:
    """The answer of a call, then the further pages of a list if all are asked for."""
    cursor: str | None = ""
    while cursor is not None:
        with call(_with_query(path, [("cursor", cursor)] if cursor else [])) as answer:
            check_answer(answer, f"{answer.request.method} {path}")
            yield answer
            cursor = _next_cursor(answer)
        if cursor is not None and not all_pages:
            typer.echo("the list has more pages: --all prints them", err=True)
            return


def _next_cursor(answer: "httpx.Response") -> str | None:
    """The cursor of the next page, from the document or, for CSV, from the header `Link`."""
    if _is_json(answer):
        document = answer.json()
        return document.get("next_cursor") if isinstance(document, dict) else None
    link = answer.links.get("next", {}).get("url", "")
    return next(iter(parse_qs(urlsplit(link).query).get("cursor", ())), None)


def _print(pages: Iterable["httpx.Response"]) -> None:
    documents = []
    for number, answer in enumerate(pages):
        if _is_json(answer):
            documents.append(json.loads(answer.read()))
        else:
            _write(answer, is_first=number == 0)
    if len(documents) > 1:
        items = [item for document in documents for item in document["items"]]
        documents[0] |= {"items": items, "next_cursor": None}
    if documents:
        typer.echo(json.dumps(documents[0], indent=2))


def _write(answer: "httpx.Response", *, is_first: bool) -> None:
    """Write an answer as it arrives; a further page of CSV without the names of its columns."""
    if not is_first:
        typer.echo(answer.read().partition(b"\n")[2], nl=False)
        return
    for chunk in answer.iter_bytes():
        typer.echo(chunk, nl=False)


def _is_json(answer: "httpx.Response") -> bool:
    media_type: str = answer.headers.get("Content-Type", "").partition(";")[0]
    return media_type.endswith(("/json", "+json"))
