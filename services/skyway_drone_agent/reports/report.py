"""The reporter: events until the broker has them, state on change and every 30 s."""

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

#: Turns of the event loop in which whoever has the same news acts on it, as the pilot does.
_TURNS = 4

#: What may differ between two states that say the same.
_PASSING = {"message_id", "sent_at", "seq", "at", "soc", "position", "health", "traceparent"}

#: All that a state says beside.
_meaning = attrgetter(*sorted(DroneState.model_fields.keys() - _PASSING))


class Acks(Protocol):
    """The answers to instructions, on their way."""

    async def wait_all_sent(self) -> None:
        """Return once the broker has every answer."""
        ...


class EventSender:
    """Sends what the journal holds of events; the cloud may ask for them again."""

    def __init__(self, uplink: Uplink, recorder: FlightRecorder) -> None:
        self._uplink = uplink
        self._recorder = recorder
        self._news = recorder.watch()
        self._sent_through = 0
        self._progress = asyncio.Event()

    async def wait_all_sent(self) -> None:
        """Return once the broker has every event that has happened."""
        while self._next() is not None:
            self._progress.clear()
            await self._progress.wait()

    def resend_after(self, seq: int) -> None:
        """Send the events after this one again."""
        self._sent_through = min(self._sent_through, seq)
        self._news.set()

    async def run(self) -> None:
        """Send for ever, in order; after a restart all that are not confirmed."""
        while True:
            event = self._next()
            if event is None:
                await self._news.wait()
                self._news.clear()
                continue
            before = self._sent_through
            await self._uplink.send_until_confirmed(EVENTS, event)
            # The cloud may have asked for older ones meanwhile.
            if self._sent_through == before:
                self._sent_through = event.seq
            self._progress.set()

    def _next(self) -> DroneEvent | None:
        events = self._recorder.written_events
        return next((event for event in events if event.seq > self._sent_through), None)


class StateSender:
    """Sends the snapshot that tells the truth of progress, after the acks and events it counts.

    A state that came first would have the cloud ask for events that are on their way.
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
        """Send the state although it may not have changed: the broker may have lost it."""
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
                    # Not after `last.at`: the sensors may have been read before this very beat.
                    due_at = self._heartbeat.after(self._clock.now())
                await change.wait(until=due_at)
                self._is_due = self._is_due or self._clock.now() >= due_at

    async def _sent(self, state: DroneState) -> DroneState:
        """Send until the broker has it, each time as it is then."""
        while True:
            # What asks for a state from now on may not be answered by this one.
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
        """Return once all is told that comes first, and done what follows from it at once.

        A mission is accepted, the broker has that, and the first step begins: one state tells of
        all three, for each has the whole cloud look at the drone.
        """
        await self._acks.wait_all_sent()
        for _ in range(_TURNS):
            await asyncio.sleep(0)
        await self._events.wait_all_sent()

    def _state(self) -> DroneState:
        # What the guard has just seen is as good: `at` says when that was.
        assessment = self._lookout.newest()
        return snapshot_of(
            self._recorder.reported_logbook, assessment, envelope=self._uplink.envelope(STATE)
        )
