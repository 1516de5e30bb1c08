"""Running systems: on SQLite with the embedded broker, or on PostgreSQL with Mosquitto.

A story runs on one pair of database and broker. The tests of stores and of brokers run on both.
"""

import asyncio
import contextlib
import os
import secrets
import shutil
import socket
import subprocess
from collections.abc import Iterator

import asyncpg
import pytest
from playwright.sync_api import Browser

from skyway.cli.data_folder import DataFolder
from tests.end_to_end.browser import log_out, opened_browser
from tests.end_to_end.local_system import LocalSystem

#: Databases with their brokers.
PAIRS = {"embedded": (), "postgresql-mosquitto": (pytest.mark.integration,)}
DATABASES = ("skyway_registry", "skyway_composition", "skyway_gateway")


#: From this port on, Linux hands ports to connections and to sockets that ask for any port.
_FIRST_EPHEMERAL_PORT = 32_768


def free_port() -> int:
    """A free port that Linux gives to no other process before the broker listens on it."""
    while True:
        port = secrets.randbelow(_FIRST_EPHEMERAL_PORT // 2) + _FIRST_EPHEMERAL_PORT // 2
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Give a story a system on the pair of database and broker that matters for the story.

    Stories with another `system_name` get a system of their own, which another process may run.
    """
    if "running_system" not in metafunc.fixturenames:
        return
    pair = metafunc.definition.get_closest_marker("storage_pair")
    if pair is None:
        pytest.fail(f"{metafunc.definition.nodeid} does not name its storage_pair")
    [name] = pair.args
    rate = metafunc.definition.get_closest_marker("fleet_rate")
    fleet_rate = rate.args[0] if rate else LocalSystem.rate
    named = metafunc.definition.get_closest_marker("system_name")
    names = named.args if named else ()
    parts = [name, f"{fleet_rate:g}", *names]
    # Equal parameters are one system, also with different ids.
    system = pytest.param((name, fleet_rate, *names), id="-".join(parts), marks=PAIRS[name])
    metafunc.parametrize("running_system", [system], indirect=True, scope="package")


@pytest.fixture(scope="package")
def running_system(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[LocalSystem]:
    """A running system, shared by all tests on this storage pair and at this fleet rate.

    After the last of these tests, the databases must break no rule of `skyway verify`.
    """
    pair, rate, *_ = request.param
    folder = DataFolder(tmp_path_factory.mktemp("system") / "data")
    folder.make()
    environment = {
        name: value for name, value in os.environ.items() if not name.startswith("SKYWAY_")
    }
    environment["SKYWAY_HOLD_S"] = "8"  # held offers begin after that
    broker: subprocess.Popen[bytes] | None = None
    mosquitto: str | None = None
    if pair != "embedded":
        mosquitto = shutil.which("mosquitto", path=f"{os.environ['PATH']}:/usr/sbin")
        if mosquitto is None:
            pytest.skip("Mosquitto is not installed")
        environment |= {
            "SKYWAY_DATABASE_URL": request.getfixturevalue("postgresql_server").url("postgres"),
            "SKYWAY_MQTT_URL": f"mqtt://127.0.0.1:{free_port()}",
            "SKYWAY_MQTT_DRONE_URL": f"mqtt://127.0.0.1:{free_port()}",
            "SKYWAY_MQTT_TLS_URL": f"mqtts://127.0.0.1:{free_port()}",
        }
    local = LocalSystem(folder, environment, rate=rate)
    try:
        if mosquitto is not None:
            made = local.command("secrets", "--tls-name", "127.0.0.1")
            assert made.returncode == 0, made.stderr
            configuration = str(folder.broker / "mosquitto.conf")
            broker = subprocess.Popen([mosquitto, "-c", configuration], stderr=subprocess.DEVNULL)
        local.start()
        yield local
        assert local.broken_rules() == []
    finally:
        local.stop()
        if broker is not None:
            # Mosquitto stores nothing, so it has nothing to write before it ends.
            broker.kill()
            broker.wait()
            asyncio.run(_drop_databases(environment["SKYWAY_DATABASE_URL"]))


@pytest.fixture
def system(running_system: LocalSystem) -> Iterator[LocalSystem]:
    """A running system. Earlier tests have left networks and drones in it."""
    yield running_system
    running_system.stop_fleets()


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    """The browser of one file: while it is open, no test can run an event loop of its own."""
    with opened_browser() as opened:
        yield opened


@pytest.fixture
def browser(chromium: Browser) -> Iterator[Browser]:
    """A browser that closes its pages after the story: they would go on drawing beside the next."""
    yield chromium
    log_out(chromium)


async def _drop_databases(server: str) -> None:
    connection = await asyncpg.connect(server)
    try:
        for name in DATABASES:
            await connection.execute(f'DROP DATABASE IF EXISTS "{name}" WITH (FORCE)')
    finally:
        await connection.close()
