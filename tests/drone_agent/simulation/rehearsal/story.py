"""Stories: one simulated day of a drone from a seed, and how to run it."""

import asyncio
import shutil
import tempfile
from dataclasses import dataclass, field
from datetime import timedelta
from pathlib import Path
from random import Random
from typing import Final

from skyway_drone_agent.agent import DroneAgent
from skyway_drone_agent.simulated.disturbances import Disturbances, changed, read_scenario
from skyway_drone_agent.simulated.link_loss import has_outages, outages

from skyway.contracts.drone_report import DroneEvent
from tests.counting_mint import CountingMint
from tests.drone_agent.simulation.rehearsal.cloud import FakeCloud
from tests.drone_agent.simulation.rehearsal.disk import Crash, Disk, MortalJournal, PowerCut
from tests.drone_agent.simulation.rehearsal.findings import Findings
from tests.drone_agent.simulation.rehearsal.link import Air, DroneLink, Habits
from tests.drone_agent.simulation.rehearsal.low_landings import unsaid
from tests.drone_agent.simulation.rehearsal.places import DRONE
from tests.drone_agent.simulation.rehearsal.plan import Parcel
from tests.drone_agent.simulation.rehearsal.virtual_time import (
    NothingIsWaitedFor,
    VirtualClock,
    run_in,
)
from tests.drone_agent.simulation.rehearsal.whims import Whim, whims_of
from tests.drone_agent.simulation.rehearsal.witness import Witness
from tests.drone_agent.simulation.rehearsal.yard import WatchedVehicle, Yard

#: No story goes on for longer than this (fleet time); whims come in the first hour.
_OVER_WITHIN_S: Final = 12 * 3600.0

#: Wall seconds that a process takes to come again, at least.
_BOOT_S: Final = 1.0

#: What is still to be said once a story is over gets this long (wall time).
_LAST_WORDS_S: Final = 20.0


@dataclass(frozen=True)
class Story:
    """All that a run depends on: the same story is the same run."""

    seed: int
    scenario: str = "calm"
    crashes: tuple[Crash, ...] = ()
    whims: tuple[Whim, ...] | None = None  # None: as the seed has it

    def __str__(self) -> str:
        crashes = " ".join(f"{one.moment}@{one.at_write}" for one in self.crashes)
        return f"seed {self.seed} {self.scenario} {crashes}".strip()


@dataclass
class Ending:
    """How a story went."""

    story: Story
    broken: list[str]
    events: list[DroneEvent]
    reported: list[str]
    writes: int
    step_kinds: list[str] = field(default_factory=list)
    over_at_s: float = 0.0
    is_down: bool = False

    def as_bytes(self) -> bytes:
        """The story as the drone's messages."""
        return b"\n".join(event.model_dump_json().encode() for event in self.events)


def play(story: Story) -> Ending:
    """Run the story to its end, and see what is broken then."""
    folder = Path(tempfile.mkdtemp(prefix="rehearsal-"))
    try:
        stage = Stage(story, folder)
        try:
            run_in(stage.clock, stage.play())
        except NothingIsWaitedFor:
            stage.findings.expect(False, "I5: everything has stopped for ever", stage.cloud.story)
        return stage.ending()
    finally:
        shutil.rmtree(folder)


