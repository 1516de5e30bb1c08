"""`python -m benchmarks fleet`: thousands of simulated drones, what they take, who keeps up.

hosting: one agent process with 1,000 drones on Mosquitto, standing and in flight.
feeding: 5,000 drones on PostgreSQL, Mosquitto and all services; how old what is known of them is.
embedded: how many messages a second the embedded broker delivers in time.

docs/fleets.md says how.
"""

import asyncio
import shlex
import sys
from collections.abc import AsyncIterator

from benchmarks.fleet.feeding import feed
from benchmarks.fleet.hosting import host
from benchmarks.fleet.stepping import step_up
from benchmarks.fleet.wanted import Wanted, read_wanted
from benchmarks.planner.machine import Machine
from benchmarks.planner.table import Table


async def measure(wanted: Wanted) -> AsyncIterator[Table]:
    """The tables of each part that is wanted, one part after another."""
    if "hosting" in wanted.only:
        yield await host(
            wanted.hosted, scenario=wanted.scenario, seed=wanted.seed, seconds=wanted.seconds
        )
    if "feeding" in wanted.only:
        for table in await feed(
            wanted.fed,
            flying=wanted.flying,
            agents=wanted.agents,
            seed=wanted.seed,
            seconds=wanted.seconds,
        ):
            yield table
    if "embedded" in wanted.only:
        yield await step_up(seed=wanted.seed, seconds=wanted.step_seconds)


async def _print(wanted: Wanted) -> None:
    async for table in measure(wanted):
        print(f"{table.as_markdown()}\n", flush=True)


def main(arguments: list[str]) -> int:
    """Measure and print."""
    wanted = read_wanted(arguments)
    command = shlex.join(["python", "-m", "benchmarks", "fleet", *arguments])
    print(f"`{command}`: {Machine.here().as_text()}, seed {wanted.seed}.\n", flush=True)
    asyncio.run(_print(wanted))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
