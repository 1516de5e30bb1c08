"""The loops that run beside composition's REST answers.

Each replica sends messages, follows its own drones, and replans missions when it is woken. Only the
leader runs the loops that look at all rows from time to time.
"""

from collections.abc import Mapping
from functools import partial
from typing import Final, Never

from skyway.contracts.mission_reports import MANY_MISSION_REPORTS, MISSION_REPORTS
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.loops import Loops, Wake, always, repeat
from skyway.runtime.mqtt.client import MqttClient
from skyway.runtime.outbox.senders import MqttSender, ReportSender
from skyway.runtime.outbox.stream_sender import hint_pace
from skyway.runtime.replicas.membership import LeaderStep
from skyway_composition.missions.closure_impact.impact import GroundStopEnforcer
from skyway_composition.missions.following.follow import Follower, GainedDrones
from skyway_composition.missions.queue.keep_calendars import Calendars, WithdrawnDrones
from skyway_composition.missions.replanning.go_sooner import WaitingMissions
from skyway_composition.missions.replanning.replan import Replanner
from skyway_composition.missions.timeouts import (
    LateMissions,
    LoadingTimeouts,
    OverdueMissions,
    UnknownMissions,
)
from skyway_composition.networks.measure_wind import MeasuredWinds
from skyway_composition.networks.publish import NetworkVersions
from skyway_composition.pads.announce import StationStates
from skyway_composition.parts import Parts

#: Seconds of wall time after which a loop runs again without being woken.
_STEP_EVERY_S: Final = 1.0
#: Seconds of wall time between two questions to the registry about drones with QUEUED missions.
_ASK_REGISTRY_EVERY_S: Final = 3.0
#: How often the leader looks for missions that the gateway does not know, seconds.
_UNKNOWN_EVERY_S: Final = 5.0
#: How often the leader looks for missions that wait long, seconds.
_WAITING_EVERY_S: Final = 5.0
#: How often the leader reads the wind that drones measure, seconds; a forecast changes less often.
_MEASURE_EVERY_S: Final = 20.0


