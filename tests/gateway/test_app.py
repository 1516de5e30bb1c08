"""The gateway as a process: it starts without its peers and recovers after a kill."""

import asyncio
import json
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from skyway_gateway.app import openapi_app
from skyway_gateway.forward.table import FORWARDED
from skyway_gateway.settings import GatewaySettings
from skyway_verifier.check import verify

from skyway.runtime.clock import load_clock
from skyway.runtime.errors import InvalidSettings
from tests.gateway.whole_gateway import VAULT_KEY
from tests.signing_files import write_cloud_keys

KEY = "sk_operator-0123456789abcdef"


def test_the_document_lists_every_public_call() -> None:
    document = openapi_app().openapi()
    for row in FORWARDED:
        assert row.method.lower() in document["paths"][row.path]
    ids = [one["operationId"] for calls in document["paths"].values() for one in calls.values()]
    assert len(ids) == len(set(ids))


def test_settings_read_networks_and_name_what_is_missing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name in list(os.environ):
        if name.startswith("SKYWAY_"):
            monkeypatch.delenv(name)
    monkeypatch.setenv("SKYWAY_DATABASE_URL", "sqlite:///x.db")
    monkeypatch.setenv("SKYWAY_MQTT_URL", "mqtt://127.0.0.1")
    with pytest.raises(InvalidSettings, match="SKYWAY_SECRETS_DIR"):
        GatewaySettings.load()
    monkeypatch.setenv("SKYWAY_SECRETS_DIR", str(tmp_path))
    assert GatewaySettings.load().webhook_allow_networks == ()
    monkeypatch.setenv("SKYWAY_WEBHOOK_ALLOW_NETWORKS", "127.0.0.0/8, fd00::/8")
    networks = GatewaySettings.load().webhook_allow_networks
    assert [str(one) for one in networks] == ["127.0.0.0/8", "fd00::/8"]
    monkeypatch.setenv("SKYWAY_WEBHOOK_ALLOW_NETWORKS", "everything")
    with pytest.raises(InvalidSettings, match="SKYWAY_WEBHOOK_ALLOW_NETWORKS"):
        GatewaySettings.load()


@pytest.mark.parametrize(
    ("host", "port", "expected"),
    [
        ("127.0.0.1", 8000, "http://127.0.0.1:8000/"),
        ("localhost", 9000, "http://localhost:9000/"),
        ("::1", 8000, "http://[::1]:8000/"),
        ("0.0.0.0", 8000, None),
        ("::", 8000, None),
        ("192.0.2.7", 8000, None),
        ("skyway.example.org", 8000, None),
        ("127.0.0.1", 0, None),
    ],
)
def test_the_public_address_is_demanded_where_the_gateway_is_not_on_loopback(
    host: str, port: int, expected: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = {
        "DATABASE_URL": "sqlite:///x.db",
        "MQTT_URL": "mqtt://127.0.0.1",
        "SECRETS_DIR": "secrets",
        "HOST": host,
        "PORT": str(port),
    }
    for name, value in given.items():
        monkeypatch.setenv(f"SKYWAY_{name}", value)
    monkeypatch.delenv("SKYWAY_PUBLIC_URL", raising=False)

    if expected is None:
        with pytest.raises(InvalidSettings, match=r"SKYWAY_PUBLIC_URL: .*is needed where the"):
            GatewaySettings.load()
    else:
        assert str(GatewaySettings.load().public_url) == expected

    monkeypatch.setenv("SKYWAY_PUBLIC_URL", "https://skyway.example.org")
    assert str(GatewaySettings.load().public_url) == "https://skyway.example.org/"


def test_links_begin_with_the_address_of_a_passed_socket() -> None:
    needed = {"database_url": "sqlite:///x.db", "mqtt_url": "mqtt://x", "secrets_dir": "x"}
    with socket.create_server(("127.0.0.1", 0)) as listener:
        passed = GatewaySettings.model_validate({**needed, "socket_fd": listener.fileno()})

        assert str(passed.public_url) == f"http://127.0.0.1:{listener.getsockname()[1]}/"

    with (
        socket.create_server(("0.0.0.0", 0)) as listener,
        pytest.raises(ValueError, match="is needed where the gateway listens on"),
    ):
        GatewaySettings.model_validate({**needed, "socket_fd": listener.fileno()})


class Process:
    """The gateway on a socket of the test, as the supervisor runs it; its peers are away."""

    def __init__(self, folder: Path) -> None:
        secrets = folder / "secrets"
        secrets.mkdir()
        for name in ("service_gateway", "service_composition", "mqtt_gateway", "mqtt_operator"):
            (secrets / name).write_text("0123456789abcdef")
        write_cloud_keys(secrets)
        (secrets / "operator_key").write_text(KEY)
        (secrets / "tracking_key").write_text("a key of tracking links")
        (secrets / "webhook_keys").write_text(VAULT_KEY)
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self.listener.getsockname()[1]}"
        self.environment = {
            **{name: value for name, value in os.environ.items() if name[:7] != "SKYWAY_"},
            "SKYWAY_DATABASE_URL": f"sqlite:///{folder}/gateway.db",
            "SKYWAY_MQTT_URL": "mqtt://127.0.0.1:1",
            "SKYWAY_REGISTRY_URL": "http://127.0.0.1:1",
            "SKYWAY_COMPOSITION_URL": "http://127.0.0.1:1",
            "SKYWAY_SECRETS_DIR": str(secrets),
            "SKYWAY_SOCKET_FD": str(self.listener.fileno()),
        }
        self.log = (folder / "log").open("ab")
        self.running: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        self.running = subprocess.Popen(
            [sys.executable, "-m", "skyway_gateway"],
            env=self.environment,
            pass_fds=[self.listener.fileno()],
            stderr=self.log,
        )

    def kill(self) -> None:
        assert self.running is not None
        self.running.kill()
        self.running.wait()

    def close(self) -> None:
        if self.running is not None and self.running.poll() is None:
            self.running.terminate()
            assert self.running.wait(10) == 0
        self.listener.close()
        self.log.close()


