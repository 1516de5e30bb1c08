"""Mosquitto, started by root, becomes the owner of its files and reads new accounts as it."""

import asyncio
import os
import pwd
import shutil
import signal
import tempfile
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from skyway.broker_setup.passwords import hash_password, write_password_file
from skyway.cli.data_folder import DataFolder
from skyway.cli.main import make_app

pytestmark = [
    pytest.mark.integration,
    pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files to other users"),
]

USER = "nobody"


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch, free_port: Any) -> Iterator[DataFolder]:
    """A data folder that other users can reach; pytest's own are closed to them."""
    monkeypatch.setenv("SKYWAY_MQTT_DRONE_URL", f"mqtt://127.0.0.1:{free_port()}")
    monkeypatch.setenv("SKYWAY_MQTT_URL", f"mqtt://127.0.0.1:{free_port()}")
    with tempfile.TemporaryDirectory() as place:
        Path(place).chmod(0o711)
        yield DataFolder(Path(place) / "data")


async def test_mosquitto_serves_as_its_user_and_reads_new_accounts(
    folder: DataFolder, connect: Any
) -> None:
    program = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")
    if program is None:
        pytest.skip("mosquitto is not installed")
    done = CliRunner().invoke(
        make_app(), ["secrets", "--data", str(folder.path), "--mosquitto-user", USER]
    )
    assert done.exit_code == 0, done.output
    accounts = {name: hash_password(name) for name in ("p/drone-1", "p/drone-2")}
    write_password_file(folder.broker_passwords, {"p/drone-1": accounts["p/drone-1"]})
    port = int(os.environ["SKYWAY_MQTT_DRONE_URL"].rpartition(":")[2])

    async with running(program, folder) as broker:
        await (await connect(port, "p/drone-1")).wait_connected()
        write_password_file(folder.broker_passwords, accounts)
        broker.send_signal(signal.SIGHUP)
        await (await connect(port, "p/drone-2")).wait_connected()

        assert owner_of(broker.pid) == USER
        assert folder.secrets.stat().st_mode & 0o077 == 0


@asynccontextmanager
async def running(program: str, folder: DataFolder) -> AsyncIterator[asyncio.subprocess.Process]:
    broker = await asyncio.create_subprocess_exec(
        program, "-c", str(folder.broker / "mosquitto.conf"), stderr=asyncio.subprocess.DEVNULL
    )
    try:
        yield broker
    finally:
        broker.terminate()
        await broker.wait()


def owner_of(pid: int) -> str:
    return pwd.getpwuid(Path(f"/proc/{pid}").stat().st_uid).pw_name


def test_an_unknown_user_is_refused(folder: DataFolder) -> None:
    done = CliRunner().invoke(
        make_app(), ["secrets", "--data", str(folder.path), "--mosquitto-user", "no-such-user"]
    )

    assert done.exit_code != 0
    assert "no-such-user" in done.output
