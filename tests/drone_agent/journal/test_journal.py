"""The journal keeps its promises, in the file and in its fake alike; one agent serves a drone."""

import contextlib
import errno
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from skyway_drone_agent.journal.flight_recorder import FlightRecorder
from skyway_drone_agent.journal.journal import (
    DroneInUse,
    FileJournal,
    Journal,
    JournalFolder,
    JournalUnwritable,
)
from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.journal.records import Answer, EventRecorded, InstructionAnswered

from skyway.contracts.drone_report import DroneEvent
from skyway.geo import Position
from skyway.ids import DroneId, InstructionId, StationId
from tests.drone_agent.memory_journal import MemoryJournal

NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)
HOME = Logbook(station_id=StationId("home"), position=Position(-98.0, 30.0), soc=1.0)


def make_event(seq: int) -> EventRecorded:
    return EventRecorded(
        event=DroneEvent(
            message_id=f"msg_{seq}",
            sent_at=NOON,
            session=1,
            seq=seq,
            event="ALARM",
            stream=1,
            ended_at=NOON,
            position=HOME.position,
            soc=0.5,
        )
    )


def make_answer(seq: int) -> InstructionAnswered:
    answer = Answer(
        instruction_id=InstructionId(f"ins_{seq}"), stream=1, seq=seq, status="ACCEPTED"
    )
    return InstructionAnswered(answered_at=NOON, answer=answer, instruction=None)


@pytest.fixture(params=["file", "memory"])
def journal(request: pytest.FixtureRequest, tmp_path: Path) -> Journal:
    if request.param == "memory":
        return MemoryJournal()
    made = FileJournal(tmp_path / "drn_1.jsonl")
    made.compact(HOME)
    return made


def test_what_was_appended_is_read_back_in_order(journal: Journal) -> None:
    journal.append([make_answer(1)])
    journal.append([make_event(1), make_event(2)])

    logbook = journal.read(at_first=HOME)

    assert (logbook.stream, logbook.last_instruction_seq) == (1, 1)
    assert [event.seq for event in logbook.events] == [1, 2]


def test_compacting_changes_nothing_in_the_logbook(journal: Journal) -> None:
    journal.append([make_answer(1), make_event(1)])
    before = journal.read(at_first=HOME)

    journal.compact(before)
    journal.append([make_event(2)])

    assert [event.seq for event in journal.read(at_first=HOME).events] == [1, 2]


def test_a_new_journal_begins_as_the_drone_was_enrolled(tmp_path: Path) -> None:
    assert FileJournal(tmp_path / "none.jsonl").read(at_first=HOME) == HOME


@pytest.mark.parametrize("torn_bytes", [2, 10, 60])
def test_a_torn_last_line_is_left_out(tmp_path: Path, torn_bytes: int) -> None:
    path = tmp_path / "drn_1.jsonl"
    journal = FileJournal(path)
    journal.compact(HOME)
    journal.append([make_event(1), make_event(2)])

    path.write_bytes(path.read_bytes()[:-torn_bytes])

    assert [event.seq for event in FileJournal(path).read(at_first=HOME).events] == [1]


@pytest.mark.parametrize("failing", [1, 2, 3])
def test_a_line_torn_by_a_full_disk_is_removed(tmp_path: Path, failing: int) -> None:
    path = tmp_path / "drn_1.jsonl"
    syncs: list[int] = []

    def fill_up(_file: int) -> None:
        syncs.append(1)
        if len(syncs) == failing:
            raise OSError(errno.ENOSPC, "No space left on device")

    FileJournal(path).compact(HOME)
    journal = FileJournal(path, sync=fill_up)
    written = []
    for seq in (1, 2, 3, 4):
        with contextlib.suppress(JournalUnwritable):
            journal.append([make_event(seq)])
            written.append(seq)

    assert len(written) == 3
    assert [one.seq for one in FileJournal(path).read(at_first=HOME).events] == written