class Work:
    """All loops: they send messages, follow drones, replan, find what is late, and announce."""

    def __init__(
        self, parts: Parts, *, mqtt: MqttClient, clients: Mapping[str, ServiceClient]
    ) -> None:
        db, clock, mint = parts.db, parts.clock, parts.mint
        self._parts = parts
        self._mqtt = mqtt
        self._membership = parts.membership
        polls = self._membership.polls
        self._instructions = MqttSender(db, mqtt, clock, ready=mqtt.wait_connected, polls=polls)
        self._reports = ReportSender(
            db,
            clients,
            clock,
            together={MISSION_REPORTS: MANY_MISSION_REPORTS},
            # To the registry a report is only a hint: our own index says which drones are busy.
            paces={"registry": hint_pace()},
            polls=polls,
        )
        self._listening = parts.listening
        self._handler = parts.handler
        self._follower = Follower(
            self._handler,
            mqtt,
            doorkeeper=parts.signatures,
            clock=clock,
            quarantine=parts.quarantine,
            listening=self._listening,
        )
        self._gained = GainedDrones(
            self._handler, mqtt.subscribe_again, membership=self._membership, clock=clock
        )
        self._overdue = OverdueMissions(parts, self._listening)
        self._late = LateMissions(parts)
        self._replanner = Replanner(parts, self._membership.own_id, parts.closings)
        self._waiting = WaitingMissions(parts)
        self._calendars = Calendars(parts, parts.dispatch_terms.tolerance_s)
        self._dispatcher = parts.dispatcher(clients["registry"])
        self._withdrawn = WithdrawnDrones(parts, clients["registry"])
        self._loading_timeouts = LoadingTimeouts(parts)
        self._keeper = parts.keeper
        self._ground_stops = GroundStopEnforcer(parts, parts.closings)
        self._unknown = UnknownMissions(parts)
        self._measured_winds = MeasuredWinds(db, clock, parts.calendars)
        self._station_states = StationStates(db, mqtt, clock, mint, parts.own_cells)
        self._network_versions = NetworkVersions(db, mqtt, clock, mint, parts.own_cells)

    async def greet(self) -> None:
        """After every connect: publish retained messages again, ask drones for missed events."""
        self._listening.begin()
        self._membership.set_listening(True)
        self._publish_again()
        await self._handler.ask_live_drones(self._listening.owns)

    def _publish_again(self) -> None:
        self._station_states.forget()
        self._network_versions.forget()
        self._membership.rest.end()
        self._parts.published.set()

    async def _follow(self) -> bool:
        """Handle the messages of drones; the first of them has the planner loaded."""
        has_more = await self._follower.step()
        self._parts.solver.needed.set()
        return has_more

    async def _notice_freezes(self) -> bool:
        """Notice that this process was frozen, also while the loop of overdue missions rests."""
        self._listening.look()
        return False

    async def _notice_lost_connections(self) -> Never:
        """End the listening whenever the connection to the broker is lost; `greet` begins it."""
        while True:
            await self._mqtt.wait_connected()
            await self._mqtt.wait_lost()
            self._listening.end()
            self._membership.set_listening(False)

    def start(self, loops: Loops) -> None:
        """Start all loops."""
        self._membership.start(loops)
        loops.start("listening", self._notice_lost_connections())
        loops.start("gained drones", repeat("gained drones", self._gained.step, every_s=1.0))
        loops.start("instructions", self._instructions.run())
        loops.start("reports", self._reports.run())
        self._parts.signatures.start(loops)
        loops.start("follow", repeat("follow", self._follow, every_s=1.0))
        loops.start("freezes", repeat("freezes", self._notice_freezes, every_s=_STEP_EVERY_S))
        looks, quarantine = self._membership.looks, self._parts.quarantine
        for name, step, wake, polls in (
            ("overdue", self._overdue.step, Wake(), looks),
            ("quarantine", quarantine.step, quarantine.wake, always),
        ):
            loops.start(name, repeat(name, step, every_s=_STEP_EVERY_S, wake=wake, polls=polls))
        # Each replica does the work it was woken for. The leader also finds work that others left.
        for name, step, wake in (
            ("recompose", self._replanner.step, self._parts.stuck),
            ("calendars", self._calendars.step, self._parts.calendars),
        ):
            polls = self._membership.polls
            loops.start(name, repeat(name, step, every_s=_STEP_EVERY_S, wake=wake, polls=polls))
        self._start_leading(loops)

    def _start_leading(self, loops: Loops) -> None:
        """Start the loops that only the leader runs, for all replicas."""
        states, versions = self._station_states, self._network_versions
        led = partial(LeaderStep, self._membership)
        for name, step, every_s in (
            ("lagging", led(self._late.step), _STEP_EVERY_S),
            ("loading", led(self._loading_timeouts.step), _STEP_EVERY_S),
            ("waiting", led(self._waiting.step), _WAITING_EVERY_S),
            ("unknown missions", led(self._unknown.step), _UNKNOWN_EVERY_S),
            ("holds", led(self._keeper.delete_expired), _STEP_EVERY_S),
            ("ground stops", led(self._ground_stops.step), _STEP_EVERY_S),
            ("station states", led(states.step, begin=states.forget), _STEP_EVERY_S),
            ("withdrawn drones", led(self._withdrawn.step), _ASK_REGISTRY_EVERY_S),
        ):
            loops.start(name, repeat(name, step, every_s=every_s, polls=self._membership.looks))
        # It does not rest, because the last flight before a rest has measured wind too.
        measured = led(self._measured_winds.step)
        winds = repeat("measured wind", measured, every_s=_MEASURE_EVERY_S)
        loops.start("measured wind", winds)
        dispatch_every_s = self._parts.dispatch_terms.every_s
        if dispatch_every_s > 0:
            dispatched = repeat(
                "dispatcher",
                led(self._dispatcher.step),
                every_s=dispatch_every_s,
                wake=self._parts.dispatches,
                polls=self._membership.looks,
            )
            loops.start("dispatcher", dispatched)
        loops.start(
            "network versions",
            repeat(
                "network versions",
                led(versions.step, begin=versions.forget),
                every_s=_STEP_EVERY_S,
                wake=self._parts.published,
                polls=self._membership.looks,
            ),
        )
