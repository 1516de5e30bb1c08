"""The limits of what a caller may send, and how long it may take."""

import contextlib
import resource
from dataclasses import dataclass
from typing import Final, Protocol, Self

#: Files that a process keeps for its databases, its calls to others and its webhooks.
_OTHER_FILES: Final = 400
#: As many open files as a process asks for where the system allows it.
_FILES_WANTED: Final = 8192


class FrontSettings(Protocol):
    """The settings of the limits; `ServiceSettings` has them all."""

    @property
    def http_connections(self) -> int:
        """The most connections of the process."""
        ...

    @property
    def http_connections_per_address(self) -> int:
        """The most connections of one address."""
        ...

    @property
    def http_url_bytes(self) -> int:
        """The longest path with its query."""
        ...

    @property
    def http_head_bytes(self) -> int:
        """The most bytes of all header lines of a request."""
        ...

    @property
    def http_head_s(self) -> float:
        """Seconds within which the header lines must have come."""
        ...

    @property
    def http_body_s(self) -> float:
        """Seconds within which a body must have come, and one more for each 64 KiB."""
        ...


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
    #: Requests that may wait behind one that is being answered, on the same connection.
    pipelined: int = 16
    #: A body may be this slow, bytes a second, after its first `body_s`.
    slowest_body_bps: int = 64 * 1024
    #: What is read and dropped after a request was refused, so that its sender sees the answer.
    dropped_bytes: int = 1024 * 1024
    #: Seconds for which a caller may leave an answer unread.
    unread_s: float = 30.0

    @classmethod
    def of(cls, settings: FrontSettings) -> Self:
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
    """How many files the process may have open; more than at its start if it may ask for more."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = _FILES_WANTED if hard == resource.RLIM_INFINITY else min(_FILES_WANTED, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return _FILES_WANTED if soft == resource.RLIM_INFINITY else soft
