"""The supervisor's part of the fleet clock: the anchor it writes, and the heartbeat it keeps.

Fleet time never goes back: a start anchors after the last heartbeat of the one before.
"""

import asyncio
import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

from skyway.cli.data_folder import DataFolder

#: How often the supervisor notes the fleet time reached, wall seconds.
_HEARTBEAT_S = 1.0


def anchor_clock(folder: DataFolder, *, rate: float) -> None:
    """Write the anchor for this start, after everything that the last one can have reached."""
    wall_at = datetime.now(UTC)
    fleet_at = wall_at
    if folder.heartbeat_file.exists():
        last = json.loads(folder.heartbeat_file.read_text())
        # The clock ran on after the last heartbeat: for at most one interval, doubled to be safe.
        unseen = timedelta(seconds=2 * _HEARTBEAT_S * last["rate"])
        fleet_at = max(fleet_at, datetime.fromisoformat(last["fleet_at"]) + unseen)
    _replace(
        folder.clock_file,
        {"fleet_at": fleet_at.isoformat(), "wall_at": wall_at.isoformat(), "rate": rate},
    )
    _note(folder, fleet_at, rate)


async def keep_heartbeat(folder: DataFolder) -> None:
    """Note the fleet time reached, for ever."""
    anchor = json.loads(folder.clock_file.read_text())
    fleet_at, wall_at = (datetime.fromisoformat(anchor[name]) for name in ("fleet_at", "wall_at"))
    while True:
        reached = fleet_at + (datetime.now(UTC) - wall_at) * anchor["rate"]
        _note(folder, reached, anchor["rate"])
        await asyncio.sleep(_HEARTBEAT_S)


def _note(folder: DataFolder, fleet_at: datetime, rate: float) -> None:
    _replace(folder.heartbeat_file, {"fleet_at": fleet_at.isoformat(), "rate": rate})


def _replace(path: Path, content: dict[str, str | float]) -> None:
    draft = path.with_suffix(".draft")
    draft.write_text(json.dumps(content) + "\n")
    draft.replace(path)
