"""Kills the primary of two PostgreSQL servers during deliveries, and looks what became of them.

`python -m benchmarks database_failover --deliveries 200 --runs 3` prints for each run how long
nothing was accepted. It ends with 1 if a delivery that was accepted is gone or did not end, or if
`skyway verify` finds a violation.
"""

import argparse
import asyncio
import math
import os
import sys
import time
import uuid
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import islice, pairwise
from typing import Final

import httpx

from benchmarks.database_failover.patroni import Cluster, patroni_cluster
from benchmarks.load.burst import Burst
from benchmarks.load.city import City
from benchmarks.load.run import data_folder, verify
from benchmarks.load.world import World, populate
from benchmarks.planner.machine import Machine
from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import GatewayApi, read_keys
from skyway.cli.system.children import Ports
from skyway.cli.system.running_system import running_system
from skyway.errors import SkywayError

#: A customer tries again after this, and gives an attempt up after that; wall seconds.
_AGAIN_AFTER_S: Final = 0.5
_ATTEMPT_S: Final = 10.0
#: Fleet seconds in a wall second: a mission takes about ten seconds.
_CLOCK_RATE: Final = 120.0
#: After this share of the deliveries the primary is killed.
_KILLED_AFTER: Final = 0.4
_END_WITHIN_S: Final = 600.0
_ENDED: Final = ("COMPLETED", "PARTIALLY_COMPLETED", "REJECTED", "FAILED", "CANCELLED")


@dataclass(slots=True)
class Accepted:
    """The deliveries that were answered 202, and when; moments are monotonic seconds."""

    at_s: dict[str, float] = field(default_factory=dict)

    def longest_gap_s(self, *, after_s: float) -> float:
        """The longest time without a 202 that began after a moment, or held it."""
        moments = sorted(self.at_s.values())
        gaps = pairwise(moments)
        return max((end - max(begin, after_s) for begin, end in gaps if end > after_s), default=0.0)


async def run(burst: Burst, cluster: Cluster) -> bool:
    """One run; whether nothing was lost."""
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
            states = await _ends(url, key, list(accepted.at_s))
        return await _report(folder, accepted, states, killed_s)


async def _request_and_kill(
    burst: Burst, city: City, world: World, url: str, cluster: Cluster
) -> tuple[Accepted, str, float]:
    """Request all deliveries, and kill the primary between them: its name, and the moment."""
    stream = city.requests(rate_per_s=burst.rate_per_s, seconds=math.inf, seed=burst.seed)
    requests = list(islice(stream, round(burst.rate_per_s * burst.seconds)))
    kill_at_s = requests[int(len(requests) * _KILLED_AFTER)].at_s
    accepted, started_s = Accepted(), time.monotonic()
    async with httpx.AsyncClient(base_url=url) as client, asyncio.TaskGroup() as group:
        for number, request in enumerate(requests):
            key = world.customers[number % len(world.customers)].key
            due_s = started_s + request.at_s
            group.create_task(_request(client, accepted, request.body, key, due_s=due_s))
        await asyncio.sleep(kill_at_s)
        await asyncio.to_thread(cluster.wait_until_safe)
        killed_s = time.monotonic()
        killed = await asyncio.to_thread(cluster.kill_primary)
    return accepted, killed, killed_s


async def _request(
    client: httpx.AsyncClient, accepted: Accepted, body: bytes, key: str, *, due_s: float
) -> None:
    """Request a delivery as customers should: until it is accepted, with the same key."""
    await asyncio.sleep(max(0.0, due_s - time.monotonic()))
    headers = {"Authorization": f"Bearer {key}", "Content-Type": "application/json"}
    headers["Idempotency-Key"] = uuid.uuid4().hex
    while True:
        with suppress(httpx.HTTPError):
            answer = await client.post(
                "/v1/deliveries", content=body, headers=headers, timeout=_ATTEMPT_S
            )
            if answer.status_code == httpx.codes.ACCEPTED:
                accepted.at_s[answer.json()["delivery_id"]] = time.monotonic()
                return
            if answer.status_code < httpx.codes.INTERNAL_SERVER_ERROR:
                raise SkywayError(f"refused: {answer.text}")
        await asyncio.sleep(_AGAIN_AFTER_S)


async def _ends(url: str, key: str, delivery_ids: Sequence[str]) -> dict[str, str]:
    """The state of each delivery once all have ended, or after a long time.

    A delivery that is not found has the status of the answer instead.
    """
    states = dict.fromkeys(delivery_ids, "")
    ends_s = time.monotonic() + _END_WITHIN_S
    async with httpx.AsyncClient(
        base_url=url, headers={"Authorization": f"Bearer {key}"}
    ) as client:
        while time.monotonic() < ends_s:
            for each in [one for one, state in states.items() if state not in _ENDED]:
                answer = await client.get(f"/v1/deliveries/{each}", timeout=_ATTEMPT_S)
                is_there = answer.status_code == httpx.codes.OK
                states[each] = answer.json()["state"] if is_there else f"{answer.status_code}"
            if all(state in _ENDED for state in states.values()):
                break
            await asyncio.sleep(1.0)
    return states


async def _report(
    folder: DataFolder, accepted: Accepted, states: dict[str, str], killed_s: float
) -> bool:
    gap_s = accepted.longest_gap_s(after_s=killed_s)
    violations = await asyncio.to_thread(verify, folder)
    print(
        f"{len(states)} accepted, {dict(Counter(states.values()))}; nothing was accepted for "
        f"{gap_s:.1f} s after the kill; verify: {violations}",
        flush=True,
    )
    return all(state in _ENDED for state in states.values()) and violations.startswith("0 ")


def main() -> int:
    """Run as often as asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--deliveries", type=int, default=200)
    parser.add_argument("--rate-per-s", type=float, default=4.0)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    print(f"{Machine.here().as_text()}; {given.deliveries} deliveries, {given.rate_per_s:g}/s\n")
    results = [_one_run(given, seed=given.seed + number) for number in range(given.runs)]
    print(f"{sum(results)} of {len(results)} runs without a loss")
    return 0 if all(results) else 1


def _one_run(given: argparse.Namespace, *, seed: int) -> bool:
    burst = Burst(
        storage="production",
        stations=200,
        drones=200,
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
