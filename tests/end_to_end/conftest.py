"""A whole Skyway as a user starts it, on the embedded pair and on PostgreSQL with Mosquitto."""

import asyncio
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import asyncpg
import httpx
import pytest

from skyway.cli.data_folder import DataFolder
from skyway.cli.keys import read_keys

SKYWAY = (sys.executable, "-m", "skyway.cli")
DATABASES = ("skyway_registry", "skyway_composition", "skyway_gateway")

#: Four stations in a line, 11.6 km apart; the drones must recharge on the way.
CORRIDOR: dict[str, Any] = {
    "type": "FeatureCollection",
    "settings": {"currency": "USD", "loading_s": 60, "dropoff_s": 30},
    "features": [
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": [-98.0 + 0.12 * number, 29.5]},
            "properties": {"kind": "station", "station_id": f"s{number}", "pads": 2},
        }
        for number in range(1, 5)
    ]
    + [
        {
            "type": "Feature",
            "geometry": {
                "type": "LineString",
                "coordinates": [[-98.0 + 0.12 * number, 29.5], [-97.88 + 0.12 * number, 29.5]],
            },
            "properties": {"kind": "segment", "from": f"s{number}", "to": f"s{number + 1}"},
        }
        for number in range(1, 4)
    ],
}


#: Wall seconds after which nobody believes any more that it will come, however slow the machine.
PATIENCE_S = 300.0

#: Deliveries in these states stay in them.
TERMINAL = ("COMPLETED", "PARTIALLY_COMPLETED", "CANCELLED", "FAILED", "REJECTED")


def eventually(
    condition: Callable[[], Any], what: str, *, told: Callable[[], object] | None = None
) -> Any:
    """The first true value of a condition on other processes, which only asking can tell.

    `told` is what is there instead, for people who wonder why it never came true.
    """
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        found = condition()
        if found:
            return found
        time.sleep(0.05)
    instead = "" if told is None else f", but {told()}"
    raise AssertionError(f"{what}: not within {PATIENCE_S:g} s{instead}")


@dataclass
class LocalSystem:
    """`skyway up` on a folder of its own, with fleets, and the calls of its users."""

    folder: DataFolder
    environment: dict[str, str]
    up: subprocess.Popen[bytes] | None = None
    fleets: list[subprocess.Popen[bytes]] = field(default_factory=list)
    #: Fleet seconds per wall second.
    rate: float = 900.0

    eventually = staticmethod(eventually)

    def start(self) -> None:
        log = (self.folder.path / "up.log").open("ab")
        command = (*SKYWAY, "up", "--data", self.folder.path, "--rate", self.rate)
        ports = () if self.up else ("--port", "0", "--mqtt-port", "0")
        self.up = subprocess.Popen(
            [str(part) for part in (*command, *ports)],
            stdout=log,
            stderr=log,
            env=self.environment,
        )
        log.close()
        eventually(self._is_up, "skyway up", told=(self.folder.path / "up.log").read_text)

    def _is_up(self) -> bool:
        text = (self.folder.path / "up.log").read_text()
        assert self.up is not None
        assert self.up.poll() is None, text
        return "Skyway is up" in text

    def stop(self) -> None:
        for process in (*self.fleets, self.up):
            if process is not None and process.poll() is None:
                process.send_signal(signal.SIGTERM)
                process.wait(timeout=30)

    @property
    def keys(self) -> dict[str, str]:
        return read_keys(self.folder)

    def call(
        self, method: str, path: str, *, key: str, body: Any = None, **headers: str
    ) -> httpx.Response:
        return httpx.request(
            method,
            self.keys["SKYWAY_GATEWAY_URL"] + path,
            json=body,
            headers={"Authorization": f"Bearer {key}", **headers},
            timeout=30,
        )

    def publish_corridor(self) -> None:
        self.operate("PUT", "/v1/networks/corridor", CORRIDOR)

    def operate(self, method: str, path: str, body: Any = None) -> Any:
        answer = self.call(method, path, key=self.keys["SKYWAY_OPERATOR_KEY"], body=body)
        assert answer.is_success, answer.text
        return answer.json() if answer.content else None

    def command(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*SKYWAY, *arguments, "--data", str(self.folder.path)],
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )

    def start_fleet(
        self,
        homes: list[str],
        *,
        model_id: str = "paper-scenario",
        options: tuple[str, ...] = (),
        **provider: Any,
    ) -> dict[str, Any]:
        """Register a provider with a drone at each home, and run their agent."""
        terms = {"name": "Test Air", "tariff": {"currency": "USD", "base": 100, "per_km": 10}}
        registered = self.operate("POST", "/v1/providers", terms | provider)
        drones = [{"model_id": model_id, "home_station_id": home} for home in homes]
        path = f"/v1/providers/{registered['provider_id']}/drones"
        answer = self.operate("POST", path, drones)
        file = self.folder.path / f"{registered['provider_id']}.json"
        file.write_text(json.dumps(answer))
        self.run_fleet(file, *options)
        self.until_available(registered["provider_id"], drones=len(homes))
        return {**registered, "drones": answer["items"], "file": file}

    def until_available(self, provider_id: str, *, drones: int) -> None:
        """Return once so many drones of a provider, all that it has, can be sent somewhere."""

        def states() -> list[str]:
            known = self.operate("GET", f"/v1/providers/{provider_id}/drones")["items"]
            return [drone["state"] for drone in known]

        eventually(lambda: states() == ["AVAILABLE"] * drones, "all drones available", told=states)

    def run_fleet(self, file: Path, *options: str) -> subprocess.Popen[bytes]:
        log = (self.folder.path / "fleet.log").open("ab")
        process = subprocess.Popen(
            [*SKYWAY, "fleet", str(file), *options, "--data", str(self.folder.path)],
            stdout=log,
            stderr=log,
            env=self.environment,
        )
        log.close()
        self.fleets.append(process)
        return process

    def request_delivery(
        self, destinations: list[str], *, key: str | None = None, pickup: str = "s1"
    ) -> str:
        body = {
            "pickup": {"station_id": pickup},
            "packages": [
                {"package_id": f"p{n}", "mass_kg": 0.5, "destination": {"station_id": place}}
                for n, place in enumerate(destinations, start=1)
            ],
            "qos": {"objective": "fastest"},
        }
        customer_key = key or self.keys["SKYWAY_CUSTOMER_KEY"]
        answer = self.call("POST", "/v1/deliveries", key=customer_key, body=body)
        assert answer.status_code == 202, answer.text
        return str(answer.json()["delivery_id"])

    def delivery(self, delivery_id: str) -> dict[str, Any]:
        key = self.keys["SKYWAY_CUSTOMER_KEY"]
        answer: dict[str, Any] = self.call("GET", f"/v1/deliveries/{delivery_id}", key=key).json()
        return answer

    def until_state(self, delivery_id: str, *states: str) -> dict[str, Any]:
        """The delivery once it is in one of these states, unless it has ended otherwise."""
        found: dict[str, Any] = eventually(
            lambda: (now := self.delivery(delivery_id))["state"] in (*states, *TERMINAL) and now,
            f"delivery in {states}",
            told=lambda: self.delivery(delivery_id),
        )
        assert found["state"] in states, found
        return found

    def until_ended(self, delivery_id: str) -> dict[str, Any]:
        """The delivery once it has ended, in whatever state."""
        return self.until_state(delivery_id, *TERMINAL)

    def kill(self, package: str) -> int:
        """kill -9 the process that runs this package; its id, once it is gone."""
        killed = self.pid_of(package)
        os.kill(killed, signal.SIGKILL)
        for fleet in self.fleets:
            fleet.poll()  # reaps the agent, if it was one
        eventually(lambda: package not in _arguments(killed), f"{package} gone")
        return killed

    def pid_of(self, package: str) -> int:
        """The process that runs this package, below `skyway up` or below a fleet."""
        roots = [process.pid for process in (self.up, *self.fleets) if process is not None]
        found: int = eventually(
            lambda: next(
                (pid for pid in _with_descendants(roots) if package in _arguments(pid)), 0
            ),
            f"a process of {package}",
        )
        return found


