"""A journal that has changed on the disk is set aside, and never believed."""

import random
from datetime import UTC, datetime
from pathlib import Path

import pytest
from skyway_drone_agent.journal.journal import FileJournal
from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.journal.records import EventRecorded

from skyway.contracts.drone_report import DroneEvent
from skyway.geo import Position
from skyway.ids import StationId

NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)
HOME = Logbook(station_id=StationId("home"), position=Position(-98.0, 30.0), soc=1.0)
AWAY = HOME.model_copy(
    update={"station_id": StationId("away"), "position": Position(-97.0, 30.0), "soc": 0.4}
)


def make_event(seq: int) -> EventRecorded:
    return EventRecorded(
        event=DroneEvent(
            message_id=f"msg_{seq}",
            sent_at=NOON,
            session=7,
            seq=seq,
            event="ALARM",
            stream=3,
            ended_at=NOON,
            position=AWAY.position,
            soc=0.4,
        )
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "drn_1.jsonl"
    journal = FileJournal(path)
    journal.compact(AWAY.model_copy(update={"session": 7, "first_session": 5, "stream": 3}))
    journal.append([make_event(1)])
    journal.append([make_event(2), make_event(3)])
    return path


def test_no_flipped_bit_is_believed_and_none_stops_the_drone(path: Path) -> None:
    whole = path.read_bytes()
    written = FileJournal(path).read(at_first=HOME)
    chance = random.Random(1)
    for bit in chance.sample(range(8 * len(whole)), 300):
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)

        read = FileJournal(path).read(at_first=HOME)

        is_lost = read.first_session == 0 and read.stream == 0 and not read.events
        assert is_lost or read == written, bit


def test_a_damaged_journal_is_kept_for_people_and_counts_as_lost(path: Path) -> None:
    damaged = path.read_bytes().replace(b'"seq":2', b'"seq":9')
    path.write_bytes(damaged)

    read = FileJournal(path).read(at_first=HOME)

    assert read.first_session == read.stream == read.last_event_seq == 0
    assert read.session == 7, "the next session must be higher"
    assert (read.station_id, read.soc) == ("away", 0.4)
    assert not path.exists()
    assert path.with_suffix(".damaged-1").read_bytes() == damaged


def test_a_second_damaged_journal_does_not_replace_the_first(path: Path) -> None:
    for _ in range(2):
        path.write_bytes(b"damage\n")
        FileJournal(path).read(at_first=HOME)

    assert path.with_suffix(".damaged-1").exists()
    assert path.with_suffix(".damaged-2").exists()


def test_a_journal_whose_first_line_is_damaged_begins_as_the_drone_was_enrolled(
    path: Path,
) -> None:
    path.write_bytes(b"x" + path.read_bytes())

    assert FileJournal(path).read(at_first=HOME) == HOME


def test_a_missing_line_end_loses_nothing(path: Path) -> None:
    whole = path.read_bytes()
    written = FileJournal(path).read(at_first=HOME)
    for changed in (whole[:-1], whole[:-1] + b"\x0b"):
        path.write_bytes(changed)

        assert FileJournal(path).read(at_first=HOME) == written


def test_a_line_without_a_checksum_among_others_is_damaged(path: Path) -> None:
    with path.open("a") as file:
        file.write(make_event(4).model_dump_json() + "\n")

    assert FileJournal(path).read(at_first=HOME).last_event_seq == 0
