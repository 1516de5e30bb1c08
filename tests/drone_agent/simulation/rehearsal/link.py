"""The link between a drone and its cloud: it loses, repeats, delays and swaps messages."""

import asyncio
import json
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from dataclasses import dataclass
from random import Random
from types import TracebackType
from typing import Any, Self

from skyway.contracts.topics import CLOCK, Address, Topic
from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.mqtt.client import Received, Will
from tests.drone_agent.simulation.rehearsal.virtual_time import VirtualClock
from tests.drone_agent.simulation.rehearsal.witness import Witness

#: Where a drone's messages go.
Listener = Callable[[Topic[Any], Any], None]


@dataclass(frozen=True, slots=True)
class Habits:
    """How bad the link is: chances per message, delays in wall seconds."""

    loss: float = 0.0
    repetition: float = 0.0
    longest_delay_s: float = 0.0


class Air:
    """The broker and the radio between; it outlives the drone's processes."""

    def __init__(self, clock: VirtualClock, witness: Witness, habits: Habits, luck: Random) -> None:
        self.clock = clock
        self.witness = witness
        self.habits = habits
        self.luck = luck
        self.is_up = True
        self.listener: Listener = lambda topic, message: None
        self.link: DroneLink | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    def spawn(self, coroutine: Coroutine[Any, Any, None]) -> None:
        task = asyncio.get_running_loop().create_task(coroutine)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def copies(self) -> int:
        """How often the next message arrives."""
        if self.luck.random() < self.habits.loss:
            return 0
        return 2 if self.luck.random() < self.habits.repetition else 1

    def carry(self, deliver: Callable[[], None]) -> None:
        """Call after a delay of chance, once, twice or never."""
        for _ in range(self.copies()):
            self.spawn(self._deliver(deliver, self.luck.uniform(0, self.habits.longest_delay_s)))

    async def _deliver(self, deliver: Callable[[], None], delay_s: float) -> None:
        await self.clock.sleep_wall(delay_s)
        deliver()

    def publish(self, topic: Topic[Any], message: Any) -> None:
        """The broker has the message; the cloud gets it at least once, at some time."""
        self.witness.receive(topic, message)
        copies = max(1, self.copies())
        for _ in range(copies):
            delay_s = self.luck.uniform(0, self.habits.longest_delay_s)
            self.spawn(self._deliver(lambda: self.listener(topic, message), delay_s))

    def instruct(self, payload: bytes) -> None:
        """On the way to the drone."""
        self.carry(lambda: self._arrive(payload))

    def _arrive(self, payload: bytes) -> None:
        if self.link is not None:
            self.link.deliver(payload)

    def deliver_time(self) -> None:
        if self.link is not None:
            self.link.deliver_time()

    def set_reception(self, is_up: bool) -> None:
        self.is_up = is_up
        if self.link is not None:
            (self.link.connect if is_up else self.link.cut)()


class DroneLink:
    """One process's connection to the broker."""

    def __init__(self, air: Air, will: Will, on_connected: Callable[[], Awaitable[None]]) -> None:
        self._air = air
        self._will = will
        self._on_connected = on_connected
        self._will_now: tuple[Address[Any], Any] | None = None
        self._up = asyncio.Event()
        self._down = asyncio.Event()
        self._down.set()
        self._instructions: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self._ticks: asyncio.Queue[Received[Any]] = asyncio.Queue()
        self._is_dead = False
        air.link = self

    async def __aenter__(self) -> Self:
        if self._air.is_up:
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
        if not self._up.is_set() and not self._is_dead:
            self._will_now = self._will()
            self._down.clear()
            self._up.set()
            self._air.spawn(self._greet())

    async def _greet(self) -> None:
        await self._on_connected()

    def cut(self) -> None:
        if self._up.is_set() and self._will_now is not None:
            self._air.publish(self._will_now[0].topic, self._will_now[1])
        self._go_down()

    def die(self) -> None:
        """The process behind it is gone."""
        self.cut()
        self._is_dead = True

    def _go_down(self) -> None:
        self._up.clear()
        self._down.set()

    async def publish(self, address: Address[Any], message: Any, *, timeout_s: float = 5.0) -> None:
        air = self._air
        if not self._up.is_set() or air.luck.random() < air.habits.loss:
            raise MqttUnavailable("cut")
        air.publish(address.topic, message)
        await air.clock.sleep_wall(air.luck.uniform(0.0, 0.1))
        if not self._up.is_set() or air.luck.random() < air.habits.loss:
            raise MqttUnavailable("no PUBACK")

    def batches(
        self, *subscriptions: Topic[Any] | Address[Any]
    ) -> AsyncIterator[list[Received[Any]]]:
        (address,) = subscriptions
        assert isinstance(address, Address)
        is_clock = address.topic.template == CLOCK.template
        return self._anchors() if is_clock else self._received(address)

    async def _anchors(self) -> AsyncIterator[list[Received[Any]]]:
        while True:
            yield [await self._ticks.get()]

    async def _received(self, address: Address[Any]) -> AsyncIterator[list[Received[Any]]]:
        while True:
            yield [Received(address.topic, (), await self._instructions.get(), False)]

    def deliver(self, payload: bytes) -> None:
        if self._up.is_set():
            self._instructions.put_nowait(json.loads(payload))

    def deliver_time(self) -> None:
        """Deliver the clock's anchor again; its content does not matter here."""
        if self._up.is_set():
            self._ticks.put_nowait(Received(CLOCK, (), None, False))
