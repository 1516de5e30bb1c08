"""Whims: random disruptions of a drone by people, weather and computers."""

from dataclasses import dataclass
from random import Random
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tests.drone_agent.simulation.rehearsal.story import Stage

#: What may befall a story, the frequent ones more than once.
KINDS = (
    "HOLD",
    "HOLD",
    "DIVERT",
    "DIVERT",
    "RETURN_HOME",
    "OVERRIDE",
    "CANCEL",
    "REPORT",
    "KILL",
    "KILL",
    "KILL_IN_STEP",
    "KILL_IN_STEP",
    "LINK_DOWN",
    "LINK_DOWN",
    "DISK_FULL",
    "DISK_FULL",
    "CLOUD_SILENT",
    "CLOCK_SET_ON",
    "COMPUTER_SLEEPS",
    "WALL_SET_BACK",
)

#: Fleet seconds in which whims come.
_FIRST_S, _LAST_S = 5.0, 2400.0


@dataclass(frozen=True, slots=True)
class Whim:
    """A disruption that begins after `at_s` fleet seconds and lasts `for_s`, if it lasts.

    A KILL_IN_STEP comes `for_s` after the first step of the `step_kind` that begins after `at_s`.
    """

    kind: str
    at_s: float
    for_s: float = 60.0
    step_kind: str = "FLY"

    async def befall(self, stage: "Stage") -> None:
        """Let it happen."""
        clock = stage.clock
        await clock.sleep(self.at_s)
        cloud, air = stage.cloud, stage.air
        match self.kind:
            case "HOLD":
                cloud.hold()
                await clock.sleep(self.for_s)
                cloud.resume()
            case "DIVERT":
                cloud.divert()
            case "RETURN_HOME":
                cloud.return_home()
            case "OVERRIDE":
                cloud.return_home(overrides=True)
            case "CANCEL":
                cloud.cancel()
            case "REPORT":
                cloud.request_report()
            case "KILL":
                await stage.kill(down_s=self.for_s)
            case "KILL_IN_STEP":
                await self._kill_in_step(stage)
            case "LINK_DOWN":
                air.set_reception(False)
                await clock.sleep(self.for_s)
                air.set_reception(True)
            case "DISK_FULL":
                stage.disk.is_full = True
                await clock.sleep(self.for_s)
                stage.disk.is_full = False
            case "CLOUD_SILENT":
                cloud.mail.is_silent = True
                await clock.sleep(10 * self.for_s)
                cloud.mail.is_silent = False
            case "CLOCK_SET_ON":
                clock.jump(self.for_s)
            case "COMPUTER_SLEEPS":
                clock.stand_still(self.for_s)
            case "WALL_SET_BACK":
                clock.set_wall(-3600.0)
                await stage.kill(down_s=self.for_s)

    async def _kill_in_step(self, stage: "Stage") -> None:
        begun = stage.yard.kinds_begun
        seen = len(begun)
        for _ in range(3000):
            if self.step_kind in begun[seen:]:
                await stage.clock.sleep(min(self.for_s / 10, 25.0))
                await stage.kill(down_s=self.for_s)
                return
            await stage.clock.sleep(2.0)


def whims_of(luck: Random) -> tuple[Whim, ...]:
    """The random disruptions of a story; a third of the stories have none."""
    count = luck.choice((0, 0, 1, 2, 3, 4))
    return tuple(
        Whim(
            kind=luck.choice(KINDS),
            at_s=luck.uniform(_FIRST_S, _LAST_S),
            for_s=luck.choice((3.0, 30.0, 120.0, 400.0)),
            step_kind=luck.choice(("PICK_UP", "FLY", "RECHARGE", "DELIVER", "RETURN")),
        )
        for _ in range(count)
    )
