"""The drone's own REST calls: rare, small, and made where blocking does no harm."""

import http.client
import json
import urllib.error
import urllib.request
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final
from urllib.parse import urlsplit

from skyway.errors import InvalidInput, SkywayError
from skyway.runtime.errors import ExitCode, InvalidSettings

_TIMEOUT_S: Final = 10.0
_LARGEST_ANSWER_BYTES: Final = 1 << 20
_SERVER_ERROR: Final = 500
#: The same call succeeds later.
_TOO_MANY_REQUESTS: Final = 429


class CloudRefused(InvalidSettings):
    """The cloud refused the call; the same call again does not help."""

    def __init__(self, status: int, code: str, detail: str) -> None:
        super().__init__(f"the cloud refused ({status} {code}): {detail}")
        self.status = status
        self.code = code


class CloudUnreachable(SkywayError):
    """The cloud did not answer, or failed; the call may have taken effect."""

    exit_code = ExitCode.NOT_NOW


class _NoRedirects(urllib.request.HTTPRedirectHandler):
    """Refuses redirects, which would carry the drone's key to another host."""

    def redirect_request(self, *_: Any, **__: Any) -> None:  # as urllib calls it
        return None


@dataclass(frozen=True, slots=True)
class CloudAccess:
    """The URL that a drone calls, and its key."""

    api_url: str
    key: str = field(repr=False)


class Cloud:
    """The gateway at a URL, with blocking calls."""

    def __init__(self, api_url: str) -> None:
        parts = urlsplit(api_url)
        if parts.scheme not in ("http", "https") or not parts.hostname:
            raise InvalidInput("api", "must look like https://host or http://host:port")
        self._url = api_url.rstrip("/")
        self._opener = urllib.request.build_opener(_NoRedirects)

    def get(self, path: str, *, key: str) -> Any:  # the JSON that the route documents
        """The answer to a GET.

        Raises
        ------
        CloudRefused
            The answer is 4xx.
        CloudUnreachable
            There was no answer, or no valid one.
        """
        return self._ask("GET", path, {"Authorization": f"Bearer {key}"}, None)

    def post(
        self,
        path: str,
        body: Mapping[str, object],
        *,
        key: str | None = None,
        idempotency_key: str | None = None,
    ) -> Any:  # the JSON that the route documents
        """The answer to a POST; it raises the errors of `get`."""
        headers = {"Content-Type": "application/json"}
        if key is not None:
            headers["Authorization"] = f"Bearer {key}"
        if idempotency_key is not None:
            headers["Idempotency-Key"] = idempotency_key
        return self._ask("POST", path, headers, json.dumps(body).encode())

    def put_picture(self, path: str, picture: bytes) -> None:
        """Upload a JPEG to an address that needs no key; it raises the errors of `get`."""
        self._answer("PUT", path, {"Content-Type": "image/jpeg"}, picture)

    def _ask(self, method: str, path: str, headers: dict[str, str], body: bytes | None) -> Any:
        try:
            return json.loads(self._answer(method, path, headers, body))
        except ValueError as error:
            raise CloudUnreachable(f"{self._url} does not answer in JSON: {error}") from error

    def _answer(self, method: str, path: str, headers: dict[str, str], body: bytes | None) -> bytes:
        # The scheme is http or https: see above.
        request = urllib.request.Request(  # noqa: S310
            self._url + path, data=body, headers=headers, method=method
        )
        try:
            with self._opener.open(request, timeout=_TIMEOUT_S) as answer:
                return bytes(answer.read(_LARGEST_ANSWER_BYTES))
        except urllib.error.HTTPError as error:
            with error:  # the error is also the answer and holds the connection
                raise _refusal(error) from error
        except (OSError, http.client.HTTPException, ValueError) as error:
            raise CloudUnreachable(f"{self._url} does not answer: {error}") from error


def _refusal(error: urllib.error.HTTPError) -> SkywayError:
    try:
        problem = json.loads(error.read(_LARGEST_ANSWER_BYTES))
        code, detail = str(problem.get("code", "")), str(problem.get("detail", error.reason))
    except (OSError, http.client.HTTPException, ValueError, AttributeError):
        code, detail = "", str(error.reason)
    if error.code >= _SERVER_ERROR or error.code == _TOO_MANY_REQUESTS:
        return CloudUnreachable(f"the cloud fails now ({error.code}): {detail}")
    return CloudRefused(error.code, code, detail)
