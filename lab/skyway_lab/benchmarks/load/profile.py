"""What every Python process does during the burst: py-spy, where it is installed."""

import shutil
import signal
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from skyway.errors import SkywayError

#: Samples a second: enough to see what takes a hundredth of a minute, little enough not to hurt.
_PER_S = 100


@contextmanager
def profiled(pids: Mapping[str, int], folder: Path | None) -> Iterator[None]:
    """Leave the collapsed stacks of each process in the folder, a file each."""
    if folder is None:
        yield
        return
    py_spy = shutil.which("py-spy")
    if py_spy is None:
        raise SkywayError("--profile needs py-spy on PATH")
    folder.mkdir(parents=True, exist_ok=True)
    # Threads that only wait hold no lock, and would be most of what is seen.
    record = [py_spy, "record", "--gil", "--rate", str(_PER_S), "--format", "raw"]
    record += ["--duration", "unlimited"]
    watching = [
        subprocess.Popen(
            [*record, "--pid", str(pid), "--output", str(folder / f"{name}.txt")],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for name, pid in pids.items()
    ]
    try:
        yield
    finally:
        for process in watching:
            process.send_signal(signal.SIGINT)  # makes it write what it has
        for process in watching:
            process.wait(timeout=30)
