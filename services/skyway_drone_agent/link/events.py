"""A drone's events: made from its logbook, written to the journal, and sent until confirmed."""

import asyncio
import logging
from datetime import datetime

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import FlightStep
from skyway.contracts.topics import EVENTS
from skyway_drone_agent.journal.flight_recorder import FlightRecorder
from skyway_drone_agent.journal.records import EventRecorded, Record
from skyway_drone_agent.link.uplink import Uplink

log = logging.getLogger(__name__)


class EventWriter:
    """Numbers events and writes them in order."""

    def __init__(self, recorder: FlightRecorder, uplink: Uplink) -> None:
        self._recorder = recorder
        self._uplink = uplink

    def event(self, kind: str, ended_at: datetime, *, step: FlightStep | None = None) -> DroneEvent:
        """The next event, of the current mission, at the place where the drone stands."""
        logbook = self._recorder.logbook
        mission = logbook.mission
        return DroneEvent.model_validate(
            {
                **self._uplink.envelope_with(logbook.last_event_seq + 1),
                "traceparent": mission.accepted_by.traceparent if mission else None,
                "event": kind,
                "stream": logbook.stream,
                "mission_id": mission.mission_id if mission else None,
                "mission_revision": mission.revision if mission else None,
                "step_id": step.step_id if step else None,
                "step_kind": step.kind if step else None,
                "ended_at": ended_at,
                "station_id": logbook.station_id,
                "position": logbook.position,
                "soc": logbook.soc,
            }
        )

    def write(self, event: DroneEvent, *then: Record) -> None:
        """Write an event, and the records that follow from it."""
        self._recorder.note(EventRecorded(event=event), *then)
        log.info(
            "drone event",
            extra={
                "drone_id": self._recorder.drone_id,
                "event_kind": event.event,
                "mission_id": event.mission_id,
                "step_id": event.step_id,
                "code": event.code,
            },
        )


class EventSender:
    """Sends the events of the journal; the cloud may ask for them again."""

    def __init__(self, uplink: Uplink, recorder: FlightRecorder) -> None:
        self._uplink = uplink
        self._recorder = recorder
        self._news = recorder.watch()
        self._sent_through = 0
        self._progress = asyncio.Event()

    async def wait_all_sent(self) -> None:
        """Return once the broker has confirmed every written event."""
        while self._next() is not None:
            self._progress.clear()
            await self._progress.wait()

    def resend_after(self, seq: int) -> None:
        """Send the events after this one again."""
        self._sent_through = min(self._sent_through, seq)
        self._news.set()

    async def run(self) -> None:
        """Send events in order for ever; after a restart all unconfirmed events."""
        while True:
            event = self._next()
            if event is None:
                await self._news.wait()
                self._news.clear()
                continue
            before = self._sent_through
            await self._uplink.send_until_confirmed(EVENTS, event)
            # The cloud may have asked for older events meanwhile.
            if self._sent_through == before:
                self._sent_through = event.seq
            self._progress.set()

    def _next(self) -> DroneEvent | None:
        events = self._recorder.written_events
        return next((event for event in events if event.seq > self._sent_through), None)
