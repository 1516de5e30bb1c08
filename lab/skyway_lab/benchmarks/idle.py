"""`python -m skyway_lab idle`: processor time and statements of a Skyway without any requests.

A further replica or a further cell costs at least this much, however few deliveries there are. For
each number of replicas a system is started, with a PostgreSQL and a Mosquitto of its own.
`--embedded` measures `skyway up` instead, on SQLite and the embedded broker, without drones: the
processor time from its start until it is ready, then of an idle minute, and its memory.
"""

import argparse
import asyncio
import os
import shlex
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import asyncpg
import uvloop
from skyway_lab.benchmarks.load.burst import Burst
from skyway_lab.benchmarks.load.city import City
from skyway_lab.benchmarks.load.cpu import CpuReading, with_descendants
from skyway_lab.benchmarks.load.profile import profiled
from skyway_lab.benchmarks.load.run import data_folder, pids_of
from skyway_lab.benchmarks.load.statements import SERVER_OPTIONS
from skyway_lab.benchmarks.load.storage_pair import storage_pair
from skyway_lab.benchmarks.load.world import populate
from skyway_lab.benchmarks.planner.machine import Machine
from skyway_lab.benchmarks.planner.table import Table

from skyway.cli.gateway import GatewayApi, read_keys
from skyway.cli.system.children import REPLICATED, Ports
from skyway.cli.system.running_system import running_system
from skyway.errors import SkywayError

#: Wall seconds until the services have compiled and cached what an idle service needs.
_SETTLE_S: Final = 15.0

_STATEMENTS: Final = """
    SELECT datname, sum(calls)::float AS calls, sum(total_exec_time) AS running_ms, query
    FROM pg_stat_statements(true) AS counted JOIN pg_database ON pg_database.oid = counted.dbid
    WHERE datname <> 'postgres'
    GROUP BY datname, query
    ORDER BY sum(calls) DESC
"""


