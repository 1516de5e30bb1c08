"""Calls to a running gateway, and where the command line finds the gateway and its keys."""

import os
import re
import shlex
import time
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, NoReturn, Self

import typer

from skyway.cli.data_folder import DataFolder, is_starting
from skyway.errors import SkywayError

if TYPE_CHECKING:
    import httpx

_URL = "SKYWAY_GATEWAY_URL"

#: Seconds; the gateway needs a while to check and store a network of many thousand stations.
_TIMEOUT_S = 120.0

#: Items of one page of the gateway's lists: the most that it gives.
_PAGE: Final = 200

#: How long a command waits for a system that starts, and how often it looks, wall seconds.
_STARTS_WITHIN_S: Final = 600.0
_LOOK_EVERY_S: Final = 0.2

#: The keys that a command may call with. Unless it names one, it takes the first that is set, and
#: looks in the environment before keys.env.
_KEYS: Final = ("SKYWAY_OPERATOR_KEY", "SKYWAY_PROVIDER_KEY", "SKYWAY_CUSTOMER_KEY")

#: Names the cells whose part of a list is missing (docs/reference/rest.md).
_SILENT_CELLS = "Skyway-Silent-Cells"

#: Exit code when the gateway cannot be reached or refuses the call.
EXIT_REFUSED = 1


def call_gateway(
    method: str,
    path: str,
    *,
    folder: DataFolder,
    key_name: str | None = None,
    body: bytes | None = None,
    idempotency_key: str | None = None,
    options: Mapping[str, str] = MappingProxyType({}),
) -> Any:
    """The JSON that the gateway answers: any JSON value, which the route documents.

    `key_name` is the setting with the key; without it, `gateway_and_key` chooses. `options` has
    the command's option for each field that has one: messages name the option.

    The command ends with a message on standard error when a setting is missing, when the gateway
    cannot be reached, and when it answers with a problem.
    """
    answer = ask_gateway(
        method,
        path,
        folder=folder,
        key_name=key_name,
        body=body,
        idempotency_key=idempotency_key,
    )
    check_answer(answer, f"{method} {path}", options=options)
    return answer.json() if answer.content else None


def check_answer(
    answer: "httpx.Response", call: str, *, options: Mapping[str, str] = MappingProxyType({})
) -> None:
    """End the command if the gateway refused the call; say which cells gave no answer."""
    if not answer.is_success:
        answer.read()
        problem = _with_options(problem_of(answer), options)
        fail(f"{call} was answered {answer.status_code}: {problem}")
    if silent := answer.headers.get(_SILENT_CELLS):
        typer.echo(f"without {silent}, which gave no answer", err=True)


def ask_gateway(
    method: str,
    path: str,
    *,
    folder: DataFolder,
    key_name: str | None = None,
    body: bytes | None = None,
    idempotency_key: str | None = None,
) -> "httpx.Response":
    """What the gateway answers, also if it refuses the call; the command ends without an answer."""
    with open_answer(
        method,
        path,
        folder=folder,
        key_name=key_name,
        body=body,
        idempotency_key=idempotency_key,
    ) as answer:
        answer.read()
    return answer


@contextmanager
def open_answer(
    method: str,
    path: str,
    *,
    folder: DataFolder,
    key_name: str | None = None,
    body: bytes | None = None,
    idempotency_key: str | None = None,
    accept: str | None = None,
) -> Iterator["httpx.Response"]:
    """The gateway's answer, whose body is read as it arrives; `accept` is its media type."""
    import httpx

    url, key = gateway_and_key(folder, key_name)
    headers = {"Authorization": f"Bearer {key}"}
    if body is not None:
        headers["Content-Type"] = "application/json"
    if idempotency_key is not None:
        headers["Idempotency-Key"] = idempotency_key
    if accept is not None:
        headers["Accept"] = accept
    try:
        with http().stream(method, url + path, content=body, headers=headers) as answer:
            yield answer
    except (httpx.TransportError, httpx.InvalidURL) as error:
        fail(f"no answer from {url}: {error}. Is `skyway up` running?")


@cache
def http() -> "httpx.Client":
    """The client of a command's calls; it loads certificate authorities once, which takes 20 ms."""
    import httpx

    # A command may wait for hours between two calls, so no connection is kept for the next call.
    return httpx.Client(timeout=_TIMEOUT_S, limits=httpx.Limits(max_keepalive_connections=0))


def list_items(folder: DataFolder, path: str, **about: Any) -> Iterator[dict[str, Any]]:
    """All items of a list, page by page; `about` is passed to `call_gateway`.

    The route documents the JSON of an item.
    """
    cursor: str | None = ""
    while cursor is not None:
        after = cursor and f"&cursor={cursor}"
        page = call_gateway("GET", f"{path}?limit={_PAGE}{after}", folder=folder, **about)
        yield from page["items"]
        cursor = page["next_cursor"]


