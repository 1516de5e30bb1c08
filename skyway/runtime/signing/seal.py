"""Signs published messages, and refuses messages without a valid signature.

A drone signs all its messages. A service of the cloud signs the messages that drones may read. A
drone with the cloud's keys ignores every message without a valid signature.
"""

import logging
import time
from collections.abc import Iterable
from typing import Any, Final, Protocol

from skyway.contracts.signature import CloudKeys
from skyway.contracts.topics import TOPICS, BrokerRole, Topic
from skyway.runtime.signing.key_pair import PrivateKey, is_signed_by, public_key_bytes

log = logging.getLogger(__name__)

#: Seconds of wall time between two lines in the log about refused messages.
_LOG_EVERY_S: Final = 60.0


class Seal(Protocol):
    """Signs and checks the payloads of one MQTT client."""

    def sealed(self, name: str, payload: bytes) -> bytes:
        """The payload as it is published on the topic of this name."""
        ...

    def admits(self, name: str, payload: bytes) -> bool:
        """Whether a payload that arrived on this topic may be read."""
        ...


class NoSeal:
    """Signs nothing and admits all: for readers whose messages are checked elsewhere."""

    def sealed(self, name: str, payload: bytes) -> bytes:
        """The payload itself."""
        del name
        return payload

    def admits(self, name: str, payload: bytes) -> bool:
        """Always."""
        del name, payload
        return True


class CloudSeal(NoSeal):
    """Signs the messages of a service that drones may read; `topics` are all topics."""

    def __init__(self, key: PrivateKey, topics: Iterable[Topic[Any]] = TOPICS) -> None:
        self._key = key
        self._topics = tuple(each for each in topics if "drone" in each.readers)

    def sealed(self, name: str, payload: bytes) -> bytes:
        """The payload with a signature, if drones may read it."""
        if any(topic.ids_in(name) is not None for topic in self._topics):
            return self._key.signed(name, payload)
        return payload


class DroneSeal:
    """Signs all messages of a drone with a key; admits messages that the cloud's keys have signed.

    A drone without a key signs nothing, and a drone without the cloud's keys admits all messages.
    """

    def __init__(self, key: PrivateKey | None, cloud: CloudKeys | None) -> None:
        self._key = key
        self._keys: dict[BrokerRole, tuple[bytes, ...]] | None = None
        if cloud is not None:
            self._keys = {
                "composition": tuple(map(public_key_bytes, cloud.composition)),
                "gateway": tuple(map(public_key_bytes, cloud.gateway)),
            }
        self._topics = tuple(each for each in TOPICS if "drone" in each.readers)
        #: How many messages were refused since the start.
        self.refused = 0
        self._logged_s = -_LOG_EVERY_S

    def sealed(self, name: str, payload: bytes) -> bytes:
        """The payload with the drone's signature."""
        return payload if self._key is None else self._key.signed(name, payload)

    def admits(self, name: str, payload: bytes) -> bool:
        """Whether the service that may write on this topic has signed the payload."""
        if self._keys is None:
            return True
        writer = next((each.writer for each in self._topics if each.ids_in(name) is not None), None)
        keys = () if writer is None else self._keys.get(writer, ())
        if any(is_signed_by(key, name, payload) for key in keys):
            return True
        self._refuse(name)
        return False

    def _refuse(self, name: str) -> None:
        self.refused += 1
        now_s = time.monotonic()
        if now_s - self._logged_s >= _LOG_EVERY_S:
            self._logged_s = now_s
            log.warning(
                "message without a valid signature of the cloud ignored",
                extra={"topic": name, "refused": self.refused},
            )
