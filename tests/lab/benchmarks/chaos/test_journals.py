"""Reading drones' journals while drones write and rewrite them."""

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from skyway_drone_agent.journal.journal import FileJournal
from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.journal.records import Answer, EventRecorded, InstructionAnswered
from skyway_lab.benchmarks.chaos.evidence import CustodyStep
from skyway_lab.benchmarks.chaos.journals import Journals

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import WaitStep
from skyway.contracts.instruction import MissionInstruction
from skyway.geo import Position
from skyway.ids import DeliveryId, DroneId, InstructionId, MissionId, PackageId, StationId

AT = datetime(2026, 3, 1, tzinfo=UTC)
HERE = Position(-98.0, 29.0)
MISSION, DELIVERY = MissionId("msn_1"), DeliveryId("dlv_1")
LOGBOOK = Logbook(station_id=StationId("home"), position=HERE, soc=1.0)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "drn_1.jsonl"


@pytest.fixture
def journal(path: Path) -> FileJournal:
    journal = FileJournal(path)
    journal.compact(LOGBOOK)
    journal.append([make_instruction()])
    return journal


@pytest.fixture
def journals(tmp_path: Path) -> Iterator[Journals]:
    journals = Journals(tmp_path)
    yield journals
    journals.close()


def make_instruction() -> InstructionAnswered:
    stand = WaitStep(
        step_id=1,
        planned_start_at=AT,
        planned_end_at=AT,
        station_id=StationId("home"),
        until_at=AT,
    )
    mission = MissionInstruction(
        message_id="ins_1",
        sent_at=AT,
        instruction_id=InstructionId("ins_1"),
        stream=1,
        seq=1,
        expires_at=AT,
        mission_id=MISSION,
        mission_revision=1,
        delivery_id=DELIVERY,
        first_step=1,
        steps=(stand,),
    )
    answer = Answer(instruction_id=InstructionId("ins_1"), stream=1, seq=1, status="ACCEPTED")
    return InstructionAnswered(answered_at=AT, answer=answer, instruction=mission)


def make_event(seq: int, **changes: Any) -> EventRecorded:
    event = {
        "message_id": f"msg_{seq}",
        "sent_at": AT,
        "session": 1,
        "seq": seq,
        "event": "STEP_ENDED",
        "stream": 1,
        "mission_id": MISSION,
        "mission_revision": 1,
        "step_id": seq,
        "step_kind": "DELIVER",
        "ended_at": AT,
        "station_id": "home",
        "position": HERE,
        "soc": 0.5,
        "package_ids": ("p1",),
    }
    return EventRecorded(event=DroneEvent.model_validate(event | changes))


def steps_after(journals: Journals) -> list[CustodyStep]:
    """All steps, once the journals are read again."""
    journals.read()
    return journals.custody_steps()


def test_a_hand_over_is_found_with_its_delivery(journals: Journals, journal: FileJournal) -> None:
    journal.append([make_event(1)])

    [step] = steps_after(journals)

    assert step == CustodyStep(
        drone_id=DroneId("drn_1"),
        kind="DELIVER",
        mission_id=MISSION,
        delivery_id=DELIVERY,
        package_ids=(PackageId("p1"),),
        station_id=StationId("home"),
    )


@pytest.mark.parametrize(
    "changes",
    [{"code": "CUT"}, {"event": "STEP_FAILED", "code": "RECIPIENT_ABSENT"}, {"step_kind": "FLY"}],
)
def test_other_ends_of_steps_are_left_out(
    journals: Journals, journal: FileJournal, changes: dict[str, str]
) -> None:
    journal.append([make_event(1, **changes)])

    assert steps_after(journals) == []


def test_a_hand_over_that_the_drone_cannot_know_is_not_certain(
    journals: Journals, journal: FileJournal
) -> None:
    journal.append([make_event(1, event="STEP_FAILED", code="UNKNOWN")])

    [step] = steps_after(journals)

    assert not step.is_certain


def test_a_line_written_just_before_the_journal_is_rewritten_is_read(
    journals: Journals, journal: FileJournal
) -> None:
    journals.read()
    journal.append([make_event(1)])
    journal.compact(LOGBOOK)
    journal.append([make_event(2)])

    steps = steps_after(journals)

    assert len(steps) == 2
    assert {step.delivery_id for step in steps} == {DELIVERY}


def test_an_event_that_a_rewritten_journal_repeats_counts_once(
    journals: Journals, journal: FileJournal
) -> None:
    journal.append([make_event(1)])
    journals.read()
    journal.compact(LOGBOOK.model_copy(update={"events": (make_event(1).event,)}))

    assert len(steps_after(journals)) == 1


def test_a_line_is_read_when_it_is_whole(
    path: Path, journals: Journals, journal: FileJournal
) -> None:
    line = make_event(1).model_dump_json().encode() + b"\n"
    with path.open("ab") as file:
        file.write(line[:40])
        file.flush()
        assert steps_after(journals) == []
        file.write(line[40:])

    assert len(steps_after(journals)) == 1


def test_lines_after_a_line_that_was_cut_off_are_read(
    path: Path, journals: Journals, journal: FileJournal
) -> None:
    length = path.stat().st_size
    with path.open("ab") as file:
        file.write(b'{"kind": "EVENT", "event": {' + b" " * 4_000)
        file.flush()
        journals.read()
        file.truncate(length)
    journal.append([make_event(seq) for seq in range(1, 20)])

    assert len(steps_after(journals)) == 19