def _wait_for_start(folder: DataFolder) -> None:
    """Wait until the system that starts on this folder is ready, if one starts."""
    until_s = time.monotonic() + _STARTS_WITHIN_S
    if is_starting(folder):
        typer.echo("Skyway is starting; this command goes on when it is ready.", err=True)
    while is_starting(folder):
        if time.monotonic() > until_s:
            fail(f"Skyway was not ready within {_STARTS_WITHIN_S:g} s")
        time.sleep(_LOOK_EVERY_S)


def fail(message: str, *, exit_code: int = EXIT_REFUSED) -> NoReturn:
    """End the command with this message on standard error."""
    typer.echo(message, err=True)
    raise typer.Exit(exit_code)


def problem_of(answer: "httpx.Response") -> str:
    """The problem document in words.

    Several wrong fields have a line each. A field that the detail names is not printed twice.
    """
    try:
        problem = answer.json()
        detail = str(problem.get("detail") or problem.get("title") or problem)
        errors = problem.get("errors") or ()
        fields = [f"{error['field']}: {error['detail']}" for error in errors]
    except (ValueError, AttributeError, KeyError, TypeError):
        return answer.text
    if fields == [detail] or not fields:
        return detail
    is_detail_of_fields = all(field in detail for field in fields)
    return "\n  ".join(["" if is_detail_of_fields else detail, *fields])


def _with_options(problem: str, options: Mapping[str, str]) -> str:
    """The text with each field, such as `packages.0.latest_at`, replaced by its option."""
    for field, option in options.items():
        problem = re.sub(rf"\b(packages\.\d+\.)?{field}\b", option, problem)
    return problem


def read_keys(folder: DataFolder) -> dict[str, str]:
    """The `SKYWAY_...` settings of the folder's keys.env; those of the environment come first.

    Lines are ``NAME=value`` or ``export NAME=value``, as a shell reads them. Other lines are
    ignored. A missing file holds no settings.
    """
    try:
        text = folder.keys_file.read_text(encoding="utf-8")
    except FileNotFoundError:
        text = ""
    return _assignments(text) | _settings(os.environ)


def needed_settings(folder: DataFolder, *names: str) -> dict[str, str]:
    """All settings; the command ends with a message when one of these is missing.

    It first waits for a system that starts on the folder.
    """
    _wait_for_start(folder)
    settings = read_keys(folder)
    for name, value in settings.items():
        if name.endswith("_KEY") and not value.isascii():
            fail(f"{name} holds characters that no key has: copy the key again")
    for name in names:
        if not settings.get(name):
            fail(
                f"{name} is not set, neither in the environment nor in {folder.keys_file}; "
                "skyway up writes that file"
            )
    return settings


def gateway_and_key(folder: DataFolder, key_name: str | None = None) -> tuple[str, str]:
    """The gateway's URL, and the key of this setting.

    Without a name it is the operator's key, else the provider's, else the customer's; keys of the
    environment come before those of keys.env. The command ends with a message when one is missing.
    """
    if key_name is not None:
        settings = needed_settings(folder, _URL, key_name)
        return settings[_URL], settings[key_name]
    settings = needed_settings(folder, _URL)
    chosen = chosen_key(settings)
    if chosen is None:
        fail(
            f"neither {' nor '.join(_KEYS)} is set, in the environment or in {folder.keys_file}; "
            "skyway up writes that file"
        )
    return settings[_URL], settings[chosen]


def chosen_key(settings: Mapping[str, str]) -> str | None:
    """The setting with the key that a command calls with when it names none; None without keys."""
    places = (os.environ, settings)
    return next((name for place in places for name in _KEYS if place.get(name)), None)


def _settings(variables: Mapping[str, str]) -> dict[str, str]:
    return {name: value for name, value in variables.items() if name.startswith("SKYWAY_")}


def _assignments(text: str) -> dict[str, str]:
    found = {}
    for line in text.splitlines():
        name, equals, value = line.strip().removeprefix("export ").partition("=")
        if equals and name.strip().isidentifier():
            found[name.strip()] = " ".join(shlex.split(value, comments=True))
    return found


class GatewayApi:
    """Asynchronous calls to a running gateway; an answer that is not 2xx is a `SkywayError`."""

    def __init__(self, url: str) -> None:
        import httpx

        self._client = httpx.AsyncClient(base_url=url, timeout=30.0)

    async def __aenter__(self) -> Self:
        await self._client.__aenter__()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._client.aclose()

    async def call(self, method: str, path: str, *, key: str, body: object = None) -> Any:
        """The JSON that the gateway answers; the route documents it."""
        headers = {"Authorization": f"Bearer {key}"}
        if method == "POST":
            headers["Idempotency-Key"] = str(uuid.uuid4())
        answer = await self._client.request(
            method, path, headers=headers, json=body if body is not None else None
        )
        if not answer.is_success:
            raise SkywayError(f"{method} {path} was answered {answer.status_code}: {answer.text}")
        return answer.json() if answer.content else None
