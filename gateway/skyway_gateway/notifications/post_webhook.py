"""Posts one signed notification to a customer's webhook, at an address that was checked first.

A webhook may never point into our own network (server-side request forgery). The host name is
resolved, each address is checked, and the request goes to a checked address. A name that resolves
to another address a moment later gains nothing.

A name server that does not answer keeps its thread for as long as the system's resolver waits, half
a minute or more. So these look-ups have threads of their own, and one customer has few of them: the
process's other look-ups, and those of other customers, go on.
"""

import asyncio
import contextlib
import socket
import ssl
import threading
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from http import HTTPStatus
from ipaddress import (
    IPv4Address,
    IPv4Network,
    IPv6Address,
    IPv6Network,
    ip_address,
    ip_network,
)
from types import TracebackType
from typing import Final, Self

import httpx

from skyway.errors import InvalidInput
from skyway.ids import SubjectId
from skyway.runtime.errors import BudgetSpent
from skyway.runtime.limits import FairQueue

#: The addresses that the system's resolver finds; empty when there are none.
FindByDns = Callable[[str, int], Sequence[str]]

_AT_ONCE: Final = 64
_OF_ONE_CUSTOMER: Final = 4
_MOST_WAITING: Final = 64

_Name = tuple[SubjectId, str, int]


class NameLookups:
    """The look-ups of one process. `find` blocks its thread."""

    def __init__(self, find: FindByDns | None = None) -> None:
        self._find = find or _find_by_dns
        self._turns = FairQueue(
            "LOOKUPS", at_once=_AT_ONCE, per_tenant=_OF_ONE_CUSTOMER, most_waiting=_MOST_WAITING
        )
        self._under_way: dict[_Name, asyncio.Task[Sequence[str]]] = {}

    async def addresses(self, host: str, port: int, customer_id: SubjectId) -> Sequence[str]:
        """The addresses of a host, as text; empty when there are none.

        A caller that stops waiting leaves its look-up running: its thread is busy until then.

        Raises
        ------
        BudgetSpent
            So many names of the customer wait that no more may.
        """
        name = customer_id, host, port
        if name not in self._under_way:
            task = self._under_way[name] = asyncio.create_task(self._in_turn(name))
            task.add_done_callback(lambda _: self._under_way.pop(name))
        return await asyncio.shield(self._under_way[name])

    async def _in_turn(self, name: _Name) -> Sequence[str]:
        customer_id, host, port = name
        async with self._turns.turn(customer_id):
            return await _in_thread(lambda: self._find(host, port))


async def _in_thread(find: Callable[[], Sequence[str]]) -> Sequence[str]:
    """What `find` returns, in a thread that does not hold up the end of the process."""
    loop = asyncio.get_running_loop()
    found: asyncio.Future[Sequence[str]] = loop.create_future()

    def work() -> None:
        addresses = find()
        with contextlib.suppress(RuntimeError):  # the loop may have ended by now
            loop.call_soon_threadsafe(_answer, found, addresses)

    threading.Thread(target=work, name="look up a name", daemon=True).start()
    return await found


def _answer(found: asyncio.Future[Sequence[str]], addresses: Sequence[str]) -> None:
    if not found.done():
        found.set_result(addresses)


def _find_by_dns(host: str, port: int) -> Sequence[str]:
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        return ()
    return [str(address[0]) for *_, address in found]


IpAddress = IPv4Address | IPv6Address
IpNetwork = IPv4Network | IPv6Network

#: The addresses of a host and port, as text, in the turn of a customer.
Resolve = Callable[[str, int, SubjectId], Awaitable[Sequence[str]]]

_DEFAULT_PORTS: Final = {"http": 80, "https": 443}
_LARGEST_PORT: Final = 65535

#: Addresses that the network translates to IPv4 (RFC 6052, RFC 8215): their target is unknown.
_TRANSLATED: Final = (ip_network("64:ff9b::/96"), ip_network("64:ff9b:1::/48"))

#: Reserved networks that Python 3.11 takes for public: protocol assignments (RFC 6890), 6to4 relays
#: (RFC 7526), documentation (RFC 9637), segment routing (RFC 9602).
_RESERVED: Final = tuple(
    ip_network(text) for text in ("192.0.0.0/24", "192.88.99.0/24", "3fff::/20", "5f00::/16")
)

#: How long a receiver may take, seconds of wall time.
_TIMEOUT_S: Final = 10.0

_CONNECT_S: Final = 5.0

#: How long its name may take to be found, seconds.
_LOOKUP_S: Final = 5.0

_USER_AGENT: Final = "Skyway-Webhooks/1"

#: The statuses whose `Retry-After` says when to try again.
_REFUSED_FOR_NOW: Final = (HTTPStatus.TOO_MANY_REQUESTS, HTTPStatus.SERVICE_UNAVAILABLE)

#: The longest reason of a failed attempt that is shown to the customer, characters.
_LONGEST_DETAIL: Final = 300


class ForbiddenTarget(InvalidInput):
    """A webhook's URL is not a URL, has no address, or points to a forbidden address."""

    def __init__(self, detail: str) -> None:
        super().__init__("url", detail)


