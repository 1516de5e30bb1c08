"""Reads drones' journals while drones write them, so that nothing is missed when one is rewritten.

A drone that starts rewrites its journal without the events that the cloud has confirmed. The old
file is still open here, and is read to its end before the new one.
"""

import json
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, Final, get_args

from skyway_lab.benchmarks.chaos.evidence import CustodyKind, CustodyStep, Document

from skyway.ids import DeliveryId, DroneId, MissionId, PackageId, StationId

_CUSTODY_KINDS: Final = get_args(CustodyKind)


class OpenJournal:
    """One drone's journal: all events and missions that were ever in it."""

    def __init__(self, path: Path) -> None:
        self.drone_id = DroneId(path.stem)
        self._path = path
        self._file: BinaryIO | None = None
        self._torn = b""
        self._events: dict[str, Document] = {}
        self._deliveries: dict[MissionId, DeliveryId] = {}

    @property
    def mission_ids(self) -> list[MissionId]:
        """The missions that were ever in it, the oldest first."""
        return list(self._deliveries)

    def read(self) -> None:
        """Read what was written since the last call."""
        while True:
            if self._file is not None:
                self._read_on(self._file)
                if self._is_current(self._file):
                    return
                self.close()
            try:
                self._file = self._path.open("rb")
            except FileNotFoundError:
                return

    def close(self) -> None:
        """Close the file; what was read stays."""
        if self._file is not None:
            self._file.close()
            self._file, self._torn = None, b""

    def custody_steps(self) -> Iterator[CustodyStep]:
        """The ends of steps that changed who has packages, the oldest first."""
        for event in sorted(self._events.values(), key=lambda each: int(each["seq"])):
            is_done = event["event"] == "STEP_ENDED" and event.get("code") != "CUT"
            is_unknown = event["event"] == "STEP_FAILED" and event.get("code") == "UNKNOWN"
            if event.get("step_kind") in _CUSTODY_KINDS and (is_done or is_unknown):
                mission_id = MissionId(event["mission_id"])
                yield CustodyStep(
                    drone_id=self.drone_id,
                    kind=event["step_kind"],
                    mission_id=mission_id,
                    delivery_id=self._deliveries.get(mission_id),
                    package_ids=tuple(PackageId(each) for each in event["package_ids"]),
                    station_id=event["station_id"] and StationId(event["station_id"]),
                    is_certain=is_done,
                )

    def _is_current(self, file: BinaryIO) -> bool:
        """Whether the path still leads to this file."""
        with suppress(FileNotFoundError):
            return os.path.samestat(os.fstat(file.fileno()), self._path.stat())
        return False

    def _read_on(self, file: BinaryIO) -> None:
        if os.fstat(file.fileno()).st_size < file.tell():
            # A line that could not be written whole was cut off again.
            file.seek(0)
            self._torn = b""
        *lines, self._torn = (self._torn + file.read()).split(b"\n")
        for line in lines:
            try:
                self._note(json.loads(line))
            except ValueError:
                # The cut came between two readings: this is the middle of a line.
                file.seek(0)
                self._torn = b""
                return self._read_on(file)
        return None

    def _note(self, line: Document) -> None:
        match line.get("kind"):
            case None:
                for event in line["events"]:
                    self._events[event["message_id"]] = event
                if line["mission"] is not None:
                    self._note_mission(line["mission"])
            case "EVENT":
                self._events[line["event"]["message_id"]] = line["event"]
            case "INSTRUCTION" if line["instruction"] is not None:
                self._note_mission(line["instruction"])

    def _note_mission(self, named: Document) -> None:
        if named.get("delivery_id") is not None:
            self._deliveries[MissionId(named["mission_id"])] = DeliveryId(named["delivery_id"])


class Journals:
    """All journals of a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._open: dict[Path, OpenJournal] = {}
        #: Drones whose journals were lost.
        self.lost: set[DroneId] = set()

    def read(self) -> None:
        """Read what was written since the last call."""
        for path in sorted(self._folder.glob("*.jsonl")):
            self._open.setdefault(path, OpenJournal(path)).read()

    def lose(self, drone_id: DroneId) -> None:
        """Remove a journal; what was read stays."""
        (self._folder / f"{drone_id}.jsonl").unlink(missing_ok=True)
        self.lost.add(drone_id)

    def close(self) -> None:
        """Close all files; what was read stays."""
        for journal in self._open.values():
            journal.close()

    def mission_ids(self) -> list[MissionId]:
        """All missions that a drone has accepted or refused."""
        return [each for journal in self._open.values() for each in journal.mission_ids]

    def custody_steps(self) -> list[CustodyStep]:
        """All ends of steps that changed who has packages."""
        return [step for journal in self._open.values() for step in journal.custody_steps()]
