"""A drone, a broker, a cloud and a clock in one process, so that a mission takes milliseconds."""

import asyncio
import contextlib
import heapq
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from datetime import UTC, datetime, timedelta
from types import TracebackType
from typing import Any, Self

import pytest
from skyway_drone_agent.agent import DroneAgent
from skyway_drone_agent.enrolled_drone import BrokerLogin, EnrolledDrone
from skyway_drone_agent.journal import Journal
from skyway_drone_agent.logbook import Logbook
from skyway_drone_agent.memory_journal import MemoryJournal
from skyway_drone_agent.records import Record
from skyway_drone_agent.simulated_vehicle import SimulatedVehicle

from skyway.contracts.drone_report import Ack, DroneEvent, DroneState
from skyway.contracts.flight_step import (
    DeliverStep,
    FlightStep,
    FlyStep,
    PackageOnBoard,
    PickUpStep,
    RechargeStep,
    ReturnStep,
    WaitStep,
)
from skyway.contracts.instruction import MissionInstruction, ReportInstruction
from skyway.contracts.topic import Address, Topic
from skyway.contracts.topics import ACKS, EVENTS, INSTRUCTIONS, STATE
from skyway.contracts.world import ClockAnchor
from skyway.drone.model import ChargePoint, DroneModel
from skyway.geo import Position
from skyway.ids import (
    DeliveryId,
    DroneId,
    DroneModelId,
    InstructionId,
    MissionId,
    PackageId,
    ProviderId,
    StationId,
)
from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.minting import CountingMint
from skyway.runtime.mqtt import Received, Will

START = datetime(2026, 3, 1, 12, tzinfo=UTC)

#: 15 m/s with 1 kg, 17.5 with 0.5, 20 without; full after two hours, 80 % after one.
MODEL = DroneModel(
    model_id=DroneModelId("test"),
    empty_mass_kg=4.0,
    max_payload_kg=2.0,
    battery_j=360_000.0,
    reserve_soc=0.1,
    speed_empty_mps=20.0,
    speed_full_mps=10.0,
    power_empty_w=100.0,
    stop_s=30.0,
    stop_j=1_000.0,
    charge_curve=(ChargePoint(0, 0), ChargePoint(3600, 0.8), ChargePoint(7200, 1.0)),
)

#: What is left of a full battery after 12 km with 1 kg and one landing.
SOC_AT_SHOP = 1.0 - (2 * 6000 / 15 * 100 * 1.25**1.5 + 1_000) / 360_000

POSITIONS = {
    name: Position(longitude, 30.0)
    for name, longitude in {"home": -98.0, "over": -97.9, "shop": -97.8, "farm": -97.7}.items()
}


class VirtualClock:
    """Fleet time that jumps from one sleeper to the next."""

    def __init__(self, rate: float) -> None:
        self.rate = rate
        self._now = self._wall = START
        self._sleepers: list[tuple[datetime, int, asyncio.Future[None]]] = []
        self._count = 0

    def now(self) -> datetime:
        return self._now

    def wall_now(self) -> datetime:
        return self._wall

    def keep(self, anchor: ClockAnchor) -> None:
        raise AssertionError(f"nobody tells the time here: {anchor}")

    async def wait_known(self) -> None:
        return

    async def sleep_until(self, fleet_moment: datetime) -> None:
        if fleet_moment <= self._now:
            return
        awake: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._count += 1
        heapq.heappush(self._sleepers, (fleet_moment, self._count, awake))
        await awake

    def next_moment(self) -> datetime | None:
        while self._sleepers and self._sleepers[0][2].done():
            heapq.heappop(self._sleepers)
        return self._sleepers[0][0] if self._sleepers else None

    def move_to(self, moment: datetime) -> None:
        self._wall += (moment - self._now) / self.rate
        self._now = moment
        while self._sleepers and self._sleepers[0][0] <= moment:
            awake = heapq.heappop(self._sleepers)[2]
            if not awake.done():
                awake.set_result(None)


