"""True instructions that come again, as a broker in the wrong hands repeats them, steer nothing."""

from datetime import timedelta
from typing import Any

from skyway.contracts.instruction import RefusalCode


def test_an_instruction_that_comes_again_gets_the_same_answer(desk: Any, trip: Any) -> None:
    mission = desk.cloud.mission(trip)
    first = desk.send(mission)
    before = desk.recorder.logbook

    again = desk.send(mission)

    assert again == first
    assert desk.recorder.logbook == before


def test_an_instruction_of_an_earlier_stream_changes_nothing(desk: Any, trip: Any) -> None:
    old = desk.cloud.mission(trip)
    desk.send(old)
    desk.cloud.stream, desk.cloud.seq = 2, 0
    desk.send(desk.cloud.mission(trip))
    before = desk.recorder.logbook

    answer = desk.send(old)

    assert answer.instruction_id == old.instruction_id
    assert desk.recorder.logbook == before


def test_after_a_lost_journal_old_instructions_have_expired(desk: Any, trip: Any) -> None:
    """The journal is empty; the instruction was sent a minute ago and is signed by the cloud."""
    old = desk.cloud.mission(trip, expires_at=desk.clock.now() - timedelta(seconds=1))

    answer = desk.send(old)

    assert answer.code == RefusalCode.EXPIRED
    assert desk.recorder.logbook.mission is None
