"""The supervisor's part of the fleet clock: the anchor it writes, and the heartbeat it keeps.

Fleet time never goes back, and it runs on while the system stands still: drones elsewhere go by
the anchor they know, and fly on by it. So a start anchors where the clock of the one before is.
"""

import asyncio
import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

from skyway.cli.data_folder import DataFolder

#: How often the supervisor notes the fleet time reached, wall seconds.
_HEARTBEAT_S = 1.0

#: The clock ran on after the last heartbeat: for at most one interval, doubled to be safe. A
#: machine's clock that was set back says less.
_RAN_ON_AT_LEAST = timedelta(seconds=2 * _HEARTBEAT_S)

#: A folder that nobody used for longer has no drones that fly on: its time runs on no further.
_RUNS_ON_AT_MOST = timedelta(days=1)

#: Until then all drones have heard that the clock is slower from now on; wall time.
_HEARD_WITHIN = timedelta(minutes=1)


def anchor_clock(folder: DataFolder, *, rate: float) -> None:
    """Write the anchor for this start, after everything that anybody can have reached."""
    wall_at = datetime.now(UTC)
    fleet_at = max(wall_at, _reached(folder, wall_at, next_rate=rate))
    _replace(folder.clock_file, fleet_at, wall_at, rate=rate)
    _replace(folder.heartbeat_file, fleet_at, wall_at, rate=rate)


async def keep_heartbeat(folder: DataFolder) -> None:
    """Note the fleet time reached, for ever."""
    anchor = json.loads(folder.clock_file.read_text())
    fleet_at, wall_at = (datetime.fromisoformat(anchor[name]) for name in ("fleet_at", "wall_at"))
    rate = anchor["rate"]
    while True:
        now = datetime.now(UTC)
        _replace(folder.heartbeat_file, fleet_at + (now - wall_at) * rate, now, rate=rate)
        await asyncio.sleep(_HEARTBEAT_S)


def _reached(folder: DataFolder, wall_at: datetime, *, next_rate: float) -> datetime:
    """What the clock of the last start shows now, or will before the next rate is known."""
    if not folder.heartbeat_file.exists():
        return wall_at
    last = json.loads(folder.heartbeat_file.read_text())
    # The heartbeat of an older Skyway does not say when it was.
    noted_at = datetime.fromisoformat(last.get("wall_at", wall_at.isoformat()))
    ran_on = min(max(wall_at - noted_at, _RAN_ON_AT_LEAST), _RUNS_ON_AT_MOST)
    slower_by = max(float(last["rate"]) - next_rate, 0.0)
    fleet_at = datetime.fromisoformat(last["fleet_at"])
    return fleet_at + ran_on * float(last["rate"]) + _HEARD_WITHIN * slower_by


def _replace(path: Path, fleet_at: datetime, wall_at: datetime, *, rate: float) -> None:
    content = {"fleet_at": fleet_at.isoformat(), "wall_at": wall_at.isoformat(), "rate": rate}
    draft = path.with_suffix(".draft")
    draft.write_text(json.dumps(content) + "\n")
    draft.replace(path)
