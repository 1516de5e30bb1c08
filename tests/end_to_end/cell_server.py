"""A second server of composition beside a running system, as the cell of some networks."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import httpx

from tests.end_to_end.eventually import LONGEST_WAIT_S, eventually
from tests.end_to_end.local_system import NO_CERTIFICATES, LocalSystem


@dataclass
class CellServer:
    """A process of composition with its own database; it keeps its port when it starts again."""

    name: str
    system: LocalSystem
    port: int
    process: subprocess.Popen[bytes] | None = None

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def database_url(self) -> str:
        return f"sqlite:///{self.system.folder.path / self.name}.db"

    def start(self) -> None:
        folder, urls = self.system.folder, self.system.service_urls
        settings = {
            "SKYWAY_DATABASE_URL": self.database_url,
            "SKYWAY_MQTT_URL": self.system.keys["SKYWAY_MQTT_URL"],
            "SKYWAY_SECRETS_DIR": str(folder.secrets),
            "SKYWAY_CLOCK_FILE": str(folder.clock_file),
            "SKYWAY_CELL_URL": self.url,
            "SKYWAY_PORT": str(self.port),
            **{f"SKYWAY_{name.upper()}_URL": url for name, url in urls.items()},
        }
        with (folder.path / f"{self.name}.log").open("ab") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "skyway_composition"],
                env={**self.system.environment, **settings},
                stdout=log,
                stderr=log,
            )

    def until_ready(self) -> None:
        eventually(self._is_ready, f"{self.name} ready")

    def _is_ready(self) -> bool:
        try:
            answer = httpx.get(f"{self.url}/readyz", timeout=2.0, verify=NO_CERTIFICATES)
        except httpx.TransportError:
            return False
        return answer.is_success

    def stop(self) -> None:
        if self.process is not None:
            self.process.send_signal(signal.SIGTERM)
            self.process.wait(timeout=LONGEST_WAIT_S)
            self.process = None


@contextmanager
def cell_server(name: str, system: LocalSystem, *, port: int) -> Iterator[CellServer]:
    """A server that a test starts, and that ends with the block."""
    server = CellServer(name, system, port)
    try:
        yield server
    finally:
        server.stop()
