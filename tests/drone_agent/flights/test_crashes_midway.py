"""After a crash around an instruction in mid-mission nothing is lost or done twice."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

import pytest
from skyway_drone_agent.simulated.disturbances import Disturbances

from skyway.ids import StationId

#: What the cloud sends once a claim holds; both are made anew for each run.
Cue = tuple[Callable[[], bool], Callable[[], Any]]


@dataclass
class Script:
    """A life of one drone: what the cloud sends and when, and what has happened in the end."""

    cues: list[Cue]
    is_done: Callable[[], bool]
    happens: list[tuple[int, int | None, str | None]]
    writes: int


def is_doing(world: Any, activity: str) -> Callable[[], bool]:
    return lambda: bool(world.states) and world.states[-1].activity == activity


def diverted(world: Any, cloud: Any, steps: Any) -> Script:
    """Loaded by a loader, diverted in the air, its recharge cut, held, resumed, home."""
    first = steps().pick_up("home", awaits_confirmation=True, p1=0.5, p2=0.5)
    first.fly("home", "over", length_m=6000, duration_s=400, lands=False)
    first.fly("over", "shop", length_m=6000, duration_s=430).deliver("shop", "p1", "p2")

    def to_farm() -> Any:
        there = steps(at=world.clock.now(), first_step=4)
        there.fly("shop", "farm", length_m=6000, duration_s=430)
        there.recharge("farm", until_soc=1.0, duration_s=9000).deliver("farm", "p1", "p2")
        return cloud.divert(there.made, revision=3)

    def home() -> Any:
        back = steps(at=world.clock.now(), first_step=5).deliver("farm", "p2")
        back.fly("farm", "home", length_m=6000, duration_s=430).bring_back("home", "p1")
        return cloud.divert(back.made, revision=4)

    loaded = [{"package_id": name, "mass_kg": 0.6} for name in ("p1", "p2")]
    return Script(
        cues=[
            (lambda: True, lambda: cloud.mission(first.made)),
            (
                is_doing(world, "LOADING"),
                lambda: cloud.mission(first.made[1:], revision=2, loaded=loaded),
            ),
            (is_doing(world, "FLYING"), to_farm),
            (is_doing(world, "RECHARGING"), home),
            (lambda: True, cloud.hold),
            (lambda: bool(world.states[-1].is_held), cloud.resume),
        ],
        is_done=lambda: world.is_over,
        happens=[
            (2, 1, None),
            (3, 2, None),
            (3, 3, None),
            (3, 4, None),
            (3, 5, "CUT"),
            (4, 5, None),
            (4, 6, None),
            (4, 7, None),
            (4, None, None),
        ],
        writes=27,
    )


def called_off(world: Any, cloud: Any, steps: Any) -> Script:
    """Called off in the air, and again, in another mission, at the pickup."""
    first = steps().fly("home", "shop", length_m=6000, duration_s=330).pick_up("shop", p1=1.0)
    first.fly("shop", "home", length_m=6000, duration_s=430).deliver("home", "p1")

    def second() -> Any:
        there = steps(at=world.clock.now()).pick_up("shop", awaits_confirmation=True, p2=1.0)
        there.fly("shop", "home", length_m=6000, duration_s=430).deliver("home", "p2")
        return cloud.mission(there.made, mission_id="msn_2")

    def is_free(count: int) -> Callable[[], bool]:
        return lambda: len(world.events) == count and world.states[-1].mission_id is None

    return Script(
        cues=[
            (lambda: True, lambda: cloud.mission(first.made)),
            (is_doing(world, "FLYING"), cloud.cancel),
            (is_free(1), second),
            (is_doing(world, "LOADING"), lambda: cloud.cancel(mission_id="msn_2")),
        ],
        is_done=is_free(2),
        happens=[(1, 1, None), (1, 1, "CUT")],
        writes=10,
    )


def absent(world: Any, cloud: Any, steps: Any) -> Script:
    """Nobody at the shop: the drone waits, brings the package back, and is home."""
    world.disturbances = Disturbances(absent_station_ids=frozenset({StationId("shop")}))
    first = steps().pick_up("home", p1=1.0).fly("home", "shop", length_m=6000, duration_s=430)
    first.deliver("shop", "p1", recipient_wait_s=300)

    def back() -> Any:
        home = steps(at=world.clock.now(), first_step=4)
        home.fly("shop", "home", length_m=6000, duration_s=430).bring_back("home", "p1")
        return cloud.mission(home.made, revision=2)

    return Script(
        cues=[
            (lambda: True, lambda: cloud.mission(first.made)),
            (lambda: len(world.events) == 3, back),
        ],
        is_done=lambda: world.is_over,
        happens=[
            (1, 1, None),
            (1, 2, None),
            (1, 3, "RECIPIENT_ABSENT"),
            (2, 4, None),
            (2, 5, None),
            (2, None, None),
        ],
        writes=15,
    )


async def live(world: Any, script: Script) -> None:
    """Play the script; a process that dies starts again and gets the last instruction again."""
    sent = None
    for claim, make in [*script.cues, (script.is_done, None)]:
        await world.pass_until(lambda claim=claim: world.has_died or claim())
        if world.has_died:
            await start_again(world, sent)
            await world.pass_until(claim)
        if make is None:
            return
        sent = make()
        await world.send(sent)
        if world.has_died:
            await start_again(world, sent)


async def start_again(world: Any, last_word: Any) -> None:
    world.journal.dies_before = world.journal.dies_after = None
    await world.kill()
    await world.pass_time(timedelta(seconds=5))
    await world.start()
    await world.send(last_word)


def reported(world: Any) -> list[tuple[int, int | None, str | None]]:
    return [(event.mission_revision, event.step_id, event.code) for event in world.events]


@pytest.mark.parametrize("when", ["dies_before", "dies_after"])
@pytest.mark.parametrize(
    ("make_script", "write"),
    [
        *((diverted, write) for write in range(1, 28)),
        *((called_off, write) for write in range(1, 11)),
        *((absent, write) for write in range(1, 16)),
    ],
)
async def test_after_a_crash_in_mid_mission_each_step_still_happens_exactly_once(
    world: Any, cloud: Any, steps: Any, make_script: Any, write: int, when: str
) -> None:
    script = make_script(world, cloud, steps)
    setattr(world.journal, when, write)
    await world.start()

    await live(world, script)
    await world.settle()

    assert world.journal.dies_before is world.journal.dies_after is None, "it never died"
    assert reported(world) == script.happens
    assert [event.seq for event in world.events] == list(range(1, len(script.happens) + 1))
    assert world.states[-1].package_ids == ()
    assert world.states[-1].mission_id is None


@pytest.mark.parametrize("make_script", [diverted, called_off, absent])
async def test_no_further_write_is_left_to_crash_at(
    world: Any, cloud: Any, steps: Any, make_script: Any
) -> None:
    script = make_script(world, cloud, steps)
    await world.start()

    await live(world, script)

    assert reported(world) == script.happens
    assert world.journal.writes == script.writes