@dataclass(frozen=True, slots=True)
class Target:
    """A webhook's URL and the checked addresses of its host."""

    url: httpx.URL
    addresses: tuple[IpAddress, ...]


@dataclass(frozen=True, slots=True)
class Targets:
    """Checks URLs; `allowed` are private networks that the operator allows."""

    allowed: tuple[IpNetwork, ...] = ()
    resolve: Resolve = field(default_factory=lambda: NameLookups().addresses)

    async def check(self, url: str, customer_id: SubjectId) -> Target:
        """The target of a customer's URL.

        Raises
        ------
        ForbiddenTarget
            It is not an http or https URL, has no address, or one of its addresses is forbidden.
        BudgetSpent
            Too many names of the customer are being looked up.
        """
        parsed = _parse(url)
        port = parsed.port or _DEFAULT_PORTS[parsed.scheme]
        host = parsed.raw_host.decode("ascii")
        try:
            async with asyncio.timeout(_LOOKUP_S):
                found = await self.resolve(host, port, customer_id)
        except TimeoutError as error:
            raise ForbiddenTarget(
                f"{parsed.host!r}: no name server answered within {_LOOKUP_S:.0f} s"
            ) from error
        if not found:
            raise ForbiddenTarget(f"{parsed.host!r} has no address")
        addresses = tuple(dict.fromkeys(ip_address(text.partition("%")[0]) for text in found))
        for address in addresses:
            if not self._admits(address):
                raise ForbiddenTarget(
                    f"{parsed.host!r} is at {address}, which is not a public address"
                )
        return Target(parsed, addresses)

    def _admits(self, address: IpAddress) -> bool:
        seen = [address, *_embedded(address)]
        if any(address.version == net.version and address in net for net in _TRANSLATED):
            return False
        return all(self._is_allowed(one) or _is_public(one) for one in seen)

    def _is_allowed(self, address: IpAddress) -> bool:
        return any(address.version == net.version and address in net for net in self.allowed)


def _parse(url: str) -> httpx.URL:
    try:
        parsed = httpx.URL(url)
        host = parsed.host  # decoded here: not every "xn--..." is a name
    except (httpx.InvalidURL, ValueError) as error:
        raise ForbiddenTarget(f"not a URL: {error}") from error
    if parsed.scheme not in _DEFAULT_PORTS:
        raise ForbiddenTarget("must begin with http:// or https://")
    if not host:
        raise ForbiddenTarget("names no host")
    if parsed.userinfo:
        raise ForbiddenTarget("must not hold a user name or password: notifications are signed")
    if parsed.port is not None and not 0 < parsed.port <= _LARGEST_PORT:
        raise ForbiddenTarget(f"port {parsed.port} is not between 1 and {_LARGEST_PORT}")
    return parsed


def _embedded(address: IpAddress) -> list[IpAddress]:
    """The IPv4 addresses that an IPv6 address leads to: mapped, 6to4, Teredo."""
    if isinstance(address, IPv4Address):
        return []
    teredo = address.teredo or ()
    return [one for one in (address.ipv4_mapped, address.sixtofour, *teredo) if one is not None]


def _is_public(address: IpAddress) -> bool:
    if any(address.version == net.version and address in net for net in _RESERVED):
        return False
    if isinstance(address, IPv6Address):
        if address.ipv4_mapped is not None:
            return True  # the embedded IPv4 address is checked instead
        if address.is_site_local:
            return False
    return address.is_global and not address.is_multicast and not address.is_reserved


@dataclass(frozen=True, slots=True)
class Reply:
    """How a receiver answered; `status` is None when it did not answer.

    `retry_after` is the text of that header, if the receiver refuses for now (429, 503).
    """

    status: int | None
    detail: str | None
    retry_after: str | None = None

    @property
    def is_success(self) -> bool:
        """Whether the receiver has accepted the notification: any 2xx status."""
        return (
            self.status is not None and HTTPStatus.OK <= self.status < HTTPStatus.MULTIPLE_CHOICES
        )

    @property
    def status_class(self) -> int | None:
        """The class of the status, as 400: customers learn no more of what answers."""
        return None if self.status is None else self.status // 100 * 100

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

    async def send(
        self, url: str, customer_id: SubjectId, *, headers: dict[str, str], body: bytes
    ) -> Reply:
        """The receiver's reply, or why there is none."""
        try:
            async with asyncio.timeout(_TIMEOUT_S):
                target = await self._targets.check(url, customer_id)
                return await self._send(target, headers, body)
        except TimeoutError:
            return Reply(None, f"no answer within {_TIMEOUT_S:.0f} s")
        except InvalidInput as refusal:
            return Reply(None, refusal.detail[:_LONGEST_DETAIL])
        except BudgetSpent:
            return Reply(None, "too many names of your webhooks are being looked up")
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
        detail = None if response.is_success else f"answered {response.status_code // 100}xx"
        is_for_now = response.status_code in _REFUSED_FOR_NOW
        retry_after = response.headers.get("retry-after") if is_for_now else None
        return Reply(response.status_code, detail, retry_after)


@cache
def _trusted_roots() -> ssl.SSLContext:
    """The trusted certificate authorities, read from disk once."""
    return httpx.create_ssl_context(trust_env=False)
