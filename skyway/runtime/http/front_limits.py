"""Limits for callers: how much they may send, how long they may take, and how many connect.

The table of connections decides which connection is closed when there are too many. A connection is
in use from the end of its request until the answer is sent. Any other connection waits. The
connection that has waited longest is closed. So connections that send nothing, or half a request,
cannot keep others out.
"""

import contextlib
import resource
from collections.abc import Collection
from dataclasses import dataclass
from ipaddress import IPv4Network, IPv6Network, ip_address, ip_network
from typing import Final, Protocol, Self

from skyway.runtime.limits import network_of
from skyway.runtime.metrics import count
from skyway.runtime.settings import ServiceSettings

#: Open files that a process needs for its databases, its calls to others and its webhooks.
_OTHER_FILES: Final = 400
#: Number of open files that a process asks for, if the system allows it.
_FILES_REQUESTED: Final = 8192


@dataclass(frozen=True, slots=True)
class FrontLimits:
    """The limits of one process."""

    connections: int
    per_address: int
    url_bytes: int
    head_bytes: int
    head_s: float
    body_s: float
    header_lines: int = 100
    #: Slowest body, bytes a second, after its first `body_s`.
    slowest_body_bps: int = 64 * 1024
    #: Bytes that are read and dropped after a refusal, so that the sender sees the answer.
    dropped_bytes: int = 1024 * 1024
    #: Longest time for which a caller may leave an answer unread, seconds.
    unread_s: float = 30.0

    @classmethod
    def of(cls, settings: ServiceSettings) -> Self:
        """The limits that these settings ask for, within the open files of the process."""
        most = max(_raise_file_limit() - _OTHER_FILES, 64)
        connections = min(settings.http_connections, most)
        return cls(
            connections=connections,
            # One address alone must not fill the process.
            per_address=min(settings.http_connections_per_address, connections // 2),
            url_bytes=settings.http_url_bytes,
            head_bytes=settings.http_head_bytes,
            head_s=settings.http_head_s,
            body_s=settings.http_body_s,
        )


def _raise_file_limit() -> int:
    """The limit of open files, raised first if the system allows that."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    requested = _FILES_REQUESTED if hard == resource.RLIM_INFINITY else min(_FILES_REQUESTED, hard)
    if soft != resource.RLIM_INFINITY and soft < requested:
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (requested, hard))
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return _FILES_REQUESTED if soft == resource.RLIM_INFINITY else soft


class Closable(Protocol):
    """A connection."""

    def close_waiting(self) -> None:
        """Close the connection; it must be waiting."""
        ...


class _Address:
    """The connections of one address; the waiting ones in the order of their wait."""

    __slots__ = ("open", "waiting")

    def __init__(self) -> None:
        self.open = 0
        self.waiting: dict[Closable, None] = {}


class ConnectionTable:
    """Counts the connections of the process and of each address.

    An address in `trusted_proxies` (separated by commas) may have all connections.
    """

    def __init__(self, limits: FrontLimits, *, trusted_proxies: str = "") -> None:
        self._limits = limits
        self._proxies = _networks(trusted_proxies)
        self._addresses: dict[str, _Address] = {}
        self._waiting: dict[Closable, _Address] = {}
        self.open = 0

    def enter(self, connection: Closable, host: str) -> str | None:
        """Note a new connection, which waits; None if there is no room for it.

        The answer is the name under which `leave` finds it.
        """
        name = network_of(host)
        address = self._addresses.setdefault(name, _Address())
        is_crowd = address.open >= self._limits.per_address and not self._is_proxy(host)
        is_full = self.open >= self._limits.connections
        if (is_crowd and not self._close_one(address.waiting)) or (
            is_full and not is_crowd and not self._close_one(self._waiting)
        ):
            self._count_refused(name)
            return None
        # The connection that was closed may have been the last one of its address.
        address = self._addresses.setdefault(name, address)
        address.open += 1
        self.open += 1
        address.waiting[connection] = None
        self._waiting[connection] = address
        return name

    def wait(self, connection: Closable, name: str) -> None:
        """Note that a connection waits from now on."""
        address = self._addresses[name]
        address.waiting[connection] = None
        self._waiting[connection] = address

    def use(self, connection: Closable, name: str) -> None:
        """Note that a connection is in use from now on."""
        self._addresses[name].waiting.pop(connection, None)
        self._waiting.pop(connection, None)

    def leave(self, connection: Closable, name: str) -> None:
        """Forget a connection that is closed."""
        self.use(connection, name)
        address = self._addresses[name]
        address.open -= 1
        self.open -= 1
        if address.open == 0:
            del self._addresses[name]

    def _close_one(self, waiting: Collection[Closable]) -> bool:
        longest = next(iter(waiting), None)
        if longest is None:
            return False
        count("skyway_http_connections_closed", "connections closed to make room", reason="waiting")
        longest.close_waiting()
        return True

    def _count_refused(self, name: str) -> None:
        if self._addresses[name].open == 0:
            del self._addresses[name]
        count("skyway_http_connections_closed", "connections closed to make room", reason="full")

    def _is_proxy(self, host: str) -> bool:
        return bool(self._proxies) and any(ip_address(host) in each for each in self._proxies)


def _networks(text: str) -> tuple[IPv4Network | IPv6Network, ...]:
    return tuple(ip_network(part.strip()) for part in text.split(",") if part.strip())
