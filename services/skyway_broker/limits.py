"""What one client, one account and one address may use of the embedded broker.

docs/reference/brokers.md lists the numbers and the reasons; a test compares the page with them.
"""

import contextlib
import resource
from dataclasses import dataclass, field
from typing import Final

from skyway.runtime.limits import Budget

#: Open connections in all, and of one address: a fleet of 5,000 may be behind one address.
CONNECTIONS: Final = 16_000
CONNECTIONS_PER_ADDRESS: Final = 8_000

#: Files that the process keeps for itself.
_OTHER_FILES: Final = 64


@dataclass(frozen=True, slots=True)
class AccountLimits:
    """What one account may use: a drone, a customer or a service."""

    #: Packets a second, and how many at any moment. A packet above 4 KiB counts as several. A
    #: client that sends faster is read more slowly; it loses nothing.
    packets: Budget
    #: Connections a second, and how many at any moment, counted after the password was right.
    connects: Budget
    #: Bytes that may wait for a client that does not read; with more it is disconnected.
    waiting_bytes: int
    #: Filters of one client; more are answered with 0x80.
    filters: int
    #: Connections of one account at the same time.
    connections: int
    #: Retained messages of one account, and their bytes together.
    retained: int
    retained_bytes: int


#: Drones and customers. A drone sends a few messages a second; after a lost link it sends its
#: whole journal again.
_CLIENT: Final = AccountLimits(
    packets=Budget("PACKETS", per_s=200.0, burst=5_000),
    connects=Budget("CONNECTS", per_s=1.0, burst=60),
    waiting_bytes=4 << 20,
    filters=100,
    connections=1,
    retained=16,
    retained_bytes=256 << 10,
)

#: Services speak for the whole fleet.
_SERVICE: Final = AccountLimits(
    packets=Budget("SERVICE_PACKETS", per_s=50_000.0, burst=200_000),
    connects=Budget("SERVICE_CONNECTS", per_s=20.0, burst=200),
    waiting_bytes=32 << 20,
    filters=500,
    connections=64,
    retained=100_000,
    retained_bytes=256 << 20,
)


@dataclass(frozen=True, slots=True)
class Limits:
    """The limits of one broker process."""

    #: Open connections in all, and of one address.
    connections: int = CONNECTIONS
    connections_per_address: int = CONNECTIONS_PER_ADDRESS
    #: Connections a second of one address, and how many at any moment.
    connects_per_address: Budget = field(
        default=Budget("ADDRESS_CONNECTS", per_s=500.0, burst=8_000)
    )
    #: Seconds until a new connection must have sent its whole CONNECT.
    introduction_s: float = 10.0
    #: Seconds until a packet that has begun must have come.
    packet_s: float = 60.0
    #: The longest silence of a client, seconds; a longer keepalive does not help.
    silence_s: float = 900.0
    #: Seconds for which a client may leave an answer unread.
    unread_s: float = 60.0
    #: Largest CONNECT; it holds a last will.
    connect_bytes: int = 16 << 10
    #: Largest PUBLISH; a mission of a thousand steps has about 300 KiB.
    publish_bytes: int = 1 << 20
    #: Largest packet of any other kind: a SUBSCRIBE has at most a hundred filters.
    packet_bytes: int = 32 << 10
    #: Longest topic and longest filter: characters, and levels.
    topic_characters: int = 512
    topic_levels: int = 12
    #: Bytes that may wait for all clients together; above it, those with most are disconnected.
    waiting_bytes: int = 256 << 20
    client: AccountLimits = _CLIENT
    service: AccountLimits = _SERVICE

    def allow_topic(self, topic: str) -> bool:
        """Whether a topic or a filter is short enough."""
        return len(topic) <= self.topic_characters and topic.count("/") < self.topic_levels


def allowed_connections(most: int) -> int:
    """As many of these connections as the open files of this process allow.

    The process asks the system for more files where that is permitted.
    """
    files = most + _OTHER_FILES
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft < files:
        target = files if hard == resource.RLIM_INFINITY else min(files, hard)
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (target, hard))
        soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return most if soft == resource.RLIM_INFINITY else max(min(most, soft - _OTHER_FILES), 64)
