"""One call to the running gateway, with a key, told in words when it fails."""

from typing import Any, NoReturn

import httpx
import typer

from skyway.cli.data_folder import DataFolder
from skyway.cli.keys import read_keys

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
