"""The journal of a drone, read from its file. The cloud may not know all of it yet."""

import json
from pathlib import Path
from typing import Any

from skyway_drone_agent.journal.journal import FileJournal
from skyway_drone_agent.journal.logbook import Logbook

from skyway.contracts.drone_report import DroneEvent
from skyway.geo import Position

_EMPTY_LOGBOOK = Logbook(station_id=None, position=Position(0.0, 0.0), soc=1.0)


def logbook_of(system: Any, drone_id: str) -> Logbook:
    """The drone's present logbook, from its journal."""
    return FileJournal(_path(system, drone_id)).read(at_first=_EMPTY_LOGBOOK)


def events_of(system: Any, drone_id: str) -> dict[str, DroneEvent]:
    """The events that the journal holds now, by message id.

    An agent that starts drops the events that the cloud has confirmed.
    """
    *whole_lines, _torn = _path(system, drone_id).read_bytes().split(b"\n")
    logbook, *records = (json.loads(line) for line in whole_lines)
    kept = [*logbook["events"], *(each["event"] for each in records if each["kind"] == "EVENT")]
    return {each["message_id"]: DroneEvent.model_validate(each) for each in kept}


def _path(system: Any, drone_id: str) -> Path:
    path: Path = system.folder.journals / f"{drone_id}.jsonl"
    return path
