"""Limits for callers: how much they may send, and how long they may take."""

import contextlib
import resource
from dataclasses import dataclass
from typing import Final, Protocol, Self

#: Open files that a process needs for its databases, its calls to others and its webhooks.
_OTHER_FILES: Final = 400
#: Number of open files that a process asks for, if the system allows it.
_FILES_REQUESTED: Final = 8192


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
        """Seconds within which all header lines must arrive."""
        ...

    @property
    def http_body_s(self) -> float:
        """Seconds within which a body must arrive, plus one second for each 64 KiB."""
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
    #: Requests that may wait on a connection while an earlier one is answered.
    pipelined: int = 16
    #: Slowest body, bytes a second, after its first `body_s`.
    slowest_body_bps: int = 64 * 1024
    #: Bytes that are read and dropped after a refusal, so that the sender sees the answer.
    dropped_bytes: int = 1024 * 1024
    #: Longest time for which a caller may leave an answer unread, seconds.
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
    """The limit of open files, raised first if the system allows that."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    requested = _FILES_REQUESTED if hard == resource.RLIM_INFINITY else min(_FILES_REQUESTED, hard)
    if soft != resource.RLIM_INFINITY and soft < requested:
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (requested, hard))
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return _FILES_REQUESTED if soft == resource.RLIM_INFINITY else soft
