from typing import Any

import pytest
from skyway_composition.links.link import DroneLink

from skyway.contracts.drone_report import Connection, DroneState
from skyway.ids import DroneId, ProviderId

MOMENT = "2026-03-01T12:00:00Z"


def make_state(**members: Any) -> DroneState:
    values = {
        "message_id": "m",
        "sent_at": MOMENT,
        "at": MOMENT,
        "session": 1,
        "seq": 1,
        "activity": "IDLE",
        "stream": 1,
        "last_instruction_seq": 0,
        "last_event_seq": 0,
        "position": (0.0, 0.0),
        "soc": 1.0,
    }
    return DroneState.model_validate(values | members)


def make_connection(status: str, session: int, number: int) -> Connection:
    return Connection.model_validate(
        {
            "message_id": "m",
            "sent_at": MOMENT,
            "session": session,
            "connection_number": number,
            "status": status,
        }
    )


def make_link(**members: Any) -> DroneLink:
    return DroneLink(DroneId("drn_1"), ProviderId("prv_1"), **members)


@pytest.mark.parametrize(
    ("session", "seq", "is_newer"), [(2, 5, False), (2, 6, True), (3, 1, True), (1, 9, False)]
)
def test_states_are_ordered_by_session_and_seq(session: int, seq: int, is_newer: bool) -> None:
    link = make_link(state=make_state(session=2, seq=5))

    assert link.is_newer_state(make_state(session=session, seq=seq)) is is_newer


@pytest.mark.parametrize(
    ("status", "session", "number", "counts"),
    [("LOST", 1, 2, True), ("LOST", 1, 1, False), ("ONLINE", 1, 3, True), ("ONLINE", 2, 1, True)],
)
def test_a_last_will_counts_only_for_the_current_connection(
    status: str, session: int, number: int, counts: bool
) -> None:
    link = make_link(connection=make_connection("ONLINE", 1, 2))

    assert link.is_newer_connection(make_connection(status, session, number)) is counts


def test_online_after_the_last_will_of_the_same_connection_is_ignored() -> None:
    link = make_link(connection=make_connection("LOST", 1, 2))

    assert not link.is_newer_connection(make_connection("ONLINE", 1, 2))


def test_an_older_stream_in_a_later_session_needs_a_new_stream() -> None:
    link = make_link(stream=1).acked(1, 4)

    assert link.needs_new_stream(make_state(stream=0, session=5))
    assert not link.needs_new_stream(make_state(stream=0, session=4))


def test_a_drone_without_its_journal_gets_one_new_stream_for_each_loss() -> None:
    lost = make_link(stream=1).acked(1, 4).in_new_stream(make_state(stream=0, session=5))

    assert not lost.needs_new_stream(make_state(stream=0, session=5))
    assert not lost.needs_new_stream(make_state(stream=0, session=6))
    assert lost.acked(2, 6).needs_new_stream(make_state(stream=0, session=7))


def test_an_unconfirmed_stream_needs_no_new_stream() -> None:
    link = make_link(stream=1)

    assert not link.needs_new_stream(make_state(stream=0, session=5))


def test_a_new_stream_is_unused_by_both_sides() -> None:
    state = make_state(stream=7, last_event_seq=30)

    link = make_link(stream=2, last_seq=9, last_event_seq=4).in_new_stream(state)

    assert (link.stream, link.last_seq, link.last_event_seq) == (8, 0, 30)
