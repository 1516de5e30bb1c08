"""A drone model with round numbers, trips for it, a clock, and a cloud that writes instructions."""

import asyncio
import heapq
import json
from collections.abc import Callable, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any, Self

import pytest
from skyway_drone_agent.enrolment.enrolled_drone import BrokerLogin, EnrolledDrone
from skyway_drone_agent.journal.flight_recorder import FlightRecorder
from skyway_drone_agent.journal.records import Answer
from skyway_drone_agent.messages.inbox import Inbox
from skyway_drone_agent.simulated.vehicle import SimulatedVehicle

from skyway.contracts.flight_step import (
    AwaitedProof,
    DeliverStep,
    FlightStep,
    FlyStep,
    PackageOnBoard,
    PickUpStep,
    RechargeStep,
    ReturnStep,
    WaitStep,
)
from skyway.contracts.instruction import (
    CancelInstruction,
    DivertInstruction,
    HandOverInstruction,
    HoldInstruction,
    MissionInstruction,
    ReportInstruction,
    ResumeInstruction,
    ReturnHomeInstruction,
)
from skyway.contracts.world import ClockAnchor
from skyway.drone.model import ChargePoint, DroneModel
from skyway.geo import Position
from skyway.ids import (
    DroneId,
    DroneModelId,
    PackageId,
    ProviderId,
    StationId,
)
from tests.drone_agent.memory_journal import MemoryJournal

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
        self.is_set = asyncio.Event()
        self.is_set.set()

    def now(self) -> datetime:
        return self._now

    def wall_now(self) -> datetime:
        return self._wall

    def keep(self, anchor: ClockAnchor) -> None:
        """Time is moved by the tests alone."""

    async def wait_until_set(self) -> None:
        await self.is_set.wait()

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


class Cloud:
    """Writes instructions, numbered as composition numbers them."""

    def __init__(self, clock: VirtualClock) -> None:
        self._clock = clock
        self._seq = 0

    def mission(
        self, steps: Sequence[FlightStep], *, revision: int = 1, **other: Any
    ) -> MissionInstruction:
        first_step = steps[0].step_id if steps else 1
        fields = self._of_mission(revision, delivery_id="dlv_1", first_step=first_step)
        return MissionInstruction.model_validate(fields | {"steps": tuple(steps)} | other)

    def divert(
        self, steps: Sequence[FlightStep], *, revision: int = 2, **other: Any
    ) -> DivertInstruction:
        return DivertInstruction.model_validate(self._replacement(steps, revision) | other)

    def return_home(
        self, steps: Sequence[FlightStep], *, revision: int = 2, **other: Any
    ) -> ReturnHomeInstruction:
        return ReturnHomeInstruction.model_validate(self._replacement(steps, revision) | other)

    def hold(self, **other: Any) -> HoldInstruction:
        return HoldInstruction.model_validate(self._of_mission(1, reason="test") | other)

    def hand_over(self, *packages: str, step_id: int = 3, **other: Any) -> HandOverInstruction:
        fields = self._of_mission(1, step_id=step_id, package_ids=packages)
        return HandOverInstruction.model_validate(fields | other)

    def resume(self, **other: Any) -> ResumeInstruction:
        return ResumeInstruction.model_validate(self._of_mission(1) | other)

    def cancel(self, **other: Any) -> CancelInstruction:
        return CancelInstruction.model_validate(self._of_mission(1, reason="test") | other)

    def report_request(self, after_seq: int, **other: Any) -> ReportInstruction:
        fields = self._envelope(events_after_seq=after_seq)
        return ReportInstruction.model_validate(fields | other)

    def _replacement(self, steps: Sequence[FlightStep], revision: int) -> dict[str, Any]:
        return self._of_mission(
            revision,
            delivery_id="dlv_1",
            last_valid_step=steps[0].step_id - 1,
            steps=tuple(steps),
            reason="test",
        )

    def _of_mission(self, revision: int, **fields: Any) -> dict[str, Any]:
        return self._envelope(mission_id="msn_1", mission_revision=revision, **fields)

    def _envelope(self, **fields: Any) -> dict[str, Any]:
        self._seq += 1
        return {
            "message_id": f"msg_{self._seq}",
            "sent_at": self._clock.now(),
            "instruction_id": f"ins_{self._seq}",
            "stream": 1,
            "seq": self._seq,
            "expires_at": self._clock.now() + timedelta(hours=2),
        } | fields


