"""The parts that serve a drone for one session, put together once fleet time is set."""

from collections.abc import Coroutine
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Protocol, Self

from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock
from skyway_drone_agent.analysis.analysis import Lookout
from skyway_drone_agent.analysis.landings import LandingSource
from skyway_drone_agent.failsafes.guard import Guard
from skyway_drone_agent.flying.mission import Gates
from skyway_drone_agent.flying.pictures import PictureSender
from skyway_drone_agent.flying.pilot import Pilot
from skyway_drone_agent.journal.flight_recorder import FlightRecorder
from skyway_drone_agent.link.events import EventSender, EventWriter
from skyway_drone_agent.link.link_monitor import CloudMonitor, Heartbeat, LinkMonitor
from skyway_drone_agent.link.uplink import Link, Uplink
from skyway_drone_agent.messages.inbox import AckQueue, Inbox
from skyway_drone_agent.messages.state import StateSender
from skyway_drone_agent.messages.telemetry import TelemetrySender
from skyway_drone_agent.vehicle import Vehicle


class Part(Protocol):
    """Something that works beside the pilot while the drone is served."""

    def run(self) -> Coroutine[Any, Any, None]:
        """Work until cancelled. Any: the types that a coroutine yields belong to asyncio."""
        ...


@dataclass(frozen=True, slots=True)
class Cockpit:
    """The pilot, the parts beside it, and the parts that react to what the link receives."""

    pilot: Pilot
    parts: tuple[Part, ...]
    inbox: Inbox
    link_monitor: LinkMonitor
    cloud_monitor: CloudMonitor
    state: StateSender

    @classmethod
    def of(
        cls,
        recorder: FlightRecorder,
        vehicle: Vehicle,
        *,
        clock: FleetClock,
        link: Link,
        uplink: Uplink,
        drone_id: DroneId,
        book: LandingSource,
        api_url: str = "",
    ) -> Self:
        """The cockpit of a drone for the recorder's session; fleet time is set."""
        acks, events = AckQueue(uplink, recorder, clock), EventSender(uplink, recorder)
        writer = EventWriter(recorder, uplink)
        link_monitor = LinkMonitor(link, clock, on_change=recorder.notify_watchers)
        cloud_monitor = CloudMonitor(link, clock, on_change=recorder.notify_watchers)
        heartbeat = Heartbeat(drone_id, link_monitor, clock)
        lookout = Lookout(recorder, vehicle, clock, book=book)
        state = StateSender(
            uplink, recorder, lookout, clock, acks=acks, events=events, heartbeat=heartbeat
        )
        telemetry = TelemetrySender(uplink, clock)
        guard = Guard(
            recorder,
            vehicle,
            clock,
            lookout=lookout,
            events=writer,
            link=link_monitor,
            cloud=cloud_monitor,
            heartbeat=heartbeat,
            on_look=telemetry.offer,
        )
        inbox = Inbox(
            recorder,
            clock,
            vehicle=vehicle,
            answers=acks,
            events=events,
            energy_use=lookout.energy_use,
        )
        pilot = Pilot(
            recorder,
            vehicle,
            clock,
            gates=lambda: _gates(recorder, link_monitor, cloud_monitor, guard=guard),
            energy_use=lookout.energy_use,
            events=writer,
        )
        pictures = PictureSender(recorder, vehicle, clock, api_url=api_url)
        parts = (acks, events, link_monitor, state, telemetry, guard, pictures)
        return cls(pilot, parts, inbox, link_monitor, cloud_monitor, state)


def _gates(
    recorder: FlightRecorder, link: LinkMonitor, cloud: CloudMonitor, *, guard: Guard
) -> Gates:
    """The moments since when the drone may take off, begin a step and load."""
    mission = recorder.logbook.mission
    acceptance_sent_at = mission.acceptance_sent_at if mission else None
    up_since = link.up_since
    return Gates(
        take_off_at=_latest(link.not_lost_since, cloud.not_silent_since, guard.takes_off_since),
        begin_at=guard.begins_since,
        loading_at=max(acceptance_sent_at, up_since) if acceptance_sent_at and up_since else None,
    )


def _latest(*moments: datetime | None) -> datetime | None:
    """The latest of the moments; None if one of them is None."""
    given = [moment for moment in moments if moment is not None]
    return max(given) if len(given) == len(moments) else None
