"""Keeps the logs of a local system small: a log that has grown is set aside, a few are kept."""

import asyncio
import os
import shutil
from pathlib import Path
from typing import Final

from skyway.cli.data_folder import DataFolder

#: A log above this size is set aside, bytes.
LOG_BYTES: Final = 20 << 20
#: How many logs of a process are kept beside the present one: `gateway.log.1` is the newest.
KEPT: Final = 4
#: Seconds of wall time between two looks.
_EVERY_S: Final = 30.0


def rotate(log: Path, *, most_bytes: int = LOG_BYTES) -> bool:
    """Set a log aside if it is larger; True if it was.

    The process goes on writing into the same file, which it appends to. Lines that it writes
    between the copy and the cut are lost.
    """
    if log.stat().st_size <= most_bytes:
        return False
    for number in range(KEPT, 1, -1):
        older = _aside(log, number - 1)
        if older.exists():
            older.replace(_aside(log, number))
    shutil.copy2(log, _aside(log, 1))
    os.truncate(log, 0)
    return True


async def keep_logs_small(folder: DataFolder) -> None:
    """Look at all logs from time to time, until cancelled."""
    while True:
        for log in folder.logs.glob("*.log"):
            await asyncio.to_thread(rotate, log)
        await asyncio.sleep(_EVERY_S)


def _aside(log: Path, number: int) -> Path:
    return log.with_name(f"{log.name}.{number}")
