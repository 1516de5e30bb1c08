"""A drone of a busy world: the real agent with a link and a clock that tests control."""

import asyncio
import contextlib
import json
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from datetime import datetime
from types import TracebackType
from typing import Any, Self

from skyway_drone_agent.agent import DroneAgent
from skyway_drone_agent.enrolment.enrolled_drone import BrokerLogin, EnrolledDrone
from skyway_drone_agent.journal.logbook import Logbook, run_under_way
from skyway_drone_agent.journal.record_effects import logbook_after
from skyway_drone_agent.journal.records import EventRecorded, Placed, Record
from skyway_drone_agent.simulated.disturbances import UNDISTURBED
from skyway_drone_agent.simulated.physics import Physics
from skyway_drone_agent.simulated.vehicle import SimulatedVehicle
from skyway_drone_agent.vehicle import StepRun

from skyway.contracts.candidate import Candidate
from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import (
    DeliverStep,
    FlyStep,
    PickUpStep,
    RechargeStep,
    ReturnStep,
)
from skyway.contracts.topics import ACKS, CONNECTION, EVENTS, INSTRUCTIONS, STATE, Address, Topic
from skyway.contracts.world import ClockAnchor
from skyway.delivery.offer import Tariff
from skyway.drone.learned_values import AS_MODELLED
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import DroneId, ProviderId, StationId
from skyway.runtime.clock import ManualClock
from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.mqtt.client import Received, Will
from tests.counting_mint import CountingMint

#: The topics of drones that composition reads.
_READ_TOPICS = (ACKS.template, EVENTS.template, STATE.template, CONNECTION.template)


class SharedClock:
    """A manual clock that all drones share."""

    def __init__(self, clock: ManualClock) -> None:
        self._clock = clock
        self.rate = clock.rate

    def now(self) -> datetime:
        return self._clock.now()

    def wall_now(self) -> datetime:
        return self._clock.wall_now()

    async def sleep_until(self, fleet_moment: datetime) -> None:
        await self._clock.sleep_until(fleet_moment)

    def keep(self, anchor: ClockAnchor) -> None:
        raise AssertionError(f"unexpected clock anchor: {anchor}")

    async def wait_until_set(self) -> None:
        return


class HandheldLink:
    """A connection to the broker that the test makes and cuts."""

    def __init__(
        self, drone: "FlownDrone", will: Will, on_connected: Callable[[], Awaitable[None]]
    ) -> None:
        self._drone = drone
        self._will = will
        self._on_connected = on_connected
        self._will_now: tuple[Address[Any], Any] | None = None
        self._up = asyncio.Event()
        self._down = asyncio.Event()
        self._down.set()
        self._arrived: deque[Received[Any]] = deque()
        self._has_news = asyncio.Event()
        self._greetings: set[asyncio.Future[None]] = set()

    async def __aenter__(self) -> Self:
        if self._drone.has_reception:
            self.connect()
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
        /,
    ) -> None:
        self._up.clear()

    @property
    def is_connected(self) -> bool:
        return self._up.is_set()

    async def wait_connected(self) -> None:
        await self._up.wait()

    async def wait_lost(self) -> None:
        await self._down.wait()

    def connect(self) -> None:
        if not self._up.is_set():
            self._will_now = self._will()
            self._up.set()
            self._down.clear()
            self._greetings.add(asyncio.ensure_future(self._on_connected()))

    def cut(self) -> None:
        if self._up.is_set() and self._will_now is not None:
            self._drone.emit(self._will_now[0].topic, self._will_now[1])
        self._up.clear()
        self._down.set()

    async def publish(self, address: Address[Any], message: Any, *, timeout_s: float = 5.0) -> None:
        if not self._up.is_set():
            raise MqttUnavailable("cut")
        self._drone.emit(address.topic, message)

    def batches(
        self, *subscriptions: Topic[Any] | Address[Any]
    ) -> AsyncIterator[list[Received[Any]]]:
        (address,) = subscriptions
        assert isinstance(address, Address)
        topic = address.topic
        return self._drain(topic) if topic.template == INSTRUCTIONS.template else _silence()

    async def _drain(self, topic: Topic[Any]) -> AsyncIterator[list[Received[Any]]]:
        while True:
            await self._has_news.wait()
            self._has_news.clear()
            arrived, self._arrived = self._arrived, deque()
            yield [
                Received(topic, one.ids, topic.read(one.message), one.retained) for one in arrived
            ]

    def deliver(self, payload: bytes) -> None:
        self._arrived.append(Received(INSTRUCTIONS, self._drone.ids, payload, False))
        self._has_news.set()


async def _silence() -> AsyncIterator[list[Received[Any]]]:
    await asyncio.Event().wait()
    yield []


class OpenJournal:
    """A journal in memory with its present logbook and all events that ever happened."""

    def __init__(self, at_first: Logbook) -> None:
        self.logbook = at_first
        self.happened: list[DroneEvent] = []

    def read(self, *, at_first: Logbook) -> Logbook:
        return self.logbook

    def append(self, records: Sequence[Record]) -> None:
        for record in records:
            self.logbook = logbook_after(self.logbook, record)
            if isinstance(record, EventRecorded):
                self.happened.append(record.event)

    def compact(self, logbook: Logbook) -> None:
        self.logbook = logbook

    def lose(self, at_first: Logbook) -> None:
        """Forget everything except where the drone is."""
        old = self.logbook
        self.logbook = at_first.model_copy(
            update={
                "session": old.session,
                "station_id": old.station_id,
                "position": old.position,
                "soc": old.soc,
            }
        )


class _Forgetful(SimulatedVehicle):
    """A vehicle that forgets at a restart what it did before."""

    def recall(self, run: StepRun) -> bool | None:
        return None


