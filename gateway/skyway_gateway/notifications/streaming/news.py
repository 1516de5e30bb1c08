"""Tells listeners in this process that a delivery has a new event."""

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager

from skyway.ids import DeliveryId
from skyway.runtime.loops import Wake


class News:
    """A bell for each delivery that somebody listens to."""

    def __init__(self) -> None:
        self._listeners: dict[DeliveryId, set[Wake]] = defaultdict(set)

    @contextmanager
    def listen(self, delivery_id: DeliveryId) -> Iterator[Wake]:
        """A wake that is set at each new event of the delivery, while the block runs."""
        wake = Wake()
        self._listeners[delivery_id].add(wake)
        try:
            yield wake
        finally:
            self._listeners[delivery_id].discard(wake)
            if not self._listeners[delivery_id]:
                del self._listeners[delivery_id]

    def ring(self, delivery_id: DeliveryId) -> None:
        """Wake all who listen to the delivery."""
        for wake in self._listeners.get(delivery_id, ()):
            wake.set()

    @property
    def listener_count(self) -> int:
        """How many listen now."""
        return sum(len(wakes) for wakes in self._listeners.values())
