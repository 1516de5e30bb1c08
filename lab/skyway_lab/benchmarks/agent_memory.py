"""How much memory a drone agent needs, how fast it starts, and what it imports.

`python -m skyway_lab agent_memory [--drones 100]` starts the embedded broker and real agent
processes on loopback, waits until every drone is ONLINE, and reads their resident memory. The
second of two starts counts: the first compiles bytecode, which takes memory of its own.
"""

import argparse
import asyncio
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from skyway_drone_agent.enrolment.enrolled_drone import EnrolledDrone
from skyway_lab.benchmarks.fleet.agents import agent, resident_mib
from skyway_lab.benchmarks.fleet.cloud_messages import publish_clock
from skyway_lab.benchmarks.fleet.crew import accounts_of, crew_of
from skyway_lab.benchmarks.fleet.drone_messages import receiving
from skyway_lab.benchmarks.fleet.own_broker import own_embedded

LIMIT_MIB = 45.0

_ONLINE_WITHIN_S = 60.0

#: Packages whose import time is printed.
_DEAREST = 8

#: The environment without the variable that stops Python from writing bytecode.
ENVIRONMENT = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}


async def measure(folder: Path, url: str, drones: Sequence[EnrolledDrone]) -> tuple[float, float]:
    """Resident MiB and seconds from the start until every drone is ONLINE."""
    await publish_clock(url)
    async with receiving(url) as messages:
        started = time.perf_counter()
        with agent(folder, drones, mqtt_url=url) as pid:
            await messages.wait_online(len(drones), within_s=_ONLINE_WITHIN_S)
            took_s = time.perf_counter() - started
            # One heartbeat of the state, so that everything that is loaded late is loaded.
            await asyncio.sleep(1.0)
            return resident_mib(pid), took_s


def imported() -> list[str]:
    """The top-level packages beside the standard library, and the library's own parts."""
    program = "import sys, skyway_drone_agent.__main__; print(*sys.modules)"
    found = _run("-c", program).stdout.split()
    ours = {".".join(name.split(".")[:2]) for name in found if name.startswith("skyway.")}
    tops = {name.split(".")[0] for name in found} - set(sys.stdlib_module_names)
    return [f"{len(found)} modules", *sorted(tops - {"__main__", "skyway"}), *sorted(ours)]


def dearest_imports(count: int) -> list[str]:
    """The packages whose own modules take longest to import, and how long, as Python measures."""
    lines = _run("-X", "importtime", "-c", "import skyway_drone_agent.__main__").stderr.splitlines()
    took_us: Counter[str] = Counter()
    for line in lines:
        own_us, _, module = line.removeprefix("import time:").split("|")
        if own_us.strip().isdecimal():
            took_us[_package(module.strip())] += int(own_us)
    return [f"{package} {us / 1000:.0f} ms" for package, us in took_us.most_common(count)]


def _package(module: str) -> str:
    top, *below = module.split(".")
    if top in sys.stdlib_module_names:
        return "the standard library"
    return f"{top}.{below[0]}" if top == "skyway" and below else top


def _run(*arguments: str) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True, env=ENVIRONMENT)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drones", type=int, default=100)
    drones = parser.parse_args().drones
    crew = crew_of(drones, seed=1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with own_embedded(folder, accounts_of(crew)) as broker:
            url = broker.drones_url
            asyncio.run(measure(folder, url, crew[:1]))
            one_mib, one_s = asyncio.run(measure(folder, url, crew[:1]))
            many_mib, many_s = asyncio.run(measure(folder, url, crew))
    per_drone_kib = (many_mib - one_mib) / max(1, drones - 1) * 1024
    print(f"one drone: {one_mib:.1f} MiB resident (limit {LIMIT_MIB:g}), ONLINE in {one_s:.2f} s")
    print(f"{drones} drones: {many_mib:.1f} MiB, all ONLINE in {many_s:.2f} s")
    print(f"each further drone: {per_drone_kib:.0f} KiB")
    print("imports:", ", ".join(imported()))
    print("dearest imports:", ", ".join(dearest_imports(_DEAREST)))


if __name__ == "__main__":
    main()
