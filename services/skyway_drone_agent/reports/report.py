"""Sends events until the broker confirms them, and the state on change and every 30 s."""

import asyncio
from operator import attrgetter
from typing import Protocol

from skyway.contracts.drone_report import DroneEvent, DroneState
from skyway.contracts.topics import EVENTS, STATE
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import MqttUnavailable
from skyway_drone_agent.analysis.lookout import Lookout
from skyway_drone_agent.journal.flight_recorder import FlightRecorder
from skyway_drone_agent.journal.waiting import NewsOrMoment
from skyway_drone_agent.link.heartbeat import Heartbeat
from skyway_drone_agent.link.uplink import Uplink
from skyway_drone_agent.reports.snapshot import snapshot_of

#: Turns of the event loop in which other tasks, like the pilot, react to the same news.
_TURNS = 4

#: Fields that may differ between two states with the same meaning.
_PASSING = {"message_id", "sent_at", "seq", "at", "soc", "position", "health", "traceparent"}

#: All other fields of a state.
_meaning = attrgetter(*sorted(DroneState.model_fields.keys() - _PASSING))


class Acks(Protocol):
    """The queue of answers to instructions."""

    async def wait_all_sent(self) -> None:
        """Return once the broker has confirmed every answer."""
        ...


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


class StateSender:
    """Sends the drone's state after the acks and events that the state counts.

    If the state came first, the cloud would ask for events that are already on their way.
    """

    def __init__(
        self,
        uplink: Uplink,
        recorder: FlightRecorder,
        lookout: Lookout,
        clock: FleetClock,
        *,
        acks: Acks,
        events: EventSender,
        heartbeat: Heartbeat,
    ) -> None:
        self._heartbeat = heartbeat
        self._acks = acks
        self._events = events
        self._uplink = uplink
        self._recorder = recorder
        self._lookout = lookout
        self._clock = clock
        self._news: asyncio.Event = recorder.watch()
        self._is_due = True

    def send_anew(self) -> None:
        """Send the state even if it has not changed: the broker may have lost it."""
        self._is_due = True
        self._news.set()

    async def run(self) -> None:
        """Send for ever."""
        last: DroneState | None = None
        due_at = self._clock.now()
        with NewsOrMoment(self._news, self._clock) as change:
            while True:
                await self._wait_for_earlier_messages()
                self._news.clear()
                state = self._state()
                if self._is_due or last is None or _meaning(state) != _meaning(last):
                    last = await self._sent(state)
                    # Not after `last.at`: the sensors may have been read before this beat.
                    due_at = self._heartbeat.after(self._clock.now())
                await change.wait(until=due_at)
                self._is_due = self._is_due or self._clock.now() >= due_at

    async def _sent(self, state: DroneState) -> DroneState:
        """Send until the broker confirms it; each attempt sends the state of that moment."""
        while True:
            # A request from now on needs a newer state than this one.
            self._is_due = False
            try:
                await self._uplink.send(STATE, state)
            except MqttUnavailable:
                await self._uplink.wait_to_retry()
                await self._wait_for_earlier_messages()
                state = self._state()
            else:
                return state

    async def _wait_for_earlier_messages(self) -> None:
        """Return once the acks and events are sent, and other tasks have reacted to them.

        When a mission is accepted, the broker confirms that and the first step begins, one state
        reports all three. Each state makes the whole cloud look at the drone.
        """
        await self._acks.wait_all_sent()
        for _ in range(_TURNS):
            await asyncio.sleep(0)
        await self._events.wait_all_sent()

    def _state(self) -> DroneState:
        # The guard's last assessment is recent enough; `at` says when it was made.
        assessment = self._lookout.newest()
        return snapshot_of(
            self._recorder.reported_logbook, assessment, envelope=self._uplink.envelope(STATE)
        )
