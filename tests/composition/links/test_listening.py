"""Since when a process has received and handled every message."""

from datetime import timedelta

import pytest
from skyway_composition.links.listening import Listening

from skyway.ids import DroneId
from skyway.runtime.clock import ManualClock
from skyway.runtime.sql.database import Database
from tests.composition.lone_replica import lone_replica

MINUTE = timedelta(minutes=1)
DRONE, OTHER = DroneId("drn_1"), DroneId("drn_2")


@pytest.fixture
def listening(clock: ManualClock) -> Listening:
    db = Database("sqlite:///never-opened")
    return Listening(clock, lone_replica(db, clock))


def test_a_process_that_was_never_connected_has_received_nothing(
    listening: Listening, clock: ManualClock
) -> None:
    assert not listening.covers(DRONE, clock.now(), clock.now())


def test_everything_since_the_connection_is_received(
    listening: Listening, clock: ManualClock
) -> None:
    listening.begin()
    begun_at = clock.now()
    clock.advance(MINUTE)

    assert listening.covers(DRONE, begun_at, clock.now())
    assert not listening.covers(DRONE, begun_at - MINUTE, clock.now())


def test_nothing_is_received_after_a_lost_connection(
    listening: Listening, clock: ManualClock
) -> None:
    listening.begin()
    begun_at = clock.now()
    listening.end()

    assert not listening.covers(DRONE, begun_at, begun_at)


def test_messages_that_are_not_handled_yet_do_not_count(
    listening: Listening, clock: ManualClock
) -> None:
    listening.begin()
    begun_at = clock.now()
    clock.advance(MINUTE)
    listening.begin_batch()
    clock.advance(MINUTE)
    listening.begin_batch()  # a second try

    assert listening.covers(DRONE, begun_at, begun_at)
    assert not listening.covers(DRONE, begun_at, begun_at + MINUTE)
    listening.end_batch()
    assert listening.covers(DRONE, begun_at, clock.now())


def test_a_frozen_process_has_missed_messages(listening: Listening, clock: ManualClock) -> None:
    listening.begin()
    begun_at = clock.now()
    listening.look()
    clock.advance(timedelta(seconds=1))
    listening.look()
    assert listening.covers(DRONE, begun_at, clock.now())

    clock.advance(timedelta(seconds=30))
    listening.look()

    assert not listening.covers(DRONE, begun_at, clock.now())


def test_a_message_that_was_not_taken_is_missed_of_its_drone_only(
    listening: Listening, clock: ManualClock
) -> None:
    listening.begin()
    begun_at = clock.now()
    clock.advance(MINUTE)
    listening.miss(DRONE)
    missed_at = clock.now()
    clock.advance(MINUTE)

    assert not listening.covers(DRONE, begun_at, clock.now())
    assert listening.covers(DRONE, missed_at + MINUTE / 2, clock.now())
    assert listening.covers(OTHER, begun_at, clock.now())
