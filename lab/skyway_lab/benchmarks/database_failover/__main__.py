"""Kills the primary of two PostgreSQL servers during deliveries, and counts what became of them.

`python -m skyway_lab database_failover --deliveries 200 --runs 20` prints a table with a row for
each run: how long nothing was accepted, and what became of the deliveries. It ends with 1 if a
delivery that was accepted is gone or did not end, if `skyway verify` finds a violation, or if a run
could not be made.
"""

import argparse
import asyncio
import math
import os
import sys
import time
from collections import Counter
from dataclasses import dataclass
from itertools import islice
from typing import Final

from skyway_lab.benchmarks.database_failover.customers import (
    Accepted,
    have_ended,
    request_all,
    states_at_end,
)
from skyway_lab.benchmarks.database_failover.patroni import Cluster, patroni_cluster
from skyway_lab.benchmarks.load.burst import Burst
from skyway_lab.benchmarks.load.city import City
from skyway_lab.benchmarks.load.run import data_folder, verify
from skyway_lab.benchmarks.load.world import World, populate
from skyway_lab.benchmarks.planner.machine import Machine
from skyway_lab.benchmarks.planner.table import Table

from skyway.cli.gateway import GatewayApi, read_keys
from skyway.cli.system.children import Ports
from skyway.cli.system.running_system import running_system
from skyway.errors import SkywayError

#: Fleet seconds in a wall second: a mission takes about ten seconds.
_CLOCK_RATE: Final = 120.0
#: After this share of the deliveries the primary is killed.
_KILLED_AFTER: Final = 0.4
_END_WITHIN_S: Final = 600.0


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a run has found out; `gap_s` is how long nothing was accepted after the kill."""

    states: dict[str, str]
    gap_s: float
    violations: str

    @property
    def is_right(self) -> bool:
        """Whether nothing was lost."""
        return have_ended(self.states) and self.violations.startswith("0 ")

    def row(self, seed: int) -> tuple[str, ...]:
        """The run as a row of the table."""
        counted = ", ".join(f"{n} {state}" for state, n in Counter(self.states.values()).items())
        return f"{seed}", f"{len(self.states)}", counted, f"{self.gap_s:.1f} s", self.violations


async def run(burst: Burst, cluster: Cluster) -> Outcome:
    """One run."""
    with data_folder() as folder:
        ports = Ports(gateway=0, broker=0)
        async with running_system(folder, rate=burst.clock_rate, ports=ports, say=print) as system:
            city = City.of(stations=burst.stations, seed=burst.seed)
            key = read_keys(folder)["SKYWAY_OPERATOR_KEY"]
            async with GatewayApi(system.urls["gateway"]) as api:
                world = await populate(system, api, city, operator_key=key, burst=burst)
            url = system.urls["gateway"]
            accepted, killed, killed_s = await _request_and_kill(burst, city, world, url, cluster)
            await asyncio.to_thread(cluster.start_again, killed)
            states = await states_at_end(url, key, list(accepted.at_s), within_s=_END_WITHIN_S)
        violations = await asyncio.to_thread(verify, folder)
    return Outcome(states, accepted.longest_gap_s(after_s=killed_s), violations)


async def _request_and_kill(
    burst: Burst, city: City, world: World, url: str, cluster: Cluster
) -> tuple[Accepted, str, float]:
    """Request all deliveries, and kill the primary between them: its name, and the moment."""
    stream = city.requests(rate_per_s=burst.rate_per_s, seconds=math.inf, seed=burst.seed)
    requests = list(islice(stream, round(burst.rate_per_s * burst.seconds)))
    kill_at_s = requests[int(len(requests) * _KILLED_AFTER)].at_s
    accepted = Accepted()
    async with asyncio.TaskGroup() as group:
        group.create_task(request_all(url, requests, world.customers, accepted))
        await asyncio.sleep(kill_at_s)
        await asyncio.to_thread(cluster.wait_until_safe)
        killed_s = time.monotonic()
        killed = await asyncio.to_thread(cluster.kill_primary)
    return accepted, killed, killed_s


def main() -> int:
    """Run as often as asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--deliveries", type=int, default=200)
    parser.add_argument("--rate-per-s", type=float, default=4.0)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--drones", type=int, default=200)
    given = parser.parse_args()
    about = f"{given.deliveries} deliveries, {given.rate_per_s:g}/s, {given.drones} drones"
    print(f"{Machine.here().as_text()}; {about}\n", flush=True)
    rows: list[tuple[str, ...]] = []
    right = 0
    for seed in range(given.seed, given.seed + given.runs):
        try:
            outcome = _one_run(given, seed=seed)
        except (SkywayError, ExceptionGroup) as error:
            rows.append((f"{seed}", "0", f"not run: {error}", "", ""))
        else:
            rows.append(outcome.row(seed))
            right += outcome.is_right
        print(" | ".join(rows[-1]), flush=True)
    header = ("seed", "accepted", "became", "nothing accepted for", "verify")
    caption = f"The primary was killed: {right} of {given.runs} runs without a loss."
    print(Table("database-failover", caption, header, rows).as_markdown(), flush=True)
    return 0 if right == given.runs else 1


def _one_run(given: argparse.Namespace, *, seed: int) -> Outcome:
    burst = Burst(
        storage="production",
        stations=200,
        drones=given.drones,
        providers=4,
        rate_per_s=given.rate_per_s,
        seconds=given.deliveries / given.rate_per_s,
        clock_rate=_CLOCK_RATE,
        agents=1,
        longest_wait_s=_END_WITHIN_S,
        seed=seed,
    )
    with patroni_cluster() as cluster:
        os.environ["SKYWAY_DATABASE_URL"] = cluster.url
        return asyncio.run(run(burst, cluster))


if __name__ == "__main__":
    sys.exit(main())
