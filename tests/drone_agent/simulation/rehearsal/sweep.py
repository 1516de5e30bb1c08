"""The large sweep, run by hand: seeds x scenarios x every moment at which the power can fail.

    sweep=tests.drone_agent.simulation.rehearsal.sweep
    python -m $sweep --seeds 0:50 --scenarios calm,windy,stormy,faulty --crashes all
    python -m $sweep --story 42:faulty:torn@17      # one story again, printed in full

Each story first runs without a crash; its writes are then the crash points.
"""

import argparse
import logging
import os
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from random import Random
from typing import get_args

from tests.drone_agent.simulation.rehearsal.disk import Crash, Moment
from tests.drone_agent.simulation.rehearsal.story import Ending, Story, play

#: Scenarios in which failsafes have something to do, and one in which they have not.
SCENARIOS = ("calm", "windy", "stormy", "faulty")


def crashes_of(ending: Ending, *, how_many: int | None) -> list[Crash]:
    """Power cuts at every write of a story, before, within and after it; or some of them."""
    every = [
        Crash(at_write, moment)
        for at_write in range(1, ending.writes + 1)
        for moment in get_args(Moment)
    ]
    if how_many is None:
        return every
    luck = Random(ending.story.seed)
    return luck.sample(every, min(how_many, len(every)))


def stories_of(seed: int, scenario: str, *, how_many: int | None) -> Iterator[Ending]:
    """A story, the same again, and the same with each of its crashes."""
    first = play(Story(seed, scenario))
    again = play(Story(seed, scenario))
    if first.as_bytes() != again.as_bytes() or first.reported != again.reported:
        first.broken.append("same seed, another story")
    yield first
    luck = Random(seed)
    for crash in crashes_of(first, how_many=how_many):
        others: tuple[Crash, ...] = ()
        if luck.random() < 0.2:
            others = (Crash(crash.at_write + luck.randrange(1, 6), crash.moment),)
        yield play(Story(seed, scenario, crashes=(crash, *others)))


def _sweep_one(job: tuple[int, str, int | None]) -> tuple[int, list[tuple[str, str]], Counter[str]]:
    seed, scenario, how_many = job
    logging.disable(logging.CRITICAL)
    count, broken, seen = 0, [], Counter[str]()
    for ending in stories_of(seed, scenario, how_many=how_many):
        count += 1
        broken += [(str(ending.story), each) for each in ending.broken[:1]]
        seen["down" if ending.is_down else "ended"] += 1
        seen.update(f"code {event.code}" for event in ending.events if event.code)
    return count, broken, seen


def main() -> int:
    """Sweep, and say what was found; the exit code is 1 when anything was."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", default="0:20", help="FROM:TO")
    parser.add_argument("--scenarios", default=",".join(SCENARIOS))
    parser.add_argument("--crashes", default="all", help="all, or how many a story")
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--story", help="SEED:SCENARIO[:MOMENT@WRITE...]")
    asked = parser.parse_args()
    if asked.story:
        return _play_one(asked.story)
    first, last = map(int, asked.seeds.split(":"))
    how_many = None if asked.crashes == "all" else int(asked.crashes)
    jobs = [
        (seed, scenario, how_many)
        for seed in range(first, last)
        for scenario in asked.scenarios.split(",")
    ]
    began, count, kinds = time.monotonic(), 0, Counter[str]()
    seen = Counter[str]()
    with ProcessPoolExecutor(asked.workers) as pool:
        for reported, broken, what in pool.map(_sweep_one, jobs):
            count += reported
            seen += what
            for story, each in broken:
                kinds[": ".join(each.split(": ")[:2])[:70]] += 1
                print(f"{story}: {each[:300]}", flush=True)  # noqa: T201
    spent_s = time.monotonic() - began
    print(f"{count} stories in {spent_s:.0f} s; {kinds.total()} broken: {dict(kinds)}")  # noqa: T201
    print(", ".join(f"{key} {number}" for key, number in seen.most_common()))  # noqa: T201
    return 1 if kinds else 0


def _play_one(text: str) -> int:
    seed, scenario, *crashes = text.split(":")
    points = [each.split("@") for each in crashes]
    ending = play(
        Story(int(seed), scenario, tuple(Crash(int(at), moment) for moment, at in points))  # type: ignore[arg-type]
    )
    for event in ending.events:
        print(event.model_dump_json(exclude_defaults=True))  # noqa: T201
    print("\n".join((*ending.reported, *ending.broken)))  # noqa: T201
    return 1 if ending.broken else 0


if __name__ == "__main__":
    sys.exit(main())
