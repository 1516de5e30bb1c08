"""Rehearsals of a drone's days: a small sweep; a large one is run by hand:

python -m tests.drone_agent.simulation.rehearsal.sweep
"""

from collections import Counter
from pathlib import Path

import pytest

from tests.drone_agent.simulation.rehearsal.disk import Crash
from tests.drone_agent.simulation.rehearsal.mutants import AGENT, MUTANTS, Mutant
from tests.drone_agent.simulation.rehearsal.story import Ending, Story, play
from tests.drone_agent.simulation.rehearsal.sweep import SCENARIOS, stories_of
from tests.drone_agent.simulation.rehearsal.whims import KINDS, Whim
from tests.long_cases import sampled

#: What befalls a story when nothing is to befall it by chance.
NOTHING: tuple[Whim, ...] = ()


def broken(endings: list[Ending]) -> list[tuple[str, str]]:
    return [(str(one.story), each) for one in endings for each in one.broken]


@pytest.mark.parametrize("scenario", SCENARIOS)
@pytest.mark.parametrize("seed", sampled(range(4), every=4))
def test_nothing_is_broken_wherever_the_power_fails(seed: int, scenario: str) -> None:
    endings = list(stories_of(seed, scenario, how_many=3))

    assert broken(endings) == []


@pytest.mark.long
def test_nothing_is_broken_at_any_moment_of_one_whole_mission() -> None:
    endings = list(stories_of(4, "calm", how_many=None))

    assert broken(endings) == []
    assert len(endings) > 50


@pytest.mark.parametrize("step_kind", ["PICK_UP", "FLY", "RECHARGE", "DELIVER", "RETURN"])
@pytest.mark.parametrize("down_s", sampled([400.0, 3.0], every=2))
def test_a_restart_within_any_step_breaks_nothing(step_kind: str, down_s: float) -> None:
    kill = Whim("KILL_IN_STEP", at_s=1.0, for_s=down_s, step_kind=step_kind)
    home = Whim("RETURN_HOME", at_s=400.0)
    whims = (kill, home) if step_kind == "RETURN" else (kill,)

    endings = [play(Story(seed, "calm", whims=whims)) for seed in range(4)]

    assert broken(endings) == []
    assert any(step_kind in one.step_kinds for one in endings)


@pytest.mark.parametrize("kind", sampled(sorted(set(KINDS)), every=3))
def test_no_disruption_breaks_an_invariant(kind: str) -> None:
    stories = [
        Story(seed, "windy", whims=(Whim(kind, at_s=60.0 + 110.0 * seed, for_s=300.0),))
        for seed in range(3)
    ]

    assert broken([play(story) for story in stories]) == []


def test_no_session_is_used_that_a_later_start_may_use_again() -> None:
    whims = (
        Whim("DISK_FULL", at_s=60.0, for_s=400.0),
        Whim("KILL", at_s=120.0, for_s=3.0),
        Whim("WALL_SET_BACK", at_s=300.0, for_s=3.0),
    )

    assert broken([play(Story(seed, "calm", whims=whims)) for seed in range(4)]) == []


def test_the_same_story_always_runs_the_same_way() -> None:
    story = Story(11, "faulty", crashes=(Crash(9, "torn"), Crash(17, "after")))

    first, second = play(story), play(story)

    assert first.as_bytes() == second.as_bytes()
    assert first.reported == second.reported
    assert first.over_at_s == second.over_at_s


def test_days_without_trouble_are_flown_to_their_end() -> None:
    endings = [play(Story(seed, "calm", whims=NOTHING)) for seed in range(12)]

    assert broken(endings) == []
    assert all(one.reported[-1].startswith("MISSION_ENDED") for one in endings)


@pytest.mark.long
def test_the_sweep_covers_all_important_faults() -> None:
    seen = Counter(
        event.code
        for scenario in SCENARIOS
        for seed in range(20, 32)
        for event in play(Story(seed, scenario)).events
    )

    requested = {"INSUFFICIENT_ENERGY", "BATTERY_LOW", "BATTERY_SHORT", "GPS_LOST", "GEOFENCE"}
    assert requested <= set(seen), seen


def test_learned_battery_health_survives_a_restart() -> None:
    for crash in (Crash(15, "torn"), Crash(20, "after")):
        assert play(Story(9, "faulty", (crash,))).broken == []


def test_a_restart_against_the_wind_does_not_overestimate_the_charge() -> None:
    assert play(Story(276, "stormy", (Crash(24, "before"),))).broken == []


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.name)
def test_each_mutant_still_changes_a_line_of_the_agent(mutant: Mutant) -> None:
    agent = Path(__file__).parents[3] / AGENT

    assert mutant.right in (agent / mutant.file).read_text()
