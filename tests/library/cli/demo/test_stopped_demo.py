"""`skyway demo` ends when it is asked to, at any moment."""

import asyncio
import os
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from skyway.cli.data_folder import DataFolder
from skyway.cli.demo import command
from skyway.errors import SkywayError


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
async def test_a_demo_that_waits_for_its_services_ends_when_it_is_asked_to(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, number: signal.Signals
) -> None:
    @asynccontextmanager
    async def never_ready(*_: object, **__: object) -> AsyncIterator[Any]:
        os.kill(os.getpid(), number)
        await asyncio.Event().wait()
        yield

    monkeypatch.setattr("skyway.cli.system.running_system.running_system", never_ready)
    monkeypatch.setattr("skyway.cli.demo.world.rehearse", lambda: 60.0)

    async with asyncio.timeout(60):
        with pytest.raises(SkywayError, match="stopped before the scenario ended"):
            await command._demo(DataFolder(tmp_path), stay=False)
