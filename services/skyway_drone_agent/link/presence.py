"""The drone's presence: ONLINE, OFFLINE, and LOST as its last will."""

from skyway.contracts.drone_report import Connection
from skyway.contracts.topic import Address
from skyway.contracts.topics import CONNECTION
from skyway.ids import DroneId, ProviderId
from skyway.runtime.clock import FleetClock
from skyway.runtime.minting import Mint


class Presence:
    """Counts the connections of one session and makes their messages."""

    def __init__(
        self,
        clock: FleetClock,
        *,
        provider_id: ProviderId,
        drone_id: DroneId,
        session: int,
        mint: Mint,
    ) -> None:
        self.address: Address[Connection] = CONNECTION(provider_id, drone_id)
        self._clock = clock
        self._session = session
        self._mint = mint
        self._connection_number = 0

    def last_will(self) -> tuple[Address[Connection], Connection]:
        """The last will of the next connection; to be called once before each connect."""
        self._connection_number += 1
        return self.address, self._connection("LOST")

    def online(self) -> Connection:
        """The message that the latest connection is up."""
        return self._connection("ONLINE")

    def offline(self) -> Connection:
        """The message that the agent leaves on purpose; newer than the connection's others."""
        self._connection_number += 1
        return self._connection("OFFLINE")

    def _connection(self, status: str) -> Connection:
        return Connection.model_validate(
            {
                "message_id": self._mint("msg"),
                "sent_at": self._clock.now(),
                "session": self._session,
                "connection_number": self._connection_number,
                "status": status,
            }
        )
