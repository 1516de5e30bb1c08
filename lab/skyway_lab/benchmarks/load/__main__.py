"""`python -m skyway_lab load`: run, print the tables; 1 when an invariant is broken."""

import asyncio
import shlex
import sys

import uvloop
from skyway_lab.benchmarks.load.burst import read_burst
from skyway_lab.benchmarks.load.figures import Outcome
from skyway_lab.benchmarks.load.run import run
from skyway_lab.benchmarks.planner.machine import Machine
from skyway_lab.benchmarks.planner.table import Table


def main(arguments: list[str]) -> int:
    """Run once and print what came of it."""
    burst = read_burst(arguments)
    command = shlex.join(["python", "-m", "skyway_lab", "load", *arguments])
    print(f"`{command}`: {Machine.here().as_text()}.\n\n{burst.as_text()}\n", flush=True)
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:  # as the services
        outcome = runner.run(run(burst))
    for table in _tables(outcome):
        print(f"{table.as_markdown()}\n", flush=True)
    return 0 if outcome.is_right else 1


def _tables(outcome: Outcome) -> list[Table]:
    return [
        Table("load", "What customers saw.", ("measured", "value"), outcome.rows()),
        Table(
            "load-cpu",
            "Processor time: cores taken before and during the run, ms for each "
            f"{'completed delivery' if outcome.burst.is_flown else 'dispatch'}.",
            ("process", "idle, cores", "busy, cores", "ms each"),
            outcome.cpu_rows(),
        ),
        Table(
            "load-counters",
            "What the services counted.",
            ("counter", "value"),
            [(name, f"{value:g}") for name, value in sorted(outcome.counted.items()) if value],
        ),
    ]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
