"""The supervisor's part of the fleet clock: it writes the anchor and a heartbeat.

Fleet time never goes back, and it runs on while the system is stopped: drones elsewhere fly on by
the last anchor. So each start continues the clock of the previous start.
"""

import asyncio
import json
import os
import time
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path

from skyway.cli.data_folder import DataFolder

#: Wall seconds between two heartbeats, which store the fleet time.
_HEARTBEAT_S = 1.0

#: The clock ran on for at most one interval after the last heartbeat, doubled to be safe. A
#: machine's clock that was set back would show less.
_RAN_ON_AT_LEAST = timedelta(seconds=2 * _HEARTBEAT_S)

#: In a folder that was not used for longer no drone still flies: its time runs on no further.
_RUNS_ON_AT_MOST = timedelta(days=1)

#: After this wall time all drones have received a new, slower rate.
_RATE_RECEIVED_WITHIN = timedelta(minutes=1)

#: The small world's rate on a machine of this speed or faster; the speed is 1 where the sum of
#: `machine_speed` takes 50 ms on two processors.
_RATES = ((0.5, 60.0), (0.25, 30.0), (0.0, 15.0))


def rate_for(speed: float) -> float:
    """How fast the small world's time runs, so that programs of a slow machine keep up with it."""
    return next(rate for least, rate in _RATES if speed >= least)


def machine_speed() -> float:
    """How fast this machine works now, beside all else that it does."""
    began_s = time.perf_counter()
    sum(number * number for number in range(1_000_000))
    took_s = time.perf_counter() - began_s
    return 0.05 / took_s * min(os.cpu_count() or 1, 2) / 2


def anchor_clock(folder: DataFolder, *, rate: float) -> None:
    """Write the anchor for this start, later than any fleet time reached so far."""
    wall_at = datetime.now(UTC)
    fleet_at = max(wall_at, _reached(folder, wall_at, next_rate=rate))
    _replace(folder.clock_file, fleet_at, wall_at, rate=rate)
    _replace(folder.heartbeat_file, fleet_at, wall_at, rate=rate)


async def keep_heartbeat(folder: DataFolder) -> None:
    """Store the fleet time again and again; this never returns."""
    anchor = json.loads(folder.clock_file.read_text())
    fleet_at, wall_at = (datetime.fromisoformat(anchor[name]) for name in ("fleet_at", "wall_at"))
    rate = anchor["rate"]
    while True:
        now = datetime.now(UTC)
        # On a full disk the last heartbeat stays, and the next start lets its time run on.
        with suppress(OSError):
            _replace(folder.heartbeat_file, fleet_at + (now - wall_at) * rate, now, rate=rate)
        await asyncio.sleep(_HEARTBEAT_S)


def _reached(folder: DataFolder, wall_at: datetime, *, next_rate: float) -> datetime:
    """The latest fleet time that a drone can reach by the clock of the last start."""
    if not folder.heartbeat_file.exists():
        return wall_at
    last = json.loads(folder.heartbeat_file.read_text())
    noted_at = datetime.fromisoformat(last["wall_at"])
    ran_on = min(max(wall_at - noted_at, _RAN_ON_AT_LEAST), _RUNS_ON_AT_MOST)
    slower_by = max(float(last["rate"]) - next_rate, 0.0)
    fleet_at = datetime.fromisoformat(last["fleet_at"])
    return fleet_at + ran_on * float(last["rate"]) + _RATE_RECEIVED_WITHIN * slower_by


def _replace(path: Path, fleet_at: datetime, wall_at: datetime, *, rate: float) -> None:
    content = {"fleet_at": fleet_at.isoformat(), "wall_at": wall_at.isoformat(), "rate": rate}
    draft = path.with_suffix(".draft")
    draft.write_text(json.dumps(content) + "\n")
    draft.replace(path)
