"""The servers of a benchmark end with it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from skyway_lab.benchmarks.load.servers import Server, postgresql_program

from skyway.errors import SkywayError

#: Starts both servers, prints their process ids, and waits. It ignores Ctrl-C, as a program does
#: that a script has started in the background.
_PROGRAM = """
import asyncio, pathlib, signal, sys
from skyway_lab.benchmarks.load.storage_pair import storage_pair
from skyway.cli.data_folder import DataFolder

signal.signal(signal.SIGINT, signal.SIG_IGN)
folder = DataFolder(pathlib.Path(sys.argv[1]))
folder.make()
with storage_pair("production", folder) as servers:
    print(*(each.pid for each in servers.values()), flush=True)
    asyncio.run(asyncio.Event().wait())
"""

#: Does nothing about the first signal.
_LOSES_ONE = """
import signal

signal.signal(signal.SIGTERM, lambda *_: signal.signal(signal.SIGTERM, signal.SIG_DFL))
print("ready", flush=True)
while True:
    signal.pause()
"""


def _has_servers() -> bool:
    try:
        postgresql_program("initdb")
    except SkywayError:
        return False
    return shutil.which("mosquitto", path=f"{os.environ['PATH']}:/usr/sbin") is not None


@pytest.mark.long
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


def test_a_server_that_loses_the_first_signal_is_asked_again(tmp_path: Path) -> None:
    server = Server("server", [sys.executable, "-c", _LOSES_ONE], tmp_path / "log")
    server.start()
    while not (tmp_path / "log").read_text():
        assert server.pids != []

    server.stop()

    assert server.pids == []
