"""The gateway's REST face as the demo uses it: asynchronous, one key per call."""

import uuid
from typing import Any, Self

import httpx

from skyway.errors import SkywayError


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
