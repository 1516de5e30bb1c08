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
from skyway.cli.system import up
from skyway.cli.system.running_system import System
from skyway.cli.system.supervisor import Supervisor


@pytest.mark.parametrize("asking", [signal.SIGINT, signal.SIGTERM])
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

    monkeypatch.setattr(up, "running_system", never_ready)

    done = CliRunner().invoke(make_app(), ["up", "--data", str(tmp_path)])

    assert happened == ["ended"]
    assert "has stopped" in done.output


def test_paths_are_printed_in_one_piece_for_those_who_copy_them(tmp_path: Path) -> None:
    folder = DataFolder(tmp_path / ("long-" * 20))
    console = Console(width=80, force_terminal=False)
    system = System(folder, Supervisor(), {"gateway": "http://127.0.0.1:8000"}, "mqtt://x:1883")

    with console.capture() as captured:
        up.announce(console, system)

    assert f"source {folder.keys_file} " in captured.get()
