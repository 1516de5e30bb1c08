"""A drone, a broker and a clock in one process, so that a mission takes milliseconds."""

import asyncio
import contextlib
import errno
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from datetime import timedelta
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import pytest
from skyway_drone_agent.agent import DroneAgent, VersionedLandings
from skyway_drone_agent.enrolment.enrolled_drone import EnrolledDrone
from skyway_drone_agent.journal.journal import Journal, JournalUnwritable
from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.journal.records import Record
from skyway_drone_agent.simulated.disturbances import UNDISTURBED
from skyway_drone_agent.simulated.vehicle import SimulatedVehicle

from skyway.contracts.drone_report import Ack, DroneEvent, DroneState
from skyway.contracts.instruction import AnyInstruction
from skyway.contracts.topics import (
    ACKS,
    CLOCK,
    EVENTS,
    INSTRUCTIONS,
    NETWORK_VERSION,
    STATE,
    Address,
    Topic,
)
from skyway.contracts.world import NetworkVersion
from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.mqtt.client import Received, Will
from tests.counting_mint import CountingMint
from tests.drone_agent.memory_journal import MemoryJournal


class FakeLink:
    """A broker connection that tests make and cut; it confirms immediately unless tests stop it."""

    def __init__(
        self, world: "World", will: Will, on_connected: Callable[[], Awaitable[None]]
    ) -> None:
        self._world = world
        self._will = will
        self._on_connected = on_connected
        self._will_now: tuple[Address[Any], Any] | None = None
        self._up = asyncio.Event()
        self._down = asyncio.Event()
        self._arrived: deque[Received[Any]] = deque()
        self._has_news = asyncio.Event()
        self._ticks: asyncio.Queue[Received[Any]] = asyncio.Queue()
        self._versions: asyncio.Queue[Received[Any]] = asyncio.Queue()
        self._greetings: set[asyncio.Future[None]] = set()

    async def __aenter__(self) -> Self:
        if self._world.is_broker_up:
            self.connect()
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
        /,
    ) -> None:
        self._go_down()

    @property
    def is_connected(self) -> bool:
        return self._up.is_set()

    async def wait_connected(self) -> None:
        await self._up.wait()

    async def wait_lost(self) -> None:
        await self._down.wait()

    def connect(self) -> None:
        self._will_now = self._will()
        self._down.clear()
        self._up.set()
        self._greetings.add(asyncio.ensure_future(self._on_connected()))

    def cut(self) -> None:
        if self._up.is_set() and self._will_now is not None:
            self._world.published.append((self._will_now[0].topic, self._will_now[1]))
        self._go_down()

    def _go_down(self) -> None:
        self._up.clear()
        self._down.set()

    async def publish(self, address: Address[Any], message: Any, *, timeout_s: float = 5.0) -> None:
        if not self._up.is_set():
            raise MqttUnavailable("cut")
        self._world.trace.append(f"publish {address.topic.template.rsplit('/', 1)[1]}")
        self._world.published.append((address.topic, message))
        await self._world.pubacks.wait()

    def batches(
        self, *subscriptions: Topic[Any] | Address[Any]
    ) -> AsyncIterator[list[Received[Any]]]:
        (requested,) = subscriptions
        if not isinstance(requested, Address):
            assert requested is NETWORK_VERSION
            return self._one_by_one(self._versions)
        if requested.topic.template == INSTRUCTIONS.template:
            return self._drain(requested.topic)
        return self._one_by_one(self._ticks)

    async def _one_by_one(
        self, queue: asyncio.Queue[Received[Any]]
    ) -> AsyncIterator[list[Received[Any]]]:
        while True:
            yield [await queue.get()]

    def deliver_version(self, message: NetworkVersion) -> None:
        """Deliver a network's version."""
        ids = (message.network_id,)
        self._versions.put_nowait(Received(NETWORK_VERSION, ids, message, True))

    def deliver_time(self, *, retained: bool) -> None:
        """Deliver the clock's anchor; its content does not matter here."""
        self._ticks.put_nowait(Received(CLOCK, (), None, retained))

    async def _drain(self, topic: Topic[Any]) -> AsyncIterator[list[Received[Any]]]:
        while True:
            await self._has_news.wait()
            self._has_news.clear()
            payloads, self._arrived = self._arrived, deque()
            yield [
                Received(topic, one.ids, topic.read(one.message), one.retained) for one in payloads
            ]

    def deliver(self, payload: bytes) -> None:
        self._arrived.append(Received(INSTRUCTIONS, ("prv_1", "drn_1"), payload, False))
        self._has_news.set()


class PowerCut(Exception):
    """The process dies here."""