class FakeLink:
    """A broker connection that tests make and cut; it acknowledges at once unless told not to."""

    def __init__(
        self, world: "World", will: Will, on_connected: Callable[[], Awaitable[None]]
    ) -> None:
        self._world = world
        self._will = will
        self._on_connected = on_connected
        self._will_now: tuple[Address[Any], Any] | None = None
        self._up = asyncio.Event()
        self._arrived: deque[Received[Any]] = deque()
        self._has_news = asyncio.Event()
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
        self._up.clear()

    @property
    def is_connected(self) -> bool:
        return self._up.is_set()

    async def wait_connected(self) -> None:
        await self._up.wait()

    def connect(self) -> None:
        self._will_now = self._will()
        self._up.set()
        self._greetings.add(asyncio.ensure_future(self._on_connected()))

    def cut(self) -> None:
        if self._up.is_set() and self._will_now is not None:
            self._world.published.append((self._will_now[0].topic, self._will_now[1]))
        self._up.clear()

    async def publish(self, address: Address[Any], message: Any, *, timeout_s: float = 5.0) -> None:
        if not self._up.is_set():
            raise MqttUnavailable("cut")
        self._world.trace.append(f"publish {address.topic.template.rsplit('/', 1)[1]}")
        self._world.published.append((address.topic, message))
        await self._world.pubacks.wait()

    def batches(
        self, *subscriptions: Topic[Any] | Address[Any]
    ) -> AsyncIterator[list[Received[Any]]]:
        (address,) = subscriptions
        assert isinstance(address, Address)
        topic = address.topic
        return self._drain(topic) if topic.template == INSTRUCTIONS.template else self._silence()

    async def _silence(self) -> AsyncIterator[list[Received[Any]]]:
        await asyncio.Event().wait()
        yield []

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
    """A journal whose process dies at one write: `dies_before` it, or `dies_after` it."""

    def __init__(self, kept: Journal, trace: list[str]) -> None:
        self._kept = kept
        self._trace = trace
        self.writes = 0
        self.dies_before: int | None = None
        self.dies_after: int | None = None

    def read(self, *, at_first: Logbook) -> Logbook:
        return self._kept.read(at_first=at_first)

    def append(self, records: Sequence[Record]) -> None:
        self.writes += 1
        if self.writes == self.dies_before:
            raise PowerCut
        self._kept.append(records)
        self._trace.extend(f"journal {record.kind}" for record in records)
        if self.writes == self.dies_after:
            raise PowerCut

    def compact(self, logbook: Logbook) -> None:
        self._kept.compact(logbook)


