"""A system that has run, stopped once for all tests of this folder."""

import asyncio
import os
from collections.abc import Iterator

import pytest

from skyway.cli.data_folder import DataFolder
from skyway.runtime.clock import load_clock
from tests.end_to_end.local_system import LocalSystem
from tests.verification.damaged_copies import StoppedSystem
from tests.verification.stopped_system import RATE, run_and_stop


@pytest.fixture(scope="module")
def stopped_system(
    tmp_path_factory: pytest.TempPathFactory, aside: asyncio.Runner
) -> Iterator[StoppedSystem]:
    """The databases of a system that has flown, on SQLite, for damaging copies of them."""
    folder = DataFolder(tmp_path_factory.mktemp("stopped") / "data")
    folder.make()
    environment = {
        name: value for name, value in os.environ.items() if not name.startswith("SKYWAY_")
    }
    system = LocalSystem(folder, environment, rate=RATE)
    ids = run_and_stop(system)
    opened = StoppedSystem.opened(
        folder.path, ids, tmp_path_factory.mktemp("copies"), clock=load_clock(folder.clock_file)
    )
    copies = aside.run(opened.__aenter__())
    yield copies
    aside.run(opened.__aexit__(None, None, None))
