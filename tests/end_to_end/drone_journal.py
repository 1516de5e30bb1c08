"""What a drone has written down, whether or not the cloud has heard of it."""

import json
from pathlib import Path
from typing import Any

from skyway_drone_agent.journal.journal import FileJournal
from skyway_drone_agent.journal.logbook import Logbook

from skyway.contracts.drone_report import DroneEvent
from skyway.geo import Position

_NOTHING_WRITTEN = Logbook(station_id=None, position=Position(0.0, 0.0), soc=1.0)


def logbook_of(system: Any, drone_id: str) -> Logbook:
    """The sum of the drone's journal."""
    return FileJournal(_path(system, drone_id)).read(at_first=_NOTHING_WRITTEN)


def events_of(system: Any, drone_id: str) -> dict[str, DroneEvent]:
    """The events that the journal holds now, by their message ids.

    Those that the cloud has confirmed are left out when an agent starts.
    """
    *whole_lines, _torn = _path(system, drone_id).read_bytes().split(b"\n")
    logbook, *records = (json.loads(line) for line in whole_lines)
    kept = [*logbook["events"], *(each["event"] for each in records if each["kind"] == "EVENT")]
    return {each["message_id"]: DroneEvent.model_validate(each) for each in kept}


def _path(system: Any, drone_id: str) -> Path:
    path: Path = system.folder.journals / f"{drone_id}.jsonl"
    return path