class World:
    """One drone and all around it."""

    def __init__(self, rate: float = 600.0) -> None:
        self.clock = VirtualClock(rate)
        self.trace: list[str] = []
        self.published: list[tuple[Topic[Any], Any]] = []
        self.journal = MortalJournal(MemoryJournal(), self.trace)
        self.is_broker_up = True
        self.pubacks = asyncio.Event()
        self.pubacks.set()
        self._seq = 0
        self._link: FakeLink | None = None
        self._running: asyncio.Task[None] | None = None
        self.drone = EnrolledDrone(
            drone_id=DroneId("drn_1"),
            provider_id=ProviderId("prv_1"),
            model=MODEL,
            home_station_id=StationId("home"),
            home_position=POSITIONS["home"],
            soc=1.0,
            mqtt=BrokerLogin(user_name="drn_1", password="secret"),
        )
        self.mint = CountingMint()

    # The agent's process

    async def start(self) -> None:
        agent = DroneAgent(
            self.drone,
            journal=self.journal,
            vehicle=SimulatedVehicle(MODEL, self.clock),
            clock=self.clock,
            make_link=self._make_link,
            mint=self.mint,
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

    # The cloud

    def mission(
        self,
        steps: Sequence[FlightStep],
        *,
        revision: int = 1,
        mission_id: str = "msn_1",
        **other: Any,
    ) -> MissionInstruction:
        self._seq += 1
        fields: dict[str, Any] = {
            "message_id": f"msg_{self._seq}",
            "sent_at": self.clock.now(),
            "instruction_id": InstructionId(f"ins_{self._seq}"),
            "stream": 1,
            "seq": self._seq,
            "expires_at": self.clock.now() + timedelta(hours=2),
            "mission_id": MissionId(mission_id),
            "mission_revision": revision,
            "delivery_id": DeliveryId("dlv_1"),
            "first_step": steps[0].step_id if steps else 1,
            "steps": tuple(steps),
        }
        return MissionInstruction.model_validate(fields | other)

    def report_request(self, after_seq: int, **other: Any) -> ReportInstruction:
        self._seq += 1
        fields: dict[str, Any] = {
            "message_id": f"msg_{self._seq}",
            "sent_at": self.clock.now(),
            "instruction_id": InstructionId(f"ins_{self._seq}"),
            "stream": 1,
            "seq": self._seq,
            "expires_at": self.clock.now() + timedelta(hours=2),
            "events_after_seq": after_seq,
        }
        return ReportInstruction.model_validate(fields | other)

    async def send(self, instruction: MissionInstruction | ReportInstruction) -> None:
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
        """What the cloud knows: each event once, by its seq."""
        return [event for _, event in sorted({one.seq: one for one in self._all(EVENTS)}.items())]

    def messages(self, topic: Topic[Any]) -> list[Any]:
        return self._all(topic)

    @property
    def is_over(self) -> bool:
        return any(event.event == "MISSION_ENDED" for event in self.events)


class Steps:
    """Builds the steps of a plan one behind the other, from `at` on."""

    def __init__(self, at: datetime = START + timedelta(minutes=10), first_step: int = 1) -> None:
        self.at = at
        self._next_id = first_step
        self.made: list[FlightStep] = []

    def _times(self, duration_s: float) -> dict[str, Any]:
        times = {
            "step_id": self._next_id,
            "planned_start_at": self.at,
            "planned_end_at": self.at + timedelta(seconds=duration_s),
        }
        self._next_id += 1
        self.at += timedelta(seconds=duration_s)
        return times

    def pick_up(self, station: str, **masses_kg: float) -> Self:
        packages = tuple(
            PackageOnBoard(package_id=PackageId(name), mass_kg=mass_kg)
            for name, mass_kg in masses_kg.items()
        )
        self.made.append(
            PickUpStep(**self._times(60.0), station_id=StationId(station), packages=packages)
        )
        return self

    def fly(
        self, start: str, end: str, *, length_m: float, duration_s: float, lands: bool = True
    ) -> Self:
        self.made.append(
            FlyStep(
                **self._times(duration_s),
                from_id=StationId(start),
                to_id=StationId(end),
                from_position=POSITIONS[start],
                to_position=POSITIONS[end],
                length_m=length_m,
                lands=lands,
            )
        )
        return self

    def wait(self, station: str, *, duration_s: float) -> Self:
        times = self._times(duration_s)
        self.made.append(WaitStep(**times, station_id=StationId(station), until_at=self.at))
        return self

    def recharge(
        self, station: str, *, until_soc: float, duration_s: float, spare_s: float = 0.0
    ) -> Self:
        times = self._times(duration_s)
        self.made.append(
            RechargeStep(
                **times,
                station_id=StationId(station),
                pad=0,
                not_before_at=times["planned_start_at"],
                until_soc=until_soc,
                not_after_at=self.at + timedelta(seconds=spare_s),
            )
        )
        return self

    def deliver(self, station: str, *packages: str) -> Self:
        self.made.append(
            DeliverStep(
                **self._times(30.0),
                station_id=StationId(station),
                package_ids=tuple(PackageId(name) for name in packages),
                dropoff_s=30.0,
            )
        )
        return self

    def bring_back(self, station: str, *packages: str) -> Self:
        self.made.append(
            ReturnStep(
                **self._times(45.0),
                station_id=StationId(station),
                package_ids=tuple(PackageId(name) for name in packages),
            )
        )
        return self


def round_trip() -> Steps:
    """Two packages, a station flown over, a recharge on the way, and home; 8 steps, on time."""
    return (
        Steps()
        .pick_up("home", p1=0.5, p2=0.5)
        .fly("home", "over", length_m=6000, duration_s=400, lands=False)
        .fly("over", "shop", length_m=6000, duration_s=430)
        .deliver("shop", "p1")
        .recharge("shop", until_soc=SOC_AT_SHOP + 330 * 0.8 / 3600, duration_s=330)
        .fly("shop", "farm", length_m=7000, duration_s=430)
        .deliver("farm", "p2")
        .fly("farm", "home", length_m=8000, duration_s=430)
    )


@pytest.fixture
async def world() -> AsyncIterator[World]:
    """A drone whose agent is not started yet; it is stopped at the end."""
    made = World()
    yield made
    await made.stop()


@pytest.fixture
def steps() -> type[Steps]:
    """Builds the steps of a plan."""
    return Steps


@pytest.fixture
def trip() -> list[FlightStep]:
    """The steps of a round trip with two packages."""
    return round_trip().made
