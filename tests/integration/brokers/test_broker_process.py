"""`python -m skyway_broker` as its supervisor sees it."""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from skyway.broker_setup.passwords import hash_password, write_password_file


class Process:
    def __init__(self, folder: Path) -> None:
        write_password_file(folder / "passwords", {"p/drone-1": hash_password("p/drone-1")})
        listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = listener.getsockname()[1]
        theirs, self._ours = os.pipe()
        variables = {
            "SKYWAY_BROKER_PASSWORD_FILE": str(folder / "passwords"),
            "SKYWAY_SOCKET_FD": str(listener.fileno()),
            "SKYWAY_PARENT_FD": str(theirs),
        }
        self.running = subprocess.Popen(
            [sys.executable, "-W", "error", "-m", "skyway_broker"],
            env=os.environ | variables,
            pass_fds=(listener.fileno(), theirs),
            stderr=subprocess.PIPE,
        )
        listener.close()
        os.close(theirs)

    def drop_pipe(self) -> None:
        if self._ours >= 0:
            os.close(self._ours)
            self._ours = -1


@pytest.fixture
def process(tmp_path: Path) -> Iterator[Process]:
    process = Process(tmp_path)
    with process.running:
        yield process
        process.drop_pipe()
        process.running.kill()


async def test_the_broker_serves_on_the_socket_of_its_parent(process, connect):
    drone = await connect(process.port, "p/drone-1")

    await drone.wait_connected()

    assert process.running.poll() is None


async def test_the_broker_exits_when_its_parent_is_gone(process, connect):
    drone = await connect(process.port, "p/drone-1")
    await drone.wait_connected()

    process.drop_pipe()

    assert process.running.wait(timeout=60) == 0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
async def test_the_broker_stops_in_order_on_a_signal(process, connect, number):
    drone = await connect(process.port, "p/drone-1")
    await drone.wait_connected()

    process.running.send_signal(number)

    _, errors = process.running.communicate(timeout=60)
    assert process.running.returncode == 0
    assert b"Traceback" not in errors
    assert b'"event": "broker stopped"' in errors


@pytest.mark.parametrize(
    ("variables", "named"),
    [
        ({}, b"SKYWAY_BROKER_PASSWORD_FILE"),
        (
            {"SKYWAY_BROKER_PASSWORD_FILE": "x", "SKYWAY_BROKER_PORT": "many"},
            b"SKYWAY_BROKER_PORT",
        ),
    ],
)
def test_a_wrong_environment_variable_is_named_in_the_error(variables, named):
    environment = {key: value for key, value in os.environ.items() if "SKYWAY" not in key}

    left = subprocess.run(
        [sys.executable, "-m", "skyway_broker"],
        env=environment | variables,
        capture_output=True,
        check=False,
        timeout=60,
    )

    assert left.returncode == 2
    assert named in left.stderr