class Stage:
    """One story under way."""

    def __init__(self, story: Story, folder: Path) -> None:
        luck = Random(story.seed)
        self.story = story
        self.findings = Findings()
        self.clock = VirtualClock(rate=luck.choice((10.0, 20.0, 60.0)))
        self.disk = Disk(folder, DRONE.at_first())
        self.witness = Witness(self.disk, self.findings)
        habits = luck.choice((Habits(), Habits(0.1, 0.2, 2.0), Habits(0.3, 0.3, 6.0)))
        self.air = Air(self.clock, self.witness, habits, Random(luck.random()))
        self.yard = Yard(self._day(luck), self.clock, self.disk, self.findings)
        self.cloud = FakeCloud(self.air, self.findings, _parcels(luck))
        if luck.random() < 0.3:
            self.cloud.await_loading()
        self.remembers = luck.random() < 0.7
        self.whims = whims_of(luck) if story.whims is None else story.whims
        self._mint = CountingMint()
        self._journal: MortalJournal | None = None
        self._agent: asyncio.Task[None] | None = None
        self._crashes = list(story.crashes)
        self.is_off = False

    def _day(self, luck: Random) -> Disturbances:
        day = changed(read_scenario(self.story.scenario), {"seed": self.story.seed})
        if luck.random() < 0.3:
            day = changed(day, {"absent_share": 0.3})
        return day

    # The agent's process

    def _start(self) -> None:
        self.disk.crash = self._crashes.pop(0) if self._crashes else None
        self._journal = MortalJournal(self.disk, self.die)
        agent: DroneAgent | None = None
        try:
            agent = DroneAgent(
                DRONE,
                journal=self._journal,
                vehicle=WatchedVehicle(self.yard, self.clock, remembers=self.remembers),
                clock=self.clock,
                make_link=lambda will, greet: DroneLink(self.air, will, greet),
                mint=self._mint,
            )
        except PowerCut:
            self._agent = asyncio.get_running_loop().create_task(_nothing())
            return
        self._agent = asyncio.get_running_loop().create_task(agent.run())

    def die(self) -> None:
        """Like kill -9 or a power cut: no goodbye, and unsynced data is lost."""
        self.clock.note_absence()
        if self._journal is not None:
            self._journal.die()
        if self.air.link is not None:
            self.air.link.die()
        self.disk.lose_power()

    async def kill(self, *, down_s: float) -> None:
        """End the process; the next one starts after a while."""
        self.die()
        if self._agent is not None:
            self._agent.cancel()

    async def _keep_alive(self) -> None:
        """Start the agent again after each expected crash."""
        while True:
            down_s = self.disk.crash.down_s if self.disk.crash else 20.0
            self._start()
            assert self._agent is not None
            await asyncio.wait([self._agent])
            if not self._agent.cancelled():
                self._look_into(self._agent.exception())
            self.die()
            await self.clock.sleep(max(down_s, _BOOT_S * self.clock.rate))

    def _look_into(self, error: BaseException | None) -> None:
        if error is None or _is_power_cut(error):
            return
        self.findings.expect(False, "the agent has died", repr(_first(error)))

    # The play

    async def play(self) -> None:
        loop = asyncio.get_running_loop()
        parts = [
            self._keep_alive(),
            self.cloud.run(),
            self.cloud.mail.repeat(),
            self.cloud.deliver_time(),
            self._lose_link(),
            *(whim.befall(self) for whim in self.whims),
        ]
        tasks = [loop.create_task(part) for part in parts]
        try:
            await self._wait_over()
        finally:
            if self._agent is not None:
                tasks.append(self._agent)
            for task in tasks:
                task.cancel()
            results = await asyncio.gather(*tasks, return_exceptions=True)
        for result in results:
            if isinstance(result, Exception) and not _is_power_cut(result):
                raise result
        self.yard.end()

    async def _wait_over(self) -> None:
        """Wait until all missions are over and reported, or the story takes too long."""
        while self.clock.elapsed_s < _OVER_WITHIN_S:
            await self.clock.sleep_wall(2.0)
            if self.cloud.is_over and self.cloud.mail.is_empty:
                await self.clock.sleep_wall(_LAST_WORDS_S)
                return
        self.findings.expect(
            False, "I5: the story never ended", (self.cloud.story[-8:], self.disk.kept.mission)
        )

    async def _lose_link(self) -> None:
        """As the scenario says."""
        disturbed = self.yard.physics.disturbances
        if not has_outages(disturbed, DRONE.drone_id):
            return
        first = self.clock.wall_now()
        for outage in outages(first, disturbed=disturbed, drone_id=DRONE.drone_id):
            for moment, is_up in ((outage.from_at, False), (outage.until_at, True)):
                left = moment - self.clock.wall_now()
                await self.clock.sleep_wall(max(timedelta(0), left).total_seconds())
                self.air.set_reception(is_up)

    def ending(self) -> Ending:
        self._check_custody()
        if not self.yard.has_worn_battery:
            for event in unsaid(self.witness.events, self.clock.absences):
                self.findings.expect(False, "I10: landed below the reserve without a word", event)
        return Ending(
            story=self.story,
            broken=self.findings.broken,
            events=self.witness.events,
            reported=self.cloud.story,
            writes=self.disk.writes,
            step_kinds=self.yard.kinds_begun,
            over_at_s=self.clock.elapsed_s,
            is_down=self.cloud.is_down,
        )

    def _check_custody(self) -> None:
        """Check that the packages are where the drone has reported them."""
        is_unknown = any(event.code == "UNKNOWN" for event in self.witness.events)
        for package_id, reported in self.cloud.places.items():
            true = self.yard.places.get(package_id, "pickup")
            self.findings.expect(
                reported == true or is_unknown, "I6: custody", (package_id, reported, true)
            )


async def _nothing() -> None:
    return


def _parcels(luck: Random) -> list[Parcel]:
    names = luck.sample(["mill", "shop", "farm", "lake"], luck.choice((1, 2, 2, 3)))
    return [
        Parcel(f"p{number}", luck.choice((0.3, 0.5, 0.6)), name)
        for number, name in enumerate(names, 1)
    ]


def _is_power_cut(error: BaseException) -> bool:
    if isinstance(error, BaseExceptionGroup):
        return all(_is_power_cut(one) for one in error.exceptions)
    return isinstance(error, PowerCut | asyncio.CancelledError)


def _first(error: BaseException) -> BaseException:
    while isinstance(error, BaseExceptionGroup):
        others = [one for one in error.exceptions if not _is_power_cut(one)]
        error = others[0]
    return error
