"""A whole Skyway as a user starts it, in its own folder, and the calls of its users."""

import asyncio
import json
import os
import signal
import ssl
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
from skyway_verifier.rule import BrokenRule

from skyway.cli.data_folder import CLOUD_SERVICES, DataFolder
from skyway.cli.gateway import read_keys
from skyway.runtime.metrics import METRICS_KEY
from skyway.runtime.signing.key_pair import FleetKeys
from tests.end_to_end.corridor_network import corridor
from tests.end_to_end.eventually import LONGEST_WAIT_S, eventually
from tests.end_to_end.verified import broken_rules

SKYWAY = (sys.executable, "-m", "skyway.cli")

#: Deliveries in these states stay in them.
TERMINAL = ("COMPLETED", "PARTIALLY_COMPLETED", "CANCELLED", "FAILED", "REJECTED")

_SERVICES = ("gateway", "registry", "composition")

#: An empty trust store. Calls go over plain HTTP; without it, each would load all certificates.
NO_CERTIFICATES = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)


@dataclass
class LocalSystem:
    """`skyway up` in its own folder, with fleets, and the calls of its users."""

    folder: DataFolder
    environment: dict[str, str]
    up: subprocess.Popen[bytes] | None = None
    fleets: list[subprocess.Popen[bytes]] = field(default_factory=list)
    #: Fleet seconds per wall second.
    rate: float = 900.0
    #: The bytes of the log of `skyway up` that earlier starts have written.
    said_before: int = 0

    eventually = staticmethod(eventually)

    def start(self, *, port: int = 0, mqtt_port: int = 0) -> None:
        log = (self.folder.path / "up.log").open("ab")
        self.said_before = log.tell()
        command = (*SKYWAY, "up", "--data", self.folder.path, "--rate", self.rate)
        ports = ("--port", port, "--mqtt-port", mqtt_port)
        self.up = subprocess.Popen(
            [str(part) for part in (*command, *ports)],
            stdout=log,
            stderr=log,
            env=self.environment,
        )
        log.close()
        eventually(self._is_up, "skyway up", instead=(self.folder.path / "up.log").read_text)

    def _is_up(self) -> bool:
        text = (self.folder.path / "up.log").read_bytes()[self.said_before :].decode()
        assert self.up is not None
        assert self.up.poll() is None, text
        return "Skyway is up" in text

    def stop(self) -> None:
        self.stop_fleets()
        if self.up is not None:
            _end(self.up)

    def restart(self, *, port: int, mqtt_port: int, **environment: str) -> None:
        """Start again with these variables; the drones fly on meanwhile."""
        if self.up is not None:
            _end(self.up)
        self.environment |= environment
        self.start(port=port, mqtt_port=mqtt_port)

    def refusal_to_start(self, *, port: int, mqtt_port: int, **environment: str) -> str:
        """What `skyway up` says when it cannot start with these variables."""
        if self.up is not None:
            _end(self.up)
        ports = ("--port", str(port), "--mqtt-port", str(mqtt_port))
        command = (*SKYWAY, "up", "--data", str(self.folder.path), "--rate", str(self.rate))
        ended = subprocess.run(
            (*command, *ports),
            env=self.environment | environment,
            capture_output=True,
            text=True,
            timeout=LONGEST_WAIT_S,
            check=False,
        )
        assert ended.returncode != 0, ended.stdout
        return ended.stdout + ended.stderr

    def stop_fleets(self) -> None:
        for process in self.fleets:
            _end(process)
        self.fleets.clear()

    @property
    def keys(self) -> dict[str, str]:
        return read_keys(self.folder)

    def call(
        self, method: str, path: str, *, key: str, body: Any = None, **headers: str
    ) -> httpx.Response:
        """The answer. A call that the gateway has no time for is sent again, as clients do."""

        def asked() -> httpx.Response | None:
            now = httpx.request(
                method,
                self.keys["SKYWAY_GATEWAY_URL"] + path,
                json=body,
                headers={"Authorization": f"Bearer {key}", **headers},
                timeout=LONGEST_WAIT_S,
                verify=NO_CERTIFICATES,
            )
            return None if now.status_code == 503 and "OVERLOADED" in now.text else now

        answer: httpx.Response = eventually(asked, "an answer")
        return answer

    @property
    def service_urls(self) -> dict[str, str]:
        """The address of each service, as `skyway up` has printed it last."""
        lines = (self.folder.path / "up.log").read_text().splitlines()
        fields = (line.split() for line in lines)
        # The log also says when a service was started again.
        return {
            each[0]: each[1]
            for each in fields
            if len(each) > 1 and each[0] in _SERVICES and each[1].startswith("http")
        }

    def metrics_of(self, service: str) -> str:
        """What a service answers to GET /metrics."""
        key = (self.folder.secrets / METRICS_KEY).read_text().strip()
        answer = httpx.get(
            f"{self.service_urls[service]}/metrics",
            headers={"Authorization": f"Bearer {key}"},
            timeout=LONGEST_WAIT_S,
            verify=NO_CERTIFICATES,
        )
        assert answer.status_code == 200, answer.text
        return answer.text

    def publish_corridor(self, name: str) -> None:
        """Publish a network for one test. Its stations are name-s1 to name-s4."""
        self.operate("PUT", f"/v1/networks/{name}", corridor(name))

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
            timeout=LONGEST_WAIT_S,
            check=False,
        )

    def broken_rules(self) -> list[BrokenRule]:
        """What `skyway verify` finds in the databases."""
        server = self.environment.get("SKYWAY_DATABASE_URL")
        urls = {
            each: self.folder.database_url(each)
            if server is None
            else server.replace("/postgres?", f"/skyway_{each}?")
            for each in CLOUD_SERVICES
        }
        return asyncio.run(broken_rules(urls))

    def start_fleet(
        self,
        homes: list[str],
        *,
        model_id: str = "paper-scenario",
        options: tuple[str, ...] = (),
        **provider: Any,
    ) -> dict[str, Any]:
        """Register a provider with a drone at each home, and run the agent of these drones."""
        terms = {"name": "Test Air", "tariff": {"currency": "USD", "base": 100, "per_km": 10}}
        registered = self.operate("POST", "/v1/providers", terms | provider)
        drones = [{"model_id": model_id, "home_station_id": home} for home in homes]
        path = f"/v1/providers/{registered['provider_id']}/drones"
        keys = FleetKeys(drones)
        items = keys.kept(self.operate("POST", path, keys.bodies)["items"])
        file = self.folder.path / f"{registered['provider_id']}.json"
        file.write_text(json.dumps({"items": items}))
        self.run_fleet(file, *options)
        self.until_available(registered["provider_id"], drones=len(homes))
        return {**registered, "drones": items, "file": file}

    def until_available(self, provider_id: str, *, drones: int) -> None:
        """Return when the provider has this many drones and all are AVAILABLE."""

        def states() -> list[str]:
            drones_now = self.operate("GET", f"/v1/providers/{provider_id}/drones")["items"]
            return [drone["state"] for drone in drones_now]

        eventually(
            lambda: states() == ["AVAILABLE"] * drones, "all drones available", instead=states
        )

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
        self, destinations: list[str], *, pickup: str, key: str | None = None, **headers: str
    ) -> str:
        body = {
            "pickup": {"station_id": pickup},
            "packages": [
                {"package_id": f"p{n}", "mass_kg": 0.5, "destination": {"station_id": place}}
                for n, place in enumerate(destinations, start=1)
            ],
            "qos": {"objective": "FASTEST"},
        }
        customer_key = key or self.keys["SKYWAY_CUSTOMER_KEY"]
        answer = self.call("POST", "/v1/deliveries", key=customer_key, body=body, **headers)
        assert answer.status_code == 202, answer.text
        return str(answer.json()["delivery_id"])

    def delivery(self, delivery_id: str) -> dict[str, Any]:
        key = self.keys["SKYWAY_CUSTOMER_KEY"]
        answer: dict[str, Any] = self.call("GET", f"/v1/deliveries/{delivery_id}", key=key).json()
        return answer

    def until_state(self, delivery_id: str, *states: str) -> dict[str, Any]:
        """The delivery when it is in one of these states. Fails when it ends in another state."""
        found: dict[str, Any] = eventually(
            lambda: (now := self.delivery(delivery_id))["state"] in (*states, *TERMINAL) and now,
            f"delivery in {states}",
            instead=lambda: self.delivery(delivery_id),
        )
        assert found["state"] in states, found
        return found

    def until_ended(self, delivery_id: str) -> dict[str, Any]:
        """The delivery when it is in a terminal state."""
        return self.until_state(delivery_id, *TERMINAL)

    def kill(self, package: str) -> int:
        """Kill the process that runs this package with SIGKILL; returns its id when it is gone."""
        killed = self.pid_of(package)
        os.kill(killed, signal.SIGKILL)
        for fleet in self.fleets:
            fleet.poll()  # reaps the process if an agent was killed
        eventually(lambda: package not in _arguments(killed), f"{package} gone")
        return killed

    @contextmanager
    def silent(self, package: str) -> Iterator[None]:
        """The process of this package stands still while the block lasts."""
        process = self.pid_of(package)
        os.kill(process, signal.SIGSTOP)
        try:
            yield
        finally:
            os.kill(process, signal.SIGCONT)

    def pid_of(self, package: str) -> int:
        """The process that runs this package: a child of `skyway up` or of a fleet."""
        roots = [process.pid for process in (self.up, *self.fleets) if process is not None]
        found: int = eventually(
            lambda: next(
                (pid for pid in _with_descendants(roots) if package in _arguments(pid)), 0
            ),
            f"a process of {package}",
        )
        return found


def _end(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        process.send_signal(signal.SIGTERM)
        process.wait(timeout=LONGEST_WAIT_S)


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
