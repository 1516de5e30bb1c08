"""A viewer of the live picture who comes back after each break, and remembers all it was sent."""

import contextlib
import json
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, NamedTuple, Self

import httpx

from tests.end_to_end.eventually import LONGEST_WAIT_S, eventually
from tests.end_to_end.local_system import NO_CERTIFICATES, LocalSystem
from tests.gateway.live.merged import merged

#: The pause before a viewer comes back, seconds.
_PAUSE_S = 0.05


class SeenEvent(NamedTuple):
    """An event with the run of the gateway, its number, and the viewer's document after it."""

    name: str
    epoch: str
    number: int
    document: Any


def live_events(
    system: LocalSystem, last_event_id: str | None = None
) -> Iterator[tuple[str, str, Any]]:
    """The id, the name and the data of each event, as an operator gets them."""
    headers = {"Authorization": f"Bearer {system.keys['SKYWAY_OPERATOR_KEY']}"}
    if last_event_id is not None:
        headers["Last-Event-ID"] = last_event_id
    url = f"{system.keys['SKYWAY_GATEWAY_URL']}/v1/live"
    limits: Any = {"timeout": LONGEST_WAIT_S, "verify": NO_CERTIFICATES}
    with httpx.stream("GET", url, headers=headers, **limits) as answer:
        answer.raise_for_status()
        event: dict[str, str] = {}
        for line in answer.iter_lines():
            if line and not line.startswith(":"):
                name, _, value = line.partition(": ")
                event[name] = value
            elif event:
                yield event["id"], event["event"], json.loads(event["data"])
                event = {}


@dataclass
class LiveViewer:
    """Follows the picture in a thread while its block lasts; a stream is a list of its events."""

    system: LocalSystem
    streams: list[list[SeenEvent]] = field(default_factory=list)
    _is_over: threading.Event = field(default_factory=threading.Event)
    _must_leave: threading.Event = field(default_factory=threading.Event)

    def __enter__(self) -> Self:
        self._thread = threading.Thread(target=self._follow, daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._is_over.set()

    @property
    def newest(self) -> SeenEvent | None:
        """The newest event of all streams."""
        return next((stream[-1] for stream in reversed(self.streams) if stream), None)

    def come_back(self) -> list[SeenEvent]:
        """Leave after the next event; the events since the return, the first of which has come."""
        before = len(self.streams)
        self._must_leave.set()
        eventually(lambda: len(self.streams) > before, "the viewer is back")
        return self.streams[before]

    def document_at(self, epoch: str, number: int) -> Any:
        """The document after all events of this run up to a number, once the viewer has them."""
        eventually(
            lambda: self.newest and self.newest.epoch == epoch and self.newest.number >= number,
            f"the viewer has seen {number}",
            instead=lambda: self.newest and self.newest[:3],
        )
        events = [event for stream in self.streams for event in stream]
        own = [each for each in events if each.epoch == epoch and each.number <= number]
        return own[-1].document

    def _follow(self) -> None:
        while not self._is_over.is_set():
            with contextlib.suppress(httpx.HTTPError):
                self._read()
            self._is_over.wait(_PAUSE_S)

    def _read(self) -> None:
        last = self.newest
        last_event_id = None if last is None else f"{last.epoch}-{last.number}"
        document = None if last is None else last.document
        events: list[SeenEvent] = []
        for event_id, name, data in live_events(self.system, last_event_id):
            document = data if name == "snapshot" else merged(document, data)
            epoch, _, number = event_id.partition("-")
            events.append(SeenEvent(name, epoch, int(number), document))
            if len(events) == 1:
                self.streams.append(events)
            if self._is_over.is_set() or self._must_leave.is_set():
                self._must_leave.clear()
                return
