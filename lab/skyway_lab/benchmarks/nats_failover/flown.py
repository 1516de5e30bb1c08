"""A whole Skyway on the cluster: its drones fly deliveries while a node is killed."""

import asyncio
import os
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import Final

from skyway_lab.benchmarks.database_failover.customers import (
    Accepted,
    have_ended,
    request_all,
    states_at_end,
)
from skyway_lab.benchmarks.load.burst import Burst
from skyway_lab.benchmarks.load.city import City
from skyway_lab.benchmarks.load.run import data_folder, verify
from skyway_lab.benchmarks.load.world import populate
from skyway_lab.benchmarks.nats_failover.cluster import Cluster

from skyway.broker_setup.nats_accounts import NatsAccounts
from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import GatewayApi, read_keys
from skyway.cli.system.children import Ports
from skyway.cli.system.running_system import running_system

#: Fleet seconds in a wall second: a mission takes about ten seconds.
_CLOCK_RATE: Final = 120.0
_PER_S: Final = 2.0
_END_WITHIN_S: Final = 600.0
#: After this share of the deliveries the node is killed.
_KILLED_AFTER: Final = 0.4

#: A drone in this state has lost its connection.
_AWAY: Final = "OFFLINE"

#: A broker gives up a client that is silent for that long, wall seconds.
_LONGEST_SILENCE_S: Final = 15.0


@dataclass(frozen=True, slots=True)
class Flown:
    """What became of the deliveries; `back_s` is when all drones were connected after the kill."""

    states: dict[str, str]
    gap_s: float
    back_s: float
    violations: str

    @property
    def is_right(self) -> bool:
        """Whether nothing was lost."""
        return have_ended(self.states) and self.violations.startswith("0 ")

    def row(self, seed: int, killed: int) -> tuple[str, ...]:
        """The run as a row of the table."""
        counted = ", ".join(f"{n} {state}" for state, n in Counter(self.states.values()).items())
        times = f"{self.gap_s:.1f} s", f"{self.back_s:.1f} s"
        return f"{seed}", f"{killed}", counted, *times, self.violations


async def fly(*, drones: int, deliveries: int, seed: int, killed: int) -> Flown:
    """One run."""
    burst = Burst(
        storage="embedded",
        stations=200,
        drones=drones,
        providers=4,
        rate_per_s=_PER_S,
        seconds=deliveries / _PER_S,
        clock_rate=_CLOCK_RATE,
        agents=1,
        longest_wait_s=_END_WITHIN_S,
        seed=seed,
    )
    with data_folder() as folder, _cluster_of(folder) as cluster:
        async with running_system(
            folder, rate=burst.clock_rate, ports=Ports(gateway=0, broker=0), say=print
        ) as system:
            city = City.of(stations=burst.stations, seed=seed)
            key, url = read_keys(folder)["SKYWAY_OPERATOR_KEY"], system.urls["gateway"]
            async with GatewayApi(url) as api:
                world = await populate(system, api, city, operator_key=key, burst=burst)
                stream = city.requests(rate_per_s=_PER_S, seconds=float("inf"), seed=seed)
                requests, accepted = list(islice(stream, deliveries)), Accepted()
                async with asyncio.TaskGroup() as group:
                    group.create_task(request_all(url, requests, world.customers, accepted))
                    await asyncio.sleep(requests[int(deliveries * _KILLED_AFTER)].at_s)
                    killed_s = time.monotonic()
                    await asyncio.to_thread(cluster.kill, killed)
                    back_s = await _until_connected(api, key, since_s=killed_s)
            states = await states_at_end(url, key, list(accepted.at_s), within_s=_END_WITHIN_S)
        violations = await asyncio.to_thread(verify, folder)
    return Flown(states, accepted.longest_gap_s(after_s=killed_s), back_s, violations)


async def _until_connected(api: GatewayApi, key: str, *, since_s: float) -> float:
    """Wait until no drone is away any more; how long after a moment a drone was last away."""
    last_away_s, ends_s = since_s, since_s + 2 * _LONGEST_SILENCE_S
    while time.monotonic() < ends_s:
        by_state = (await api.call("GET", "/v1/stats/fleets", key=key))["by_state"]
        if by_state.get(_AWAY, 0):
            last_away_s = time.monotonic()
            ends_s = last_away_s + _LONGEST_SILENCE_S
        await asyncio.sleep(0.5)
    return last_away_s - since_s


@contextmanager
def _cluster_of(folder: DataFolder) -> Iterator[Cluster]:
    """The cluster with the accounts of this folder; the settings of the system name it."""
    NatsAccounts(folder.broker_passwords).write({}, {})
    cluster = Cluster(folder.broker, accounts=folder.broker_passwords)
    settings = {"SKYWAY_BROKER_KIND": "nats", "SKYWAY_MQTT_URL": cluster.url}
    cluster.start()
    os.environ.update(settings)
    try:
        yield cluster
    finally:
        cluster.stop()
        for name in settings:
            del os.environ[name]
