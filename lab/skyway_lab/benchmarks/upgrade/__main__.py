"""Upgrades a system from an older commit while deliveries are requested, and goes back once.

`python -m skyway_lab upgrade --from COMMIT` starts that commit's services and drones on PostgreSQL
and Mosquitto. It migrates the databases, starts the services of this checkout beside the older
ones, ends the older ones, starts them again on the newer tables, and ends them for good. The drones
keep the older version. The exit code is 1 if a request was not accepted at the first try, if a
delivery did not end, or if `skyway verify` finds a violation.
"""

import argparse
import asyncio
import os
import sys
from collections import Counter
from collections.abc import Awaitable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final

from skyway_lab.benchmarks.database_failover.customers import have_ended, states_at_end
from skyway_lab.benchmarks.load.burst import Burst
from skyway_lab.benchmarks.load.city import City
from skyway_lab.benchmarks.load.run import data_folder, verify
from skyway_lab.benchmarks.load.send import send
from skyway_lab.benchmarks.load.storage_pair import storage_pair
from skyway_lab.benchmarks.load.world import World, populate
from skyway_lab.benchmarks.planner.machine import Machine
from skyway_lab.benchmarks.planner.table import Table
from skyway_lab.benchmarks.upgrade.mixed_system import MixedSystem, mixed_system
from skyway_lab.benchmarks.upgrade.versions import Version, older_version, this_version

from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import GatewayApi, read_keys
from skyway.errors import SkywayError

#: Fleet seconds in a wall second: a mission takes about ten seconds.
_CLOCK_RATE: Final = 120.0
_END_WITHIN_S: Final = 600.0


@dataclass(slots=True)
class Rehearsal:
    """The requests of each step of the upgrade, and what became of them."""

    burst: Burst
    running: MixedSystem
    world: World
    city: City
    #: For each step: accepted deliveries, and answers that were no 202.
    steps: dict[str, tuple[list[str], Counter[str]]] = field(default_factory=dict)

    async def request_during(self, step: str, change: Awaitable[None] | None = None) -> None:
        """Request deliveries while this change is made, and for a while without a change."""
        print(step, flush=True)
        requests = self.city.requests(
            rate_per_s=self.burst.rate_per_s,
            seconds=self.burst.seconds,
            seed=self.burst.seed + len(self.steps),
        )
        url = self.running.system.urls["gateway"]
        async with asyncio.TaskGroup() as group:
            sending = group.create_task(send(url, self.world, requests))
            if change is not None:
                await change
        sent = sending.result()
        self.steps[step] = (list(sent.asked_at), sent.refused)


async def rehearse(burst: Burst, old: Version, new: Version) -> bool:
    """The whole upgrade; whether everything was right."""
    with data_folder() as folder, storage_pair("production", folder):
        with _started_in(old):
            async with mixed_system(folder, rate=burst.clock_rate) as running:
                states, rehearsal = await _upgrade(burst, folder, running, old, new)
        violations = await asyncio.to_thread(verify, folder)
    rows: list[tuple[str, ...]] = [
        (
            step,
            str(len(accepted)),
            _counted(refused) or "none",
            _counted(Counter(states[each] for each in accepted)),
        )
        for step, (accepted, refused) in rehearsal.steps.items()
    ]
    header = ("step", "accepted", "other answers", "became")
    print(Table("upgrade", f"verify: {violations}", header, rows).as_markdown(), flush=True)
    has_refused = any(refused for _, refused in rehearsal.steps.values())
    return not has_refused and have_ended(states) and violations.startswith("0 ")


async def _upgrade(
    burst: Burst, folder: DataFolder, running: MixedSystem, old: Version, new: Version
) -> tuple[dict[str, str], Rehearsal]:
    await running.start(old)
    city = City.of(stations=burst.stations, seed=burst.seed)
    key = read_keys(folder)["SKYWAY_OPERATOR_KEY"]
    url = running.system.urls["gateway"]
    async with GatewayApi(url) as api:
        world = await populate(running.system, api, city, operator_key=key, burst=burst)
    rehearsal = Rehearsal(burst, running, world, city)
    await rehearsal.request_during("the older version alone")
    await rehearsal.request_during("the databases are migrated", running.migrate(new))
    await rehearsal.request_during("the newer version starts", running.start(new))
    await rehearsal.request_during("both versions")
    await rehearsal.request_during("the older version ends", running.stop(old))
    await rehearsal.request_during("the newer version alone")
    await rehearsal.request_during("the older version starts again", running.start(old))
    await rehearsal.request_during("the newer version ends", running.stop(new))
    await rehearsal.request_during("the older version alone on newer tables")
    await rehearsal.request_during("the newer version starts again", running.start(new))
    await rehearsal.request_during("the older version ends for good", running.stop(old))
    accepted = [each for ids, _ in rehearsal.steps.values() for each in ids]
    states = await states_at_end(url, key, accepted, within_s=_END_WITHIN_S)
    return states, rehearsal


@contextmanager
def _started_in(version: Version) -> Iterator[None]:
    """For the block, processes without a version of their own run this one: those of drones."""
    before = os.environ.get("PYTHONPATH")
    os.environ.update(version.settings)
    try:
        yield
    finally:
        del os.environ["PYTHONPATH"]
        if before is not None:
            os.environ["PYTHONPATH"] = before


def _counted(what: Counter[str]) -> str:
    return ", ".join(f"{number} {name}" for name, number in sorted(what.items()))


def main() -> int:
    """Rehearse the upgrade from the commit that is asked for."""
    parser = argparse.ArgumentParser(prog="python -m skyway_lab upgrade", description=__doc__)
    parser.add_argument(
        "--from", dest="commit", required=True, metavar="COMMIT", help="the older version"
    )
    parser.add_argument(
        "--seconds", type=float, default=15.0, help="how long deliveries are requested in each step"
    )
    parser.add_argument("--rate-per-s", type=float, default=1.0, help="requests a second")
    parser.add_argument("--drones", type=int, default=150, help="number of drones")
    parser.add_argument("--seed", type=int, default=1, help="of the requests")
    given = parser.parse_args()
    burst = Burst(
        storage="production",
        stations=200,
        drones=given.drones,
        providers=4,
        rate_per_s=given.rate_per_s,
        seconds=given.seconds,
        clock_rate=_CLOCK_RATE,
        agents=1,
        longest_wait_s=_END_WITHIN_S,
        seed=given.seed,
    )
    print(f"{Machine.here().as_text()}; from {given.commit}; {burst.as_text()}\n", flush=True)
    try:
        with older_version(given.commit) as old:
            is_right = asyncio.run(rehearse(burst, old, this_version()))
    except SkywayError as error:
        print(error, file=sys.stderr)
        return 1
    return 0 if is_right else 1


if __name__ == "__main__":
    sys.exit(main())
