"""Posts one signed notification to a customer's webhook, at an address that was checked first."""

import asyncio
import ssl
from dataclasses import dataclass
from functools import cache
from http import HTTPStatus
from types import TracebackType
from typing import Final, Self

import httpx

from skyway.errors import InvalidInput
from skyway_gateway.notifications.webhooks.targets import IpAddress, Target, Targets

#: How long a receiver may take, seconds of wall time.
_TIMEOUT_S: Final = 10.0
_CONNECT_S: Final = 5.0
_USER_AGENT: Final = "Skyway-Webhooks/1"
#: The longest reason of a failed attempt that is shown to the customer, characters.
_LONGEST_DETAIL: Final = 300


@dataclass(frozen=True, slots=True)
class Reply:
    """How a receiver answered; `status` is None when it did not answer."""

    status: int | None
    detail: str | None

    @property
    def is_success(self) -> bool:
        """Whether the receiver has accepted the notification: any 2xx status."""
        return (
            self.status is not None and HTTPStatus.OK <= self.status < HTTPStatus.MULTIPLE_CHOICES
        )

    @property
    def is_gone(self) -> bool:
        """Whether the receiver wants no more notifications: status 410."""
        return self.status == HTTPStatus.GONE


class WebhookPost:
    """Posts notifications; redirects are not followed, and no answer's body is read."""

    def __init__(self, targets: Targets) -> None:
        self._targets = targets
        self._opened: httpx.AsyncClient | None = None

    async def __aenter__(self) -> Self:
        """Open the client; nothing is connected yet."""
        # No kept connections: a connection that was opened for one host name must not serve
        # another name at the same address. No proxy: a proxy would resolve names by itself.
        self._opened = httpx.AsyncClient(
            verify=_trusted_roots(),
            timeout=httpx.Timeout(_TIMEOUT_S, connect=_CONNECT_S),
            limits=httpx.Limits(max_connections=None, max_keepalive_connections=0),
            follow_redirects=False,
            trust_env=False,
        )
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close all connections."""
        await self._client.aclose()
        self._opened = None

    @property
    def _client(self) -> httpx.AsyncClient:
        if self._opened is None:
            raise RuntimeError("notifications are posted only while the client is open")
        return self._opened

    async def send(self, url: str, *, headers: dict[str, str], body: bytes) -> Reply:
        """The receiver's reply, or why there is none."""
        try:
            async with asyncio.timeout(_TIMEOUT_S):
                target = await self._targets.check(url)
                return await self._send(target, headers, body)
        except TimeoutError:
            return Reply(None, f"no answer within {_TIMEOUT_S:.0f} s")
        except InvalidInput as refusal:
            return Reply(None, refusal.detail[:_LONGEST_DETAIL])
        except httpx.HTTPError as error:
            return Reply(None, f"{type(error).__name__}: {error}"[:_LONGEST_DETAIL])

    async def _send(self, target: Target, headers: dict[str, str], body: bytes) -> Reply:
        """Try one address after another until a connection succeeds."""
        *others, last = target.addresses
        for address in others:
            try:
                return await self._send_to(address, target, headers, body)
            except (httpx.ConnectError, httpx.ConnectTimeout):
                continue
        return await self._send_to(last, target, headers, body)

    async def _send_to(
        self, address: IpAddress, target: Target, headers: dict[str, str], body: bytes
    ) -> Reply:
        request = self._client.build_request(
            "POST",
            target.url.copy_with(host=str(address)),
            content=body,
            headers={
                **headers,
                "host": target.url.netloc.decode("ascii"),
                "content-type": "application/json",
                "user-agent": _USER_AGENT,
            },
            # The certificate must match the host name, not the address.
            extensions={"sni_hostname": target.url.raw_host.decode("ascii")},
        )
        response = await self._client.send(request, stream=True)
        await response.aclose()
        detail = None if response.is_success else f"answered {response.status_code}"
        return Reply(response.status_code, detail)


@cache
def _trusted_roots() -> ssl.SSLContext:
    """The trusted certificate authorities, read from disk once."""
    return httpx.create_ssl_context(trust_env=False)
