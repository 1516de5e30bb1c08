"""Agent processes as `skyway fleet` starts them, and the memory that they take."""

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from skyway_drone_agent.enrolment.enrolled_drone import EnrolledDrone
from skyway_lab.benchmarks.fleet.crew import write_fleet

#: The environment without the variable that stops Python from writing bytecode.
_ENVIRONMENT: Final = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}


@contextmanager
def agent(
    folder: Path, drones: Sequence[EnrolledDrone], *, mqtt_url: str, scenario: str | None = None
) -> Iterator[int]:
    """An agent that serves these drones, until the block ends; its process id."""
    fleet = write_fleet(folder / f"fleet-{drones[0].drone_id}-{len(drones)}.json", drones)
    command = [sys.executable, "-m", "skyway_drone_agent", "--fleet", str(fleet)]
    command += ["--journal", str(folder / f"journal-{fleet.stem}"), "--mqtt-url", mqtt_url]
    command += [] if scenario is None else ["--scenario", scenario]
    log = (folder / f"{fleet.stem}.log").open("ab")
    with log:
        running = subprocess.Popen(
            command, env={**_ENVIRONMENT, "SKYWAY_LOG_LEVEL": "WARNING"}, stderr=log
        )
    try:
        yield running.pid
    finally:
        running.terminate()
        running.wait()


def resident_mib(pid: int) -> float:
    """Resident memory of a process."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("VmRSS")).split()[1]) / 1024
