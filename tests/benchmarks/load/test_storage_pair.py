"""What remains of a benchmark's servers when the benchmark is ended."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.load.servers import postgresql_program
from skyway.errors import SkywayError

#: Starts both servers, prints their process ids, and waits. It ignores Ctrl-C, as a program does
#: that a script has started in the background.
_PROGRAM = """
import asyncio, pathlib, signal, sys
from benchmarks.load.storage_pair import storage_pair
from skyway.cli.data_folder import DataFolder

signal.signal(signal.SIGINT, signal.SIG_IGN)
folder = DataFolder(pathlib.Path(sys.argv[1]))
folder.make()
with storage_pair("production", folder) as servers:
    print(*(each.pid for each in servers.values()), flush=True)
    asyncio.run(asyncio.Event().wait())
"""


def _has_servers() -> bool:
    try:
        postgresql_program("initdb")
    except SkywayError:
        return False
    return shutil.which("mosquitto", path=f"{os.environ['PATH']}:/usr/sbin") is not None


@pytest.mark.skipif(not _has_servers(), reason="needs PostgreSQL and Mosquitto")
def test_a_benchmark_that_is_terminated_ends_its_servers(tmp_path: Path) -> None:
    command = [sys.executable, "-c", _PROGRAM, str(tmp_path / "data")]
    benchmark = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert benchmark.stdout is not None
    servers = benchmark.stdout.readline().split()

    benchmark.terminate()
    benchmark.terminate()
    benchmark.communicate(timeout=60)

    assert len(servers) == 2
    assert [pid for pid in servers if Path(f"/proc/{pid}").exists()] == []
