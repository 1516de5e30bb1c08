"""Holds back the messages of drones until it is proven who sent them.

Messages are checked before they are decoded, and before their content can count against the drone
that they name.
"""

import logging
import time
from collections import Counter
from typing import Any, Final, Protocol

from pydantic import ValidationError

from skyway.contracts.topics import Topic
from skyway.ids import DroneId
from skyway.runtime.loops import Loops, Wake, repeat
from skyway.runtime.metrics import count
from skyway.runtime.mqtt.inbox import Arrival, ReadAgain
from skyway.runtime.signing.key_book import KeyBook

log = logging.getLogger(__name__)

#: The most messages that wait for a key, their bytes, and the most messages of one drone: what
#: brokers have retained of a large fleet comes together, and a drone has few of them.
_MOST_HELD: Final = 50_000
_MOST_HELD_BYTES: Final = 128 << 20
_MOST_HELD_OF_DRONE: Final = 20

#: Seconds of wall time between two lines in the log about forged messages.
_LOG_EVERY_S: Final = 60.0

#: Seconds of wall time between two looks for keys that have changed.
_REFRESH_EVERY_S: Final = 1.0


class Reception(Protocol):
    """Receives the decisions of the check."""

    def is_ours(self, ids: tuple[str, ...]) -> bool:
        """Whether this process reads the messages of this sender."""
        ...

    def is_shut_out(self, ids: tuple[str, ...]) -> bool:
        """Whether to drop the messages of this sender, unread."""
        ...

    def unreadable(
        self, topic: Topic[Any], ids: tuple[str, ...], payload: bytes, error: ValidationError
    ) -> None:
        """Handle a message of this sender that cannot be read."""
        ...

    def forged(self, arrival: Arrival) -> None:
        """Handle a message that is not from the drone that its topic names."""
        ...

    def postponed(self, ids: tuple[str, ...]) -> None:
        """Note that a message of this drone is not read now, and perhaps never."""
        ...


class SignatureCheck:
    """The `Doorkeeper` of an inbox with the messages of drones."""

    def __init__(self, book: KeyBook, reception: Reception) -> None:
        self._book = book
        self._reception = reception
        self._held: list[tuple[Arrival, ReadAgain]] = []
        self._held_of: Counter[str] = Counter()  # how many, by drone
        self._held_bytes = 0
        self._wake = Wake()
        self._logged_s = -_LOG_EVERY_S
        _count_forged(0)

    def is_ours(self, ids: tuple[str, ...]) -> bool:
        """Whether this process reads the messages of this sender."""
        return self._reception.is_ours(ids)

    def is_shut_out(self, ids: tuple[str, ...]) -> bool:
        """Whether to drop the messages of this sender, unread."""
        return self._reception.is_shut_out(ids)

    def unreadable(
        self, topic: Topic[Any], ids: tuple[str, ...], payload: bytes, error: ValidationError
    ) -> None:
        """Pass on a message of this sender that cannot be read."""
        self._reception.unreadable(topic, ids, payload, error)

    def is_proven(self, arrival: Arrival, read_again: ReadAgain) -> bool:
        """Whether the message is proven to be its drone's; if not, it may be read later."""
        drone_id = arrival.ids[1]
        result = self._book.judge(drone_id, arrival.name, arrival.payload)
        if result == "PROVEN":
            return True
        # The drone may have another key by now: the next look-up decides.
        self._reception.postponed(arrival.ids)
        if self._has_room(arrival):
            self._held.append((arrival, read_again))
            self._held_of[drone_id] += 1
            self._held_bytes += len(arrival.payload)
            self._wake.set()
        elif result == "FORGED":
            self._reject(arrival)
        else:
            count("skyway_unproven_messages", "drone messages dropped: their keys are not known")
        return False

    def _has_room(self, arrival: Arrival) -> bool:
        """Whether this message may wait; one drone must not take the places of others."""
        return (
            len(self._held) < _MOST_HELD
            and self._held_of[arrival.ids[1]] < _MOST_HELD_OF_DRONE
            and self._held_bytes + len(arrival.payload) <= _MOST_HELD_BYTES
            and not arrival.topic.is_too_large(arrival.payload)
        )

    def start(self, loops: Loops) -> None:
        """Start the loops that look up keys."""
        loops.start("signatures", repeat("signatures", self.step, every_s=1.0, wake=self._wake))
        loops.start("keys", repeat("keys", self._book.refresh, every_s=_REFRESH_EVERY_S))

    async def step(self) -> bool:
        """Step of a loop: look up the keys of the held messages, and decide; always False.

        A key that was looked up just now is not looked up again: messages that came since wait.

        Raises
        ------
        ServiceUnavailable
            The registry is away; the messages are held on.
        """
        due = {each for each in self._held_of if not self._book.is_current(each)}
        if not due:
            return False
        waiting = len(self._held)
        await self._book.look_up({DroneId(each) for each in due})
        held, self._held = self._held, []
        for number, (arrival, read_again) in enumerate(held):
            is_due = arrival.ids[1] in due
            if is_due and self._is_proven_now(arrival):
                if self.is_ours(arrival.ids):  # the look-up has shown which server reads it
                    read_again(arrival)
            elif is_due and number < waiting:
                self._reject(arrival)
            else:  # the message may have arrived during the look-up, signed with a newer key
                self._held.append((arrival, read_again))
        self._held_of = Counter(arrival.ids[1] for arrival, _ in self._held)
        self._held_bytes = sum(len(arrival.payload) for arrival, _ in self._held)
        return False

    def _is_proven_now(self, arrival: Arrival) -> bool:
        return self._book.judge(arrival.ids[1], arrival.name, arrival.payload) == "PROVEN"

    def _reject(self, arrival: Arrival) -> None:
        _count_forged(1)
        now_s = time.monotonic()
        if now_s - self._logged_s >= _LOG_EVERY_S:
            self._logged_s = now_s
            log.warning("drone message without a valid signature", extra={"topic": arrival.name})
        self._reception.forged(arrival)


def _count_forged(messages: int) -> None:
    count("skyway_forged_messages", "drone messages without a valid signature", messages)
