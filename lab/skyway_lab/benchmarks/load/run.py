"""One run: a whole Skyway started, populated, loaded, measured, ended and verified."""

import asyncio
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Final

from skyway_lab.benchmarks.load.burst import Burst
from skyway_lab.benchmarks.load.city import City, Place
from skyway_lab.benchmarks.load.counters import counters
from skyway_lab.benchmarks.load.cpu import CpuReading
from skyway_lab.benchmarks.load.figures import Outcome, Usage
from skyway_lab.benchmarks.load.follow import Followed, following
from skyway_lab.benchmarks.load.profile import profiled
from skyway_lab.benchmarks.load.send import send
from skyway_lab.benchmarks.load.statements import SERVER_OPTIONS, statements_counted
from skyway_lab.benchmarks.load.storage_pair import storage_pair
from skyway_lab.benchmarks.load.world import World, populate

from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import GatewayApi, read_keys
from skyway.cli.system.children import REPLICATED, Ports, replica_name
from skyway.cli.system.running_system import System, running_system
from skyway.cli.system.secrets import read_secret
from skyway.contracts.delivery_event import DeliveryEventType
from skyway.errors import SkywayError
from skyway.runtime.metrics import METRICS_KEY

#: Wall seconds to find out what the system costs when nothing is asked of it.
_IDLE_S: Final = 8.0

#: How much longer than the burst it is measured, at most.
_MEASURED_FOR_S: Final = 5.0

#: The first requests compile and fill caches, and a burst must not pay for that: small waves are
#: sent until all requests of one wave are planned almost immediately. A mission that waits for its
#: drone may be dispatched much later. Each replica has caches and statements of its own, and
#: requests are not shared evenly.
_WAVE_S: Final = 3.0
_WAVE_PER_S: Final = 4.0
_WARM_WITHIN_S: Final = 2.0
_LEAST_FOR_EACH_REPLICA: Final = 30
_MOST_WAVES: Final = 40


async def run(burst: Burst) -> Outcome:
    """The run from its first process to its last; of one that goes wrong the logs are kept."""
    with data_folder() as folder:
        # Counting takes some of the time that is measured, so only who looks for it has it.
        options = () if burst.profile is None else SERVER_OPTIONS
        with storage_pair(burst.storage, folder, postgresql_options=options) as servers:
            async with running_system(
                folder,
                rate=burst.clock_rate,
                ports=Ports(gateway=0, broker=0),
                say=print,
                replicas=burst.replicas,
            ) as system:
                city = City.of(stations=burst.stations, seed=burst.seed)
                key = read_keys(folder)["SKYWAY_OPERATOR_KEY"]
                async with GatewayApi(system.urls["gateway"]) as api:
                    world = await populate(system, api, city, operator_key=key, burst=burst)
                pids = pids_of(system, world, replicas=burst.replicas)
                pids |= {name: one.pid for name, one in servers.items()}
                outcome = await measured(system, world, city, burst=burst, pids=pids, check=verify)
        if not outcome.is_right:
            _keep_logs(folder)
        return outcome


@contextmanager
def data_folder() -> Iterator[DataFolder]:
    """A data folder for the length of the block."""
    with tempfile.TemporaryDirectory(prefix="skyway-load-") as name:
        folder = DataFolder(Path(name))
        folder.make()
        try:
            yield folder
        except Exception:
            _keep_logs(folder)
            raise


def _keep_logs(folder: DataFolder) -> None:
    kept = tempfile.mkdtemp(prefix="skyway-load-logs-")
    shutil.copytree(folder.logs, kept, dirs_exist_ok=True)
    print(f"the logs are in {kept}", file=sys.stderr, flush=True)


