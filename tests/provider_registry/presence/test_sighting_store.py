"""The newest message by the drone's own numbers counts, in any order of arrival (I15)."""

from datetime import UTC, datetime
from typing import Literal

from hypothesis import given
from hypothesis import strategies as st
from skyway_provider_registry.presence.sighting_store import PresenceMessage, newest

from skyway.contracts.drone_report import Connection, DroneState, Telemetry
from skyway.geo import Position
from skyway.ids import DroneId

AT = datetime(2026, 3, 1, tzinfo=UTC)
HERON = DroneId("drn_heron")
EGRET = DroneId("drn_egret")


def make_connection(
    session: int, number: int, status: Literal["ONLINE", "OFFLINE", "LOST"]
) -> Connection:
    return Connection(
        message_id="m", sent_at=AT, session=session, connection_number=number, status=status
    )


def make_state(session: int, seq: int) -> DroneState:
    return DroneState(
        message_id="m",
        sent_at=AT,
        session=session,
        seq=seq,
        at=AT,
        activity="IDLE",
        stream=0,
        last_instruction_seq=0,
        last_event_seq=0,
        position=Position(0, 0),
        soc=(seq % 100) / 100,
    )


def make_sample(session: int, seq: int) -> Telemetry:
    return Telemetry(
        message_id="m",
        sent_at=AT,
        session=session,
        seq=seq,
        at=AT,
        position=Position(0, 0),
        soc=(seq % 100) / 100,
        power_w=0,
        speed_mps=0,
    )


def a_life() -> list[tuple[DroneId, PresenceMessage]]:
    """Two drones over two boots and a broken connection, in the order in which they sent."""
    life: list[tuple[DroneId, PresenceMessage]] = []
    for drone_id in (HERON, EGRET):
        for session in (7, 9):
            for number in (1, 2):
                life.append((drone_id, make_connection(session, number, "ONLINE")))
                life += [(drone_id, make_state(session, seq)) for seq in range(1, 4)]
                life += [(drone_id, make_sample(session, seq)) for seq in range(1, 4)]
                life.append((drone_id, make_connection(session, number, "LOST")))
    return life


@given(st.permutations(a_life()), st.data())
def test_any_order_with_any_repeats_gives_the_result_of_the_sending_order(
    shuffled: list[tuple[DroneId, PresenceMessage]], data: st.DataObject
) -> None:
    repeats = data.draw(st.lists(st.sampled_from(shuffled), max_size=10))

    assert newest([*shuffled, *repeats]) == newest(a_life())


def test_the_last_will_of_an_older_connection_does_not_count() -> None:
    online, lost = make_connection(7, 2, "ONLINE"), make_connection(7, 1, "LOST")

    known = newest([(HERON, online), (HERON, lost)])

    assert known[HERON].connection == online


def test_the_last_will_of_the_present_connection_counts() -> None:
    online, lost = make_connection(7, 2, "ONLINE"), make_connection(7, 2, "LOST")

    known = newest([(HERON, online), (HERON, lost)])

    assert known[HERON].connection == lost


def test_a_new_session_counts_from_the_beginning() -> None:
    old, new = make_state(7, 900), make_state(8, 1)

    known = newest([(HERON, new), (HERON, old)])

    assert known[HERON].state == new