class FlownDrone:
    """A drone with its agent, its journal, and its messages that were not handled yet."""

    def __init__(
        self,
        drone_id: str,
        *,
        model: DroneModel,
        home: str,
        position: Position,
        clock: ManualClock,
        provider_id: str = "prv_1",
    ) -> None:
        self.drone = EnrolledDrone(
            drone_id=DroneId(drone_id),
            provider_id=ProviderId(provider_id),
            model=model,
            home_station_id=StationId(home),
            home_position=position,
            soc=1.0,
            mqtt=BrokerLogin(user_name=drone_id, password="secret"),
        )
        self.ids = (str(self.drone.provider_id), drone_id)
        self.clock = SharedClock(clock)
        self.disturbances = UNDISTURBED
        #: What the registry has learned about it.
        self.learned = AS_MODELLED
        self.has_reception = True
        self.journal = OpenJournal(self.drone.at_first())
        self.unsent: list[Received[Any]] = []
        self.refuses_next = False
        #: After a restart the drone cannot know whether a hand-over was done.
        self.is_forgetful = False
        #: Its messages are delayed; instructions to it are dropped.
        self.is_held_back = self.drops_instructions = False
        self._mint = CountingMint()
        self._link: HandheldLink | None = None
        self._running: asyncio.Task[None] | None = None

    @property
    def drone_id(self) -> DroneId:
        return self.drone.drone_id

    @property
    def logbook(self) -> Logbook:
        return self.journal.logbook

    def candidate(self, *, loading: str = "AUTOMATIC") -> Candidate:
        """The drone as the registry names it."""
        return Candidate.model_validate(
            {
                "provider_id": self.drone.provider_id,
                "drone_id": self.drone_id,
                "model": self.drone.model,
                "soc": self.logbook.soc,
                # Where a drone with missions begins the next one, its calendar says.
                "station_id": self.logbook.station_id or self.drone.home_station_id,
                "home_station_id": self.drone.home_station_id,
                "tariff": Tariff(base=100, per_km=10, pooled_factor=0.7),
                "loading": loading,
                "learned": self.learned,
            }
        )

    def emit(self, topic: Topic[Any], message: Any) -> None:
        if topic.template in _READ_TOPICS:
            self.unsent.append(Received(topic, self.ids, message, False))

    def receive_instruction(self, payload: bytes) -> None:
        """Receive an instruction if connected; `refuses_next` makes it unreadable."""
        if self._link is None or not self._link.is_connected:
            return
        content = json.loads(payload)
        if self.refuses_next and content.get("steps"):
            self.refuses_next = False
            content["steps"][0]["kind"] = "LOOP_THE_LOOP"
        self._link.deliver(json.dumps(content).encode())

    async def start(self) -> None:
        kind = _Forgetful if self.is_forgetful else SimulatedVehicle
        vehicle = kind(
            self.drone.model, self.clock, disturbances=self.disturbances, drone_id=self.drone_id
        )
        agent = DroneAgent(
            self.drone,
            journal=self.journal,
            vehicle=vehicle,
            clock=self.clock,
            make_link=self._make_link,
            mint=self._mint,
        )
        self._running = asyncio.create_task(agent.run())

    async def stop(self) -> None:
        """Stop as with kill -9: the broker publishes the last will, and the journal stays."""
        if self._running is None:
            return
        if self._link is not None:
            self._link.cut()
        self._running.cancel()
        with contextlib.suppress(asyncio.CancelledError, BaseExceptionGroup):
            await self._running
        self._running = None

    async def restart(self, *, with_journal: bool) -> None:
        await self.stop()
        if not with_journal:
            self.journal.lose(self.drone.at_first())
        await self.start()

    async def fetch(self, station_id: str, position: Position) -> None:
        """Carry a drone that landed in the open to a station."""
        await self.stop()
        self.journal.append([Placed(station_id=StationId(station_id), position=position)])
        await self.start()

    @property
    def may_fail_any_time(self) -> bool:
        """Whether a failure may occur at any moment."""
        run = run_under_way(self.logbook)
        is_short = run is not None and isinstance(run.step, FlyStep | RechargeStep)
        return is_short and self.disturbances != UNDISTURBED

    @property
    def is_handing_over(self) -> bool:
        """Whether a hand-over is under way."""
        run = run_under_way(self.logbook)
        if run is None or getattr(run.step, "awaits_confirmation", False):
            return False
        return isinstance(run.step, PickUpStep | DeliverStep | ReturnStep)

    def set_reception(self, has_reception: bool) -> None:
        self.has_reception = has_reception
        if self._link is not None:
            (self._link.connect if has_reception else self._link.cut)()

    def next_end(self) -> datetime | None:
        """When the step under way ends by itself."""
        run = run_under_way(self.logbook)
        if run is None or getattr(run.step, "awaits_confirmation", False):
            return None
        physics = Physics(self.drone.model, self.disturbances, drone_id=self.drone_id)
        return physics.outcome_of(run).ended_at

    def next_begin(self) -> datetime | None:
        """When the next step may begin."""
        mission = self.logbook.mission
        if mission is None or not mission.steps or mission.began_at is not None:
            return None
        return max(mission.free_at, mission.steps[0].planned_start_at)

    def raise_agent_error(self) -> None:
        """Raise the error that has ended the agent, if there is one."""
        if self._running is not None and self._running.done():
            self._running.result()

    def _make_link(self, will: Will, on_connected: Callable[[], Awaitable[None]]) -> HandheldLink:
        self._link = HandheldLink(self, will, on_connected)
        return self._link


class SilentSubscriber:
    """`Subscriber` on which nothing arrives."""

    async def batches(self, *_: Topic[Any], **__: Any) -> AsyncIterator[list[Received[Any]]]:
        await asyncio.Event().wait()
        yield []