async def measured(
    system: System,
    world: World,
    city: Place,
    *,
    burst: Burst,
    pids: Mapping[str, int],
    check: Callable[[DataFolder], str],
) -> Outcome:
    """What the burst costs these processes, once all is warm; `check` looks at the databases."""
    requests = city.requests(rate_per_s=burst.rate_per_s, seconds=burst.seconds, seed=burst.seed)
    await warm_up(system, world, city, burst=burst)
    # Afterwards: a service that has just started still compiles and reads.
    idle, idle_s = await _idle(pids)
    async with following(world, mqtt_url=system.mqtt_url) as followed:
        metrics_key = read_secret(system.folder, METRICS_KEY)
        counted = await counters(system.urls, metrics_key=metrics_key)
        with profiled(_python_only(pids), burst.profile):
            async with statements_counted(
                burst.profile, dispatched=partial(followed.count, burst.counted_event)
            ):
                busy_from, started_s = CpuReading.of(pids), time.monotonic()
                sent = await send(system.urls["gateway"], world, requests)
                # Flights that begin late must not count as the cost of all dispatches.
                within_s = burst.longest_wait_s if burst.is_flown else _MEASURED_FOR_S
                await _until_settled(
                    followed, len(sent.asked_at), within_s=within_s, kind=burst.counted_event
                )
                busy_to, ended_s = CpuReading.of(pids), time.monotonic()
        await _until_settled(followed, len(sent.asked_at), within_s=burst.longest_wait_s)
        after = await counters(system.urls, metrics_key=metrics_key)
    return Outcome(
        burst=burst,
        started_s=started_s,
        sent=sent,
        followed=followed,
        usage=Usage(
            idle=idle,
            idle_s=idle_s,
            busy=busy_to.since(busy_from),
            busy_s=ended_s - started_s,
        ),
        counted={name: value - counted.get(name, 0.0) for name, value in after.items()},
        violations=await asyncio.to_thread(check, system.folder),
    )


async def _idle(pids: Mapping[str, int]) -> tuple[CpuReading, float]:
    """Processor time used while no request is sent, and in how many seconds."""
    before, before_s = CpuReading.of(pids), time.monotonic()
    await asyncio.sleep(_IDLE_S)
    return CpuReading.of(pids).since(before), time.monotonic() - before_s


async def warm_up(system: System, world: World, city: Place, *, burst: Burst) -> None:
    """Send small waves of requests until the system plans them immediately."""
    requests_sent = 0
    async with following(world, mqtt_url=system.mqtt_url) as followed:
        for wave in range(1, _MOST_WAVES + 1):
            requests = city.requests(
                rate_per_s=_WAVE_PER_S, seconds=_WAVE_S, seed=burst.seed + wave
            )
            sent = await send(system.urls["gateway"], world, requests)
            requests_sent += len(sent.asked_at)
            ended_s = time.monotonic()
            await _until_settled(
                followed,
                requests_sent,
                within_s=burst.longest_wait_s,
                kind=DeliveryEventType.PLANNED,
            )
            is_quick = time.monotonic() - ended_s < _WARM_WITHIN_S
            if is_quick and requests_sent >= _LEAST_FOR_EACH_REPLICA * burst.replicas:
                if burst.is_flown:  # these flights must not count
                    within_s, kind = burst.longest_wait_s, burst.counted_event
                    await _until_settled(followed, requests_sent, within_s=within_s, kind=kind)
                return
    raise SkywayError(f"the system was not warm after {_MOST_WAVES} waves of requests")


async def _until_settled(
    followed: Followed,
    requests_sent: int,
    *,
    within_s: float,
    kind: DeliveryEventType = DeliveryEventType.DISPATCHED,
) -> None:
    ends_s = time.monotonic() + within_s
    while (  # noqa: ASYNC110
        not followed.are_settled(requests_sent, kind) and time.monotonic() < ends_s
    ):
        await asyncio.sleep(0.1)  # many events from outside decide this; there is no single one


def pids_of(system: System, world: World, *, replicas: int = 1) -> dict[str, int]:
    """The processes of the system and its agents, by name."""
    further = range(2, replicas + 1)
    more = [replica_name(name, number) for name in REPLICATED for number in further]
    names = [*system.urls, *more, "broker", *world.agents]
    found = {name: system.supervisor.pid(name) for name in names}
    return {name: pid for name, pid in found.items() if pid is not None}


def _python_only(pids: Mapping[str, int]) -> dict[str, int]:
    return {name: pid for name, pid in pids.items() if name not in ("postgresql", "mosquitto")}


def verify(folder: DataFolder) -> str:
    """What `skyway verify` says last, of the databases as they stand."""
    command = [sys.executable, "-m", "skyway.cli", "verify", "--data", str(folder.path)]
    checked = subprocess.run(
        command, capture_output=True, text=True, check=False, env=dict(os.environ)
    )
    said = (checked.stdout + checked.stderr).strip()
    if checked.returncode:
        print(said, file=sys.stderr, flush=True)
    return said.splitlines()[-1]
