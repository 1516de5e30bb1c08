"""One call to the running gateway, with a key, told in words when it fails."""

import os
import shlex
import uuid
from collections.abc import Mapping
from typing import Any, NoReturn, Self

import httpx
import typer

from skyway.cli.data_folder import DataFolder
from skyway.errors import SkywayError

_URL = "SKYWAY_GATEWAY_URL"

#: Networks of many thousand stations take the gateway a while to check and store, seconds.
_TIMEOUT_S = 120.0

#: Exit code when the gateway cannot be reached or says no.
EXIT_REFUSED = 1


def call_gateway(
    method: str,
    path: str,
    *,
    key_name: str,
    folder: DataFolder,
    body: bytes | None = None,
    idempotency_key: str | None = None,
) -> Any:
    """The JSON that the gateway answers; any JSON value, as the caller's route documents it.

    Ends the command with a message on standard error when a setting is missing, the gateway cannot
    be reached, or it answers with a problem.
    """
    settings = read_keys(folder)
    for name in (_URL, key_name):
        if not settings.get(name):
            fail(f"{name} is not set, neither in the environment nor in {folder.keys_file}")
    headers = {"Authorization": f"Bearer {settings[key_name]}"}
    if body is not None:
        headers["Content-Type"] = "application/json"
    if idempotency_key is not None:
        headers["Idempotency-Key"] = idempotency_key
    try:
        answer = httpx.request(
            method, settings[_URL] + path, content=body, headers=headers, timeout=_TIMEOUT_S
        )
    except (httpx.TransportError, httpx.InvalidURL) as error:
        fail(f"no answer from {settings[_URL]}: {error}. Is `skyway up` running?")
    if not answer.is_success:
        fail(f"{method} {path} was answered {answer.status_code}: {_problem(answer)}")
    return answer.json() if answer.content else None


def fail(message: str) -> NoReturn:
    """Ends the command: the message on standard error."""
    typer.echo(message, err=True)
    raise typer.Exit(EXIT_REFUSED)


def _problem(answer: httpx.Response) -> str:
    """The problem document in words, each field at fault on a line of its own."""
    try:
        problem = answer.json()
        lines = [str(problem.get("detail") or problem.get("title") or problem)]
        lines += [f"  {error.get('field')}: {error.get('detail')}" for error in problem["errors"]]
    except (ValueError, AttributeError):
        return answer.text
    except (KeyError, TypeError):
        return lines[0]
    return "\n".join(lines)


def read_keys(folder: DataFolder) -> dict[str, str]:
    """The `SKYWAY_...` settings of the folder's keys.env; the environment's own ones win.

    A missing file holds nothing. Lines are ``NAME=value`` or ``export NAME=value``, as a shell
    reads them; anything else is passed over.
    """
    try:
        text = folder.keys_file.read_text(encoding="utf-8")
    except FileNotFoundError:
        text = ""
    return _assignments(text) | _settings(os.environ)


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
    """Calls to a running gateway; an answer that is not 2xx is a `SkywayError` with its words."""

    def __init__(self, url: str) -> None:
        self._client = httpx.AsyncClient(base_url=url, timeout=30.0)

    async def __aenter__(self) -> Self:
        await self._client.__aenter__()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._client.aclose()

    async def call(self, method: str, path: str, *, key: str, body: object = None) -> Any:
        """The JSON that the gateway answers; what it is, the route documents."""
        headers = {"Authorization": f"Bearer {key}"}
        if method == "POST":
            headers["Idempotency-Key"] = str(uuid.uuid4())
        answer = await self._client.request(
            method, path, headers=headers, json=body if body is not None else None
        )
        if not answer.is_success:
            raise SkywayError(f"{method} {path} was answered {answer.status_code}: {answer.text}")
        return answer.json() if answer.content else None
