"""A drone's state: made from its logbook and its sensors, sent on change and every 30 s."""

import asyncio
from operator import attrgetter
from typing import Literal, Protocol

from skyway.contracts.drone_report import DroneHealth, DroneState, Wind
from skyway.contracts.topics import STATE
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import MqttUnavailable
from skyway_drone_agent.analysis.analysis import Assessment, Lookout
from skyway_drone_agent.failsafes.failsafe import active_failsafe, in_order_of_danger
from skyway_drone_agent.journal.flight_recorder import FlightRecorder, NewsOrMoment
from skyway_drone_agent.journal.logbook import Logbook, run_under_way
from skyway_drone_agent.link.events import EventSender
from skyway_drone_agent.link.link_monitor import Heartbeat
from skyway_drone_agent.link.uplink import Envelope, Uplink
from skyway_drone_agent.vehicle import StepRun

_Activity = Literal["IDLE", "LOADING", "FLYING", "WAITING", "RECHARGING", "DELIVERING", "DOWN"]

_ACTIVITY_OF_STEP: dict[str, _Activity] = {
    "PICK_UP": "LOADING",
    "FLY": "FLYING",
    "WAIT": "WAITING",
    "RECHARGE": "RECHARGING",
    "DELIVER": "DELIVERING",
    "RETURN": "DELIVERING",
}

#: Turns of the event loop in which other tasks, like the pilot, react to the same news.
_TURNS = 4

#: Fields that may differ between two states with the same meaning.
_PASSING = {"message_id", "sent_at", "seq", "at", "soc", "position", "health", "traceparent"}

#: All other fields of a state.
_meaning = attrgetter(*sorted(DroneState.model_fields.keys() - _PASSING))


def snapshot_of(logbook: Logbook, assessment: Assessment, *, envelope: Envelope) -> DroneState:
    """The state at the assessment; `step_id` is the step under way or the next one."""
    mission, run = logbook.mission, run_under_way(logbook)
    step_id = mission.steps[0].step_id if mission and mission.steps else None
    return DroneState(
        **envelope,
        traceparent=mission.accepted_by.traceparent if mission else None,
        at=assessment.at,
        activity=_activity_of(logbook, run),
        stream=logbook.stream,
        last_instruction_seq=logbook.last_instruction_seq,
        journal_session=logbook.first_session,
        last_event_seq=logbook.last_event_seq,
        mission_id=mission.mission_id if mission else None,
        mission_revision=mission.revision if mission else None,
        step_id=step_id,
        released_through=mission.released_through if mission else None,
        is_held=mission is not None and mission.is_held,
        station_id=logbook.station_id,
        position=assessment.position,
        soc=assessment.soc,
        load_kg=logbook.load_kg,
        package_ids=tuple(package.package_id for package in logbook.packages),
        health=health_of(assessment),
        faults=in_order_of_danger(logbook.faults),
        failsafe=active_failsafe(logbook),
    )


def health_of(assessment: Assessment) -> DroneHealth:
    """The results of the analysis on board, as they are sent."""
    wind = assessment.wind_mps
    return DroneHealth(
        voltage_v=assessment.voltage_v,
        current_a=assessment.current_a,
        soc_error=assessment.soc_error,
        cell_spread_v=assessment.cell_spread_v,
        temperature_c=assessment.temperature_c,
        state_of_health=assessment.state_of_health,
        consumption_factor=assessment.consumption_factor,
        still_air_factor=assessment.still_air_factor,
        charge_rate_factor=assessment.charge_rate_factor,
        range_m=assessment.range_m,
        wind=Wind(east_mps=wind[0], north_mps=wind[1]) if wind else None,
        safe_landings=tuple(landing.station_id for landing in assessment.safe_landings),
    )


def _activity_of(logbook: Logbook, run: StepRun | None) -> _Activity:
    if logbook.is_down:
        return "DOWN"
    if run is not None:
        return _ACTIVITY_OF_STEP[run.step.kind]
    mission = logbook.mission
    if mission is None or mission.released_through < mission.first_step:
        return "IDLE"
    return "WAITING"


class Acks(Protocol):
    """The queue of answers to instructions."""

    async def wait_all_sent(self) -> None:
        """Return once the broker has confirmed every answer."""
        ...


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
        return snapshot_of(
            self._recorder.reported_logbook,
            self._lookout.look(),
            envelope=self._uplink.envelope(STATE),
        )