def _with_descendants(pids: list[int]) -> Iterator[int]:
    for pid in pids:
        yield pid
        try:
            children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        except OSError:
            continue
        yield from _with_descendants([int(child) for child in children])


def _arguments(pid: int) -> list[str]:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text().split("\0")
    except OSError:
        return []


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@pytest.fixture(
    params=["embedded", pytest.param("postgresql-mosquitto", marks=pytest.mark.integration)]
)
def system(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[LocalSystem]:
    """A running system on each of the two pairs of database and broker."""
    folder = DataFolder(tmp_path / "data")
    folder.make()
    environment = {
        name: value for name, value in os.environ.items() if not name.startswith("SKYWAY_")
    }
    broker: subprocess.Popen[bytes] | None = None
    if request.param != "embedded":
        mosquitto = shutil.which("mosquitto", path=f"{os.environ['PATH']}:/usr/sbin")
        if mosquitto is None:
            pytest.skip("Mosquitto is not installed")
        environment |= {
            "SKYWAY_DATABASE_URL": request.getfixturevalue("postgresql_server"),
            "SKYWAY_MQTT_URL": f"mqtt://127.0.0.1:{free_port()}",
            "SKYWAY_MQTT_DRONE_URL": f"mqtt://127.0.0.1:{free_port()}",
            "SKYWAY_MQTT_TLS_URL": f"mqtts://127.0.0.1:{free_port()}",
        }
    slower = request.node.get_closest_marker("fleet_rate")
    local = LocalSystem(folder, environment, rate=slower.args[0] if slower else LocalSystem.rate)
    try:
        if request.param != "embedded":
            made = local.command("secrets", "--tls-name", "127.0.0.1")
            assert made.returncode == 0, made.stderr
            configuration = str(folder.broker / "mosquitto.conf")
            broker = subprocess.Popen([mosquitto, "-c", configuration], stderr=subprocess.DEVNULL)
        local.start()
        yield local
    finally:
        local.stop()
        if broker is not None:
            broker.terminate()
            broker.wait(timeout=10)
            asyncio.run(_drop_databases(environment["SKYWAY_DATABASE_URL"]))


async def _drop_databases(server: str) -> None:
    connection = await asyncpg.connect(server)
    try:
        for name in DATABASES:
            await connection.execute(f'DROP DATABASE IF EXISTS "{name}" WITH (FORCE)')
    finally:
        await connection.close()