@pytest.fixture
def process(tmp_path: Path) -> Iterator[Process]:
    started = Process(tmp_path)
    started.start()
    yield started
    started.close()


@pytest.mark.integration
def test_an_issued_key_survives_a_kill(process: Process) -> None:
    headers = {"Authorization": f"Bearer {KEY}", "Idempotency-Key": "k"}
    # With scopes it has no broker account, so the registry is not needed.
    body = {"role": "operator", "subject_id": "olga", "scopes": ["deliveries:read"]}
    with httpx.Client(base_url=process.url, timeout=60) as client:
        # The socket is open before the process is ready: the call waits for it.
        first = client.post("/v1/keys", json=body, headers=headers)
        assert first.status_code == 201, first.text
        assert client.get("/healthz").status_code == 200
        ready = client.get("/readyz")
        assert (ready.status_code, ready.json()["checks"]["mqtt"]) == (200, False)
        assert client.get("/v1/networks", headers=headers).status_code == 503
    process.kill()
    process.start()
    with httpx.Client(base_url=process.url, timeout=60) as client:
        again = client.post("/v1/keys", json=body, headers=headers)
    assert again.json() == first.json()
    verified = verify({"gateway": process.environment["SKYWAY_DATABASE_URL"]}, load_clock(None))
    assert (verified.broken, verified.errors) == ({"gateway": []}, {})


@pytest.mark.integration
async def test_an_open_stream_does_not_hold_up_the_exit(
    process: Process, request_body: Any
) -> None:
    headers = {"Authorization": f"Bearer {KEY}"}
    async with httpx.AsyncClient(base_url=process.url, timeout=60) as client:
        await client.get("/v1/clock", headers=headers)
        await asyncio.to_thread(_insert_delivery, process, request_body())
        path = "/v1/deliveries/dlv_1/events"
        async with client.stream("GET", path, headers=headers) as left:
            assert left.status_code == 200, await left.aread()
        async with client.stream("GET", path, headers=headers) as stays:
            assert stays.status_code == 200
            assert process.running is not None
            process.running.terminate()
            assert await asyncio.to_thread(process.running.wait, 10) == 0


def _insert_delivery(process: Process, body: dict[str, Any]) -> None:
    import sqlite3

    path = process.environment["SKYWAY_DATABASE_URL"].removeprefix("sqlite:///")
    with sqlite3.connect(path) as database:
        database.execute(
            "INSERT INTO deliveries (delivery_id, customer_id, state, is_delayed, is_replanning,"
            " request, pickup_position, created_ms, updated_ms, give_up_ms, attempt, refusals,"
            " reasons, last_sequence, next_try_wall_ms) VALUES ('dlv_1', 'alice', 'PLANNED',"
            " 0, 0, ?, '[0, 0]', 0, 0, 0, 1, '[]', '[]', 0, 0)",
            (json.dumps(body),),
        )
    database.close()