class MortalJournal:
    """A journal whose process dies at one write: `dies_before` it, or `dies_after` it.

    While the disk `is_full` nothing is written.
    """

    def __init__(self, kept: Journal, trace: list[str]) -> None:
        self._kept = kept
        self._trace = trace
        self.is_full = False
        self.writes = 0
        self.dies_before: int | None = None
        self.dies_after: int | None = None

    def read(self, *, at_first: Logbook) -> Logbook:
        return self._kept.read(at_first=at_first)

    def append(self, records: Sequence[Record]) -> None:
        self._need_room()
        self.writes += 1
        if self.writes == self.dies_before:
            raise PowerCut
        self._kept.append(records)
        self._trace.extend(f"journal {record.kind}" for record in records)
        if self.writes == self.dies_after:
            raise PowerCut

    def compact(self, logbook: Logbook) -> None:
        self._need_room()
        self._kept.compact(logbook)

    def _need_room(self) -> None:
        if self.is_full:
            raise JournalUnwritable(Path("drn_1.jsonl"), OSError(errno.ENOSPC, "full"))


class World:
    """One drone and all around it."""

    def __init__(self, drone: EnrolledDrone, clock: Any) -> None:
        self.drone = drone
        self.clock = clock
        self.disturbances = UNDISTURBED
        self.vehicle_type = SimulatedVehicle
        self.book: VersionedLandings | None = None
        self.mint = CountingMint()
        self.trace: list[str] = []
        self.published: list[tuple[Topic[Any], Any]] = []
        self.journal = MortalJournal(MemoryJournal(), self.trace)
        self.is_broker_up = True
        self.pubacks = asyncio.Event()
        self.pubacks.set()
        self._link: FakeLink | None = None
        self._running: asyncio.Task[None] | None = None

    # The agent's process

    async def start(self) -> None:
        agent = DroneAgent(
            self.drone,
            journal=self.journal,
            vehicle=self.vehicle_type(self.drone.model, self.clock, disturbances=self.disturbances),
            clock=self.clock,
            make_link=self._make_link,
            mint=self.mint,
            book=self.book,
        )
        self._running = asyncio.create_task(agent.run())
        await self.settle()

    def _make_link(self, will: Will, on_connected: Callable[[], Awaitable[None]]) -> FakeLink:
        self._link = FakeLink(self, will, on_connected)
        return self._link

    @property
    def link(self) -> FakeLink:
        assert self._link is not None
        return self._link

    async def kill(self) -> None:
        """As kill -9: no farewell, the broker publishes the last will."""
        self.link.cut()
        await self.stop()

    async def stop(self) -> None:
        if self._running is not None:
            self._running.cancel()
            with contextlib.suppress(asyncio.CancelledError, PowerCut, BaseExceptionGroup):
                await self._running
            self._running = None

    @property
    def has_died(self) -> bool:
        return self._running is not None and self._running.done()

    # Time

    async def settle(self) -> None:
        """Let everything run that can run now."""
        for _ in range(40):
            await asyncio.sleep(0)

    async def pass_time(self, by: timedelta) -> None:
        """Let this span of fleet time pass, sleeper by sleeper."""
        until = self.clock.now() + by
        await self.settle()
        while (moment := self.clock.next_moment()) is not None and moment <= until:
            self.clock.move_to(moment)
            await self.settle()
        self.clock.move_to(until)
        await self.settle()

    async def pass_until(self, claim: Callable[[], bool]) -> None:
        """Let time pass until the claim holds."""
        for _ in range(5_000):
            await self.settle()
            if claim():
                return
            moment = self.clock.next_moment()
            assert moment is not None, "nobody waits for anything any more"
            self.clock.move_to(moment)
        raise AssertionError("the claim never held")

    # What the cloud sends and sees

    async def send(self, instruction: AnyInstruction) -> None:
        self.link.deliver(instruction.model_dump_json().encode())
        await self.settle()

    def _all(self, topic: Topic[Any]) -> list[Any]:
        return [message for known, message in self.published if known is topic]

    @property
    def acks(self) -> list[Ack]:
        return self._all(ACKS)

    @property
    def states(self) -> list[DroneState]:
        return self._all(STATE)

    @property
    def events(self) -> list[DroneEvent]:
        """The events that reached the cloud, each once, by its seq."""
        return [event for _, event in sorted({one.seq: one for one in self._all(EVENTS)}.items())]

    def messages(self, topic: Topic[Any]) -> list[Any]:
        return self._all(topic)

    @property
    def is_over(self) -> bool:
        return any(event.event == "MISSION_ENDED" for event in self.events)


@pytest.fixture
async def world(drone: EnrolledDrone, virtual_clock: Any) -> AsyncIterator[World]:
    """A drone whose agent is not started yet; it is stopped at the end."""
    made = World(drone, virtual_clock)
    yield made
    await made.stop()
