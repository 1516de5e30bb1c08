"""`python -m skyway_lab fleet`: thousands of simulated drones, what they take, who keeps up.

hosting: one agent process with 1,000 drones on Mosquitto, standing and in flight.
feeding: 5,000 drones on PostgreSQL, Mosquitto and all services; how old what is known of them is.
embedded: how many messages a second the embedded broker delivers in time.

docs/fleets.md says how.
"""

import asyncio
import shlex
import sys
from collections.abc import AsyncIterator

from skyway_lab.benchmarks.fleet.feeding import feed
from skyway_lab.benchmarks.fleet.hosting import host
from skyway_lab.benchmarks.fleet.sizes import Sizes, read_sizes
from skyway_lab.benchmarks.fleet.stepping import step_up
from skyway_lab.benchmarks.planner.machine import Machine
from skyway_lab.benchmarks.planner.table import Table


async def measure(sizes: Sizes) -> AsyncIterator[Table]:
    """The tables of each requested part, one part after another."""
    if "hosting" in sizes.only:
        yield await host(
            sizes.hosted, scenario=sizes.scenario, seed=sizes.seed, seconds=sizes.seconds
        )
    if "feeding" in sizes.only:
        for table in await feed(
            sizes.fed,
            flying=sizes.flying,
            agents=sizes.agents,
            viewers=sizes.viewers,
            seed=sizes.seed,
            seconds=sizes.seconds,
        ):
            yield table
    if "embedded" in sizes.only:
        yield await step_up(seed=sizes.seed, seconds=sizes.step_seconds)


async def _print(sizes: Sizes) -> None:
    async for table in measure(sizes):
        print(f"{table.as_markdown()}\n", flush=True)


def main(arguments: list[str]) -> int:
    """Measure and print."""
    sizes = read_sizes(arguments)
    command = shlex.join(["python", "-m", "skyway_lab", "fleet", *arguments])
    print(f"`{command}`: {Machine.here().as_text()}, seed {sizes.seed}.\n", flush=True)
    asyncio.run(_print(sizes))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
