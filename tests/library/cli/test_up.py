"""`skyway up` can be stopped at any time, and prints where it answers."""

import asyncio
import os
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

from skyway.cli.data_folder import DataFolder
from skyway.cli.main import make_app
from skyway.cli.system.announce import announce
from skyway.cli.system.running_system import System
from skyway.cli.system.supervisor import Supervisor
from skyway.cli.up import keep_small_world, until_requested
from skyway.errors import SkywayError


@pytest.mark.parametrize("asking", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_system_that_is_still_starting_can_be_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, asking: signal.Signals
) -> None:
    happened: list[str] = []

    @asynccontextmanager
    async def never_ready(*_: object, **__: object) -> AsyncIterator[None]:
        os.kill(os.getpid(), asking)
        try:
            await asyncio.sleep(10)
            happened.append("gave up")
            yield
        finally:
            happened.append("ended")

    monkeypatch.setattr("skyway.cli.system.running_system.running_system", never_ready)

    done = CliRunner().invoke(make_app(), ["up", "--data", str(tmp_path)])

    assert happened == ["ended"]
    assert "has stopped" in done.output


def announced(folder: DataFolder) -> str:
    console = Console(width=80, force_terminal=False)
    urls = {name: f"http://{name}:1" for name in ("registry", "composition", "gateway")}
    system = System(folder, Supervisor(), urls, "mqtt://broker:1883")
    with console.capture() as captured:
        announce(console, system, link="http://gateway:1/console#login=" + "c" * 43)
    return captured.get()


def test_paths_are_printed_in_one_piece_for_those_who_copy_them(tmp_path: Path) -> None:
    folder = DataFolder(tmp_path / ("long-" * 20))

    assert f"source {folder.keys_file} " in announced(folder)


def test_each_service_is_printed_with_its_address(tmp_path: Path) -> None:
    lines = [line.split()[:2] for line in announced(DataFolder(tmp_path)).splitlines()[1:6]]

    assert lines == [
        ["console", "http://gateway:1/console#login=" + "c" * 43],
        ["gateway", "http://gateway:1"],
        ["registry", "http://registry:1"],
        ["composition", "http://composition:1"],
        ["broker", "mqtt://broker:1883"],
    ]


async def test_a_request_of_an_earlier_start_does_not_count(tmp_path: Path) -> None:
    folder = DataFolder(tmp_path)
    folder.small_world_request.touch()

    waiting = asyncio.create_task(until_requested(folder))
    await asyncio.sleep(0)
    assert not waiting.done()
    assert not folder.small_world_request.exists()
    folder.small_world_request.touch()

    async with asyncio.timeout(60):
        await waiting


async def test_a_refused_small_world_can_be_asked_for_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    system = System(DataFolder(tmp_path), Supervisor(), {}, "mqtt://broker:1883")
    attempts = 0
    lines: list[str] = []
    lives = asyncio.Event()

    async def live_on(system: System, *, say: object) -> None:
        nonlocal attempts
        attempts += 1
        if attempts == 1:
            raise SkywayError("POST /v1/keys was answered 403")
        lives.set()
        await asyncio.Event().wait()

    def say(line: str) -> None:
        lines.append(line)
        asyncio.get_running_loop().call_soon(system.folder.small_world_request.touch)

    monkeypatch.setattr("skyway.cli.small_world.living.live_on", live_on)
    keeping = asyncio.create_task(keep_small_world(system, say=say, at_once=True))
    async with asyncio.timeout(60):
        await lives.wait()
    keeping.cancel()

    assert lines == ["The small world does not start: POST /v1/keys was answered 403"]