def packages_of(**masses_kg: float) -> tuple[PackageOnBoard, ...]:
    """Packages by their names."""
    return tuple(
        PackageOnBoard(package_id=PackageId(name), mass_kg=mass_kg)
        for name, mass_kg in masses_kg.items()
    )


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

    def pick_up(
        self, station: str, *, awaits_confirmation: bool = False, **masses_kg: float
    ) -> Self:
        self.made.append(
            PickUpStep(
                **self._times(60.0),
                station_id=StationId(station),
                packages=packages_of(**masses_kg),
                awaits_confirmation=awaits_confirmation,
            )
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

    def deliver(
        self, station: str, *packages: str, recipient_wait_s: float = 0.0, **proven_by: str
    ) -> Self:
        """Hand packages over; `proven_by` has the method of each that needs a proof."""
        self.made.append(
            DeliverStep(
                **self._times(30.0),
                station_id=StationId(station),
                package_ids=tuple(PackageId(name) for name in packages),
                dropoff_s=30.0,
                recipient_wait_s=recipient_wait_s,
                verification=tuple(
                    AwaitedProof.model_validate(
                        {
                            "package_id": name,
                            "method": method,
                            "upload_path": f"/up/{name}" if method == "PHOTO" else None,
                        }
                    )
                    for name, method in proven_by.items()
                ),
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


class Desk:
    """An inbox, and what it answered."""

    def __init__(self, drone: EnrolledDrone, clock: VirtualClock, cloud: Cloud) -> None:
        self.cloud = cloud
        self.clock = clock
        self.journal = MemoryJournal()
        self.recorder = FlightRecorder(
            self.journal, drone_id=drone.drone_id, at_first=drone.at_first()
        )
        self.received_ids: list[str] = []
        self.answers: list[Answer] = []
        self.resent_after: list[int] = []
        vehicle = SimulatedVehicle(drone.model, clock)
        self.inbox = Inbox(self.recorder, clock, vehicle=vehicle, answers=self, events=self)

    def received(self, answer: Answer) -> None:
        self.received_ids.append(answer.instruction_id)

    def answered(self, answer: Answer) -> None:
        self.answers.append(answer)

    def resend_after(self, seq: int) -> None:
        self.resent_after.append(seq)

    def send(self, instruction: Any) -> Answer:
        self.inbox.handle(json.loads(instruction.model_dump_json()))
        return self.answers[-1]

    def send_raw(self, instruction: Any, change: Callable[[dict[str, Any]], object]) -> Answer:
        raw = json.loads(instruction.model_dump_json())
        change(raw)
        self.inbox.handle(raw)
        return self.answers[-1]

    def drone_is(self, **changes: Any) -> None:
        self.recorder.logbook = self.recorder.logbook.model_copy(update=changes)


@pytest.fixture
def drone() -> EnrolledDrone:
    """A full drone at home that has never flown."""
    return EnrolledDrone(
        drone_id=DroneId("drn_1"),
        provider_id=ProviderId("prv_1"),
        model=MODEL,
        home_station_id=StationId("home"),
        home_position=POSITIONS["home"],
        soc=1.0,
        mqtt=BrokerLogin(user_name="drn_1", password="secret"),
    )


@pytest.fixture
def virtual_clock() -> VirtualClock:
    """A clock at rate 600 that jumps from one sleeper to the next."""
    return VirtualClock(rate=600.0)


@pytest.fixture
def cloud(virtual_clock: VirtualClock) -> Cloud:
    """Writes instructions for the drone."""
    return Cloud(virtual_clock)


@pytest.fixture
def steps() -> type[Steps]:
    """Builds the steps of a plan."""
    return Steps


@pytest.fixture
def trip() -> list[FlightStep]:
    """The steps of a round trip with two packages."""
    return round_trip().made


@pytest.fixture
def desk(drone: EnrolledDrone, virtual_clock: VirtualClock, cloud: Cloud) -> Desk:
    """An inbox of a drone at home, with the cloud that writes to it."""
    return Desk(drone, virtual_clock, cloud)
