"""What the registry does with messages that are not from their drones: it counts and drops them.

Composition reads most of the same messages. It keeps them in its quarantine, and alarms operators.
"""

from typing import Any

from pydantic import ValidationError

from skyway.contracts.topics import Topic
from skyway.runtime.mqtt.inbox import Arrival


class NoQuarantine:
    """The `Reception` of the registry; the inbox and the check count what is dropped."""

    def is_shut_out(self, ids: tuple[str, ...]) -> bool:
        """Never."""
        del ids
        return False

    def unreadable(
        self, topic: Topic[Any], ids: tuple[str, ...], payload: bytes, error: ValidationError
    ) -> None:
        """Drop it."""

    def forged(self, arrival: Arrival) -> None:
        """Drop it."""

    def postponed(self, ids: tuple[str, ...]) -> None:
        """Do nothing: the registry concludes nothing from silence within seconds."""