def main(arguments: list[str]) -> int:
    """Measure each number of replicas and print what they take."""
    parser = argparse.ArgumentParser(prog="python -m skyway_lab idle", description=__doc__)
    parser.add_argument("--replicas", type=int, nargs="+", default=[1, 2, 4])
    parser.add_argument("--stations", type=int, default=100)
    parser.add_argument("--drones", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--embedded", action="store_true", help="skyway up without drones")
    parser.add_argument("--profile", type=Path, metavar="FOLDER", help="stacks, statements")
    asked = parser.parse_args(arguments)
    command = shlex.join(["python", "-m", "skyway_lab", "idle", *arguments])
    print(f"`{command}`: {Machine.here().as_text()}.\n", flush=True)
    if asked.embedded:
        print(_embedded(seconds=asked.seconds).as_markdown())
        return 0
    rows = list[tuple[str, ...]]()
    for replicas in asked.replicas:
        burst = Burst(
            storage="production",
            stations=asked.stations,
            drones=asked.drones,
            providers=2,
            rate_per_s=0.0,
            seconds=asked.seconds,
            clock_rate=1.0,
            agents=1,
            longest_wait_s=30.0,
            seed=1,
            replicas=replicas,
            profile=None if asked.profile is None else asked.profile / f"{replicas}",
        )
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:  # as the services
            rows += runner.run(_run(burst))
    columns = ("replicas", "service", "ms a second", "its database", "statements a second")
    print(Table("idle", "Processor time while idle.", columns, rows).as_markdown())
    return 0


def _embedded(*, seconds: float) -> Table:
    """What each process of a new `skyway up` takes until it is ready and while it is idle.

    PSS shares a page among the processes that have it; RSS counts it for each of them.
    """
    with data_folder() as folder:
        command = [sys.executable, "-m", "skyway.cli", "up", "--port=0", "--mqtt-port=0", "--data"]
        with subprocess.Popen([*command, str(folder.path)], stdout=subprocess.PIPE) as up:
            try:
                output = up.stdout or ()
                if not any(b"Stop: Ctrl-C" in line for line in output):
                    raise SkywayError("skyway up did not start")
                pids = {_name_of(pid): pid for pid in with_descendants([up.pid])}
                started = _alone(pids)
                time.sleep(_SETTLE_S)
                before, began_s = _alone(pids), time.monotonic()
                time.sleep(seconds)
                idle, took_s = _alone(pids), time.monotonic() - began_s
                taken = {name: (idle[name] - before[name]) / took_s for name in pids}
                memory = {name: _memory_mib(pid) for name, pid in pids.items()}
            finally:
                up.terminate()
    figures = {
        name: (started[name], 100 * taken[name], memory[name]["Pss"], memory[name]["Rss"])
        for name in pids
    }
    sums = [sum(column) for column in zip(*figures.values(), strict=True)]
    figures["together"] = (sums[0], sums[1], sums[2], sums[3])
    rows: list[tuple[str, ...]] = [
        (name, f"{start_s:.2f}", f"{share:.2f}", f"{pss:.0f}", f"{rss:.0f}")
        for name, (start_s, share, pss, rss) in figures.items()
    ]
    columns = ("process", "start, s", "idle, % of a core", "PSS, MiB", "RSS, MiB")
    return Table("idle", "`skyway up` on SQLite without drones.", columns, rows)


def _alone(pids: Mapping[str, int]) -> Mapping[str, float]:
    """The processor seconds of each process, and of those that it has started and waited for."""
    ticks = {name: Path(f"/proc/{pid}/stat").read_text() for name, pid in pids.items()}
    fields = {name: text.rpartition(")")[2].split()[11:15] for name, text in ticks.items()}
    return {name: sum(map(int, four)) / os.sysconf("SC_CLK_TCK") for name, four in fields.items()}


def _name_of(pid: int) -> str:
    """The package that a process runs, or `up`."""
    arguments = Path(f"/proc/{pid}/cmdline").read_text().split("\0")
    return next((each for each in arguments if each.startswith("skyway_")), "up")


def _memory_mib(pid: int) -> Mapping[str, float]:
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()[1:]
    return {name: int(kib.split()[0]) / 1024 for name, kib in (each.split(":") for each in lines)}


async def _run(burst: Burst) -> list[tuple[str, ...]]:
    with (
        data_folder() as folder,
        storage_pair("production", folder, postgresql_options=SERVER_OPTIONS) as servers,
    ):
        async with running_system(
            folder,
            rate=burst.clock_rate,
            ports=Ports(gateway=0, broker=0),
            say=print,
            replicas=burst.replicas,
        ) as system:
            city = City.of(stations=burst.stations, seed=1)
            key = read_keys(folder)["SKYWAY_OPERATOR_KEY"]
            async with GatewayApi(system.urls["gateway"]) as api:
                world = await populate(system, api, city, operator_key=key, burst=burst)
            pids = pids_of(system, world, replicas=burst.replicas)
            python_pids = dict(pids)
            pids |= {name: one.pid for name, one in servers.items()}
            await asyncio.sleep(_SETTLE_S)
            return await _measured(burst, pids, python_pids)


async def _measured(
    burst: Burst, pids: Mapping[str, int], python_pids: Mapping[str, int]
) -> list[tuple[str, ...]]:
    connection = await asyncpg.connect(os.environ["SKYWAY_DATABASE_URL"])
    try:
        await connection.execute("CREATE EXTENSION IF NOT EXISTS pg_stat_statements")
        await connection.execute("SELECT pg_stat_statements_reset()")
        before, began_s = CpuReading.of(pids), time.monotonic()
        with profiled(python_pids, burst.profile):
            await asyncio.sleep(burst.seconds)
        took_s = time.monotonic() - began_s
        taken = CpuReading.of(pids).since(before).seconds
        statements = await connection.fetch(_STATEMENTS)
    finally:
        await connection.close()
    if burst.profile is not None:
        _leave(statements, burst.profile, seconds=took_s)
    return [
        (
            f"{burst.replicas}",
            service,
            f"{1e3 * taken.get(service, 0.0) / took_s:.1f}",
            f"{1e3 * taken.get(f'postgresql {service}', 0.0) / took_s:.1f}",
            f"{_calls(statements, f'skyway_{service}') / took_s:.1f}",
        )
        for service in (*REPLICATED, "agent 0", "mosquitto")
    ]


def _calls(statements: Sequence[asyncpg.Record], database: str) -> float:
    return sum(float(each["calls"]) for each in statements if each["datname"] == database)


def _leave(statements: Sequence[asyncpg.Record], folder: Path, *, seconds: float) -> None:
    """Write the statements into a file of the folder, the most frequent first."""
    lines = [
        f"{each['calls'] / seconds:7.2f}/s {each['running_ms'] / seconds:7.3f} ms/s "
        f"{each['datname']} {' '.join(each['query'].split())[:300]}"
        for each in statements
    ]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "statements.txt").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
