"""How much memory a drone agent needs, how fast it starts, and what it imports.

`python benchmarks/agent_memory.py [--drones 100]` starts the embedded broker and real agent
processes on loopback, waits until every drone is ONLINE, and reads their resident memory. The
second of two starts counts: the first compiles bytecode, which takes memory of its own.
"""

import argparse
import asyncio
import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from skyway.contracts.topics import CLOCK, CONNECTION
from skyway.contracts.world import ClockAnchor
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.runtime.broker_passwords import hash_password, write_password_file
from skyway.runtime.mqtt import MqttClient

LIMIT_MIB = 45.0

#: A process that is to write bytecode, whatever the shell around it says.
ENVIRONMENT = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}


def fleet_of(count: int) -> list[dict[str, object]]:
    """The registry's answer for so many drones."""
    return [
        {
            "drone_id": f"drn_{number}",
            "provider_id": "prv_1",
            "model": json.loads(DJI_MATRICE_300_RTK.model_dump_json()),
            "home_station_id": "home",
            "home_position": [-98.0, 30.0],
            "soc": 1.0,
            "mqtt": {"user_name": f"drn_{number}", "password": "secret"},
        }
        for number in range(count)
    ]


@contextmanager
def broker(folder: Path, accounts: list[str]) -> Iterator[str]:
    """The embedded broker with these accounts, all with the same password; gives its URL."""
    passwords = folder / "passwords"
    write_password_file(passwords, dict.fromkeys(accounts, hash_password("secret")))
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        running = subprocess.Popen(
            [sys.executable, "-m", "skyway_broker"],
            env={
                **ENVIRONMENT,
                "SKYWAY_SOCKET_FD": str(listener.fileno()),
                "SKYWAY_BROKER_PASSWORD_FILE": str(passwords),
                "SKYWAY_LOG_LEVEL": "WARNING",
            },
            pass_fds=[listener.fileno()],
        )
    try:
        yield f"mqtt://127.0.0.1:{port}"
    finally:
        running.terminate()
        running.wait()


@contextmanager
def agent(folder: Path, url: str, count: int) -> Iterator[subprocess.Popen[bytes]]:
    """An agent that serves so many drones."""
    fleet = folder / f"fleet-{count}.json"
    fleet.write_text(json.dumps(fleet_of(count)))
    command = [sys.executable, "-m", "skyway_drone_agent", "--fleet", str(fleet)]
    command += ["--journal", str(folder / f"journal-{count}"), "--mqtt-url", url]
    running = subprocess.Popen(command, env={**ENVIRONMENT, "SKYWAY_LOG_LEVEL": "WARNING"})
    try:
        yield running
    finally:
        running.terminate()
        running.wait()


def resident_mib(pid: int) -> float:
    """Resident memory of a process."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("VmRSS")).split()[1]) / 1024


async def measure(folder: Path, url: str, count: int) -> tuple[float, float]:
    """Resident MiB and seconds from the start until every drone is ONLINE."""
    moment = datetime.now(UTC)
    anchor = ClockAnchor(
        message_id="msg_1", sent_at=moment, fleet_at=moment, wall_at=moment, rate=1.0
    )
    async with (
        MqttClient(url, client_id="gateway-1", user_name="gateway", password="secret") as gateway,
        MqttClient(url, client_id="operator", user_name="operator", password="secret") as cloud,
    ):
        connections = cloud.batches(CONNECTION)
        await gateway.wait_connected()
        await cloud.wait_connected()
        await gateway.publish(CLOCK(), anchor)
        started = time.perf_counter()
        with agent(folder, url, count) as running:
            sessions: set[tuple[str, int]] = set()
            async for batch in connections:
                for received in batch:
                    if received.message.status == "ONLINE" and not received.retained:
                        sessions.add((received.ids[1], received.message.session))
                if len({drone_id for drone_id, _ in sessions}) >= count:
                    break
            took_s = time.perf_counter() - started
            # One heartbeat of the state, so that everything that is loaded late is loaded.
            await asyncio.sleep(1.0)
            return resident_mib(running.pid), took_s


def imported() -> list[str]:
    """The top-level packages beside the standard library, and the library's own parts."""
    program = "import sys, skyway_drone_agent.__main__; print(*sys.modules)"
    command = [sys.executable, "-c", program]
    found = subprocess.run(
        command, capture_output=True, text=True, check=True, env=ENVIRONMENT
    ).stdout.split()
    ours = {".".join(name.split(".")[:2]) for name in found if name.startswith("skyway.")}
    tops = {name.split(".")[0] for name in found} - set(sys.stdlib_module_names)
    return [f"{len(found)} modules", *sorted(tops - {"__main__", "skyway"}), *sorted(ours)]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drones", type=int, default=100)
    drones = parser.parse_args().drones
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        accounts = ["gateway", "operator", *(f"drn_{number}" for number in range(drones))]
        with broker(folder, accounts) as url:
            asyncio.run(measure(folder, url, 1))
            one_mib, one_s = asyncio.run(measure(folder, url, 1))
            many_mib, many_s = asyncio.run(measure(folder, url, drones))
    per_drone_kib = (many_mib - one_mib) / max(1, drones - 1) * 1024
    print(f"one drone: {one_mib:.1f} MiB resident (limit {LIMIT_MIB:g}), ONLINE in {one_s:.2f} s")
    print(f"{drones} drones: {many_mib:.1f} MiB, all ONLINE in {many_s:.2f} s")
    print(f"each further drone: {per_drone_kib:.0f} KiB")
    print("imports:", ", ".join(imported()))


if __name__ == "__main__":
    main()