def test_a_full_disk_while_compacting_keeps_only_the_old_journal(
    tmp_path: Path,
) -> None:
    path = tmp_path / "drn_1.jsonl"
    FileJournal(path).append([make_event(1)])
    before = path.read_bytes()

    def fill_up(_file: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(JournalUnwritable, match="No space left"):
        FileJournal(path, sync=fill_up).compact(HOME)

    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_each_append_is_on_the_disk_when_it_returns(tmp_path: Path) -> None:
    path = tmp_path / "drn_1.jsonl"
    on_disk: list[int] = []
    journal = FileJournal(path, sync=lambda _file: on_disk.append(path.stat().st_size))
    journal.append([make_event(1)])
    journal.append([make_event(2), make_event(3)])

    assert len(on_disk) == 2
    assert on_disk[-1] == path.stat().st_size


def test_a_compacted_file_and_its_name_are_on_the_disk(tmp_path: Path) -> None:
    path = tmp_path / "drn_1.jsonl"
    synced: list[bool] = []
    journal = FileJournal(path, sync=lambda _file: synced.append(path.exists()))

    journal.compact(HOME)

    assert synced == [False, True]


def test_a_crash_while_compacting_leaves_the_old_journal(tmp_path: Path) -> None:
    path = tmp_path / "drn_1.jsonl"
    FileJournal(path).compact(HOME)
    FileJournal(path).append([make_event(1)])

    def cut_power(_file: int) -> None:
        raise OSError("no power")

    with pytest.raises(JournalUnwritable, match="no power"):
        FileJournal(path, sync=cut_power).compact(HOME)

    assert FileJournal(path).read(at_first=HOME).last_event_seq == 1


def test_a_session_is_above_the_last_one_and_above_the_wall_clock() -> None:
    journal: Any = MemoryJournal()

    first = FlightRecorder(journal, drone_id=DroneId("drn_1"), at_first=HOME)
    first.begin_session(NOON)
    second = FlightRecorder(journal, drone_id=DroneId("drn_1"), at_first=HOME)
    second.begin_session(NOON)

    assert first.logbook.session == int(NOON.timestamp())
    assert second.logbook.session == first.logbook.session + 1


@pytest.mark.parametrize("is_new", [True, False])
def test_a_session_that_began_on_a_full_disk_is_written_whole_once_there_is_room(
    tmp_path: Path, is_new: bool
) -> None:
    path = tmp_path / "drn_1.jsonl"
    if not is_new:
        FileJournal(path).compact(HOME)
        with path.open("a") as torn:
            torn.write('{"kind": "EV')
    is_full = [True]

    def sync(_file: int) -> None:
        if is_full[0]:
            raise OSError(errno.ENOSPC, "No space left on device")

    recorder = FlightRecorder(
        FileJournal(path, sync=sync), drone_id=DroneId("drn_1"), at_first=HOME
    )
    recorder.begin_session(NOON)
    recorder.note(make_event(1))
    assert (recorder.is_full, recorder.written_events) == (True, ())
    assert not recorder.has_session
    with pytest.raises(JournalUnwritable):
        recorder.record(make_answer(1))

    is_full[0] = False
    recorder.record(make_event(2))

    again = FileJournal(path).read(at_first=HOME)
    assert [event.seq for event in again.events] == [1, 2]
    assert (again.last_instruction_seq, again.session) == (0, recorder.logbook.session)
    assert recorder.has_session
    assert len(recorder.written_events) == 2


ONE, TWO, THREE = DroneId("drn_1"), DroneId("drn_2"), DroneId("drn_3")


def test_a_drone_in_use_is_refused_by_name(tmp_path: Path) -> None:
    with (
        JournalFolder(tmp_path / "agent", [ONE, TWO]),
        pytest.raises(DroneInUse, match="drn_2"),
    ):
        JournalFolder(tmp_path / "agent", [TWO, THREE]).__enter__()


def test_a_refused_process_holds_no_drone(tmp_path: Path) -> None:
    with JournalFolder(tmp_path, [TWO]), pytest.raises(DroneInUse):
        JournalFolder(tmp_path, [ONE, TWO]).__enter__()

    with JournalFolder(tmp_path, [ONE]):
        pass


def test_two_fleets_share_a_folder(tmp_path: Path) -> None:
    with JournalFolder(tmp_path, [ONE]), JournalFolder(tmp_path, [TWO]):
        pass


def test_a_drone_is_free_again_afterwards(tmp_path: Path) -> None:
    for _ in range(2):
        with JournalFolder(tmp_path, [ONE]) as folder:
            assert folder.clock_file.parent.is_dir()
