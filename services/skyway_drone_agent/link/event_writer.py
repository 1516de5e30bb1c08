"""Makes the events of one drone from its logbook, and writes them to the journal."""

import logging
from datetime import datetime

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import FlightStep
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
