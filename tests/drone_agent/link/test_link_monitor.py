"""How often a drone beats, and that a fleet does not beat as one."""

from collections import Counter
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from skyway_drone_agent.link.link_monitor import Heartbeat, LinkMonitor

from skyway.ids import DroneId
from skyway.runtime.clock import ManualClock

NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)
MINUTE, BEAT = timedelta(minutes=1), timedelta(seconds=30)


class Connected:
    """A link that is up."""

    is_connected = True


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock(NOON)


@pytest.fixture
def watch(clock: ManualClock) -> LinkMonitor:
    link: Any = Connected()
    return LinkMonitor(link, clock, on_change=lambda: None)


def test_only_the_first_beat_of_a_connection_comes_early(
    watch: LinkMonitor, clock: ManualClock
) -> None:
    heartbeat = Heartbeat(DroneId("drn_1"), watch, clock)
    first = heartbeat.after(NOON)
    assert NOON < first < NOON + BEAT
    assert heartbeat.after(first) == first + BEAT

    clock.advance(MINUTE)
    watch.came_up()

    assert heartbeat.after(NOON + MINUTE) == first + MINUTE


def test_a_state_before_the_first_heartbeat_does_not_delay_it(
    watch: LinkMonitor, clock: ManualClock
) -> None:
    heartbeat = Heartbeat(DroneId("drn_1"), watch, clock)
    first = heartbeat.after(NOON)

    assert heartbeat.after(NOON + 0.5 * (first - NOON)) == first


def test_the_heartbeats_of_a_fleet_that_connects_together_are_spread(
    watch: LinkMonitor, clock: ManualClock
) -> None:
    fleet = [Heartbeat(DroneId(f"drn_{n:05}"), watch, clock) for n in range(1000)]

    in_second = Counter(int((one.after(NOON) - NOON).total_seconds()) for one in fleet)

    assert len(in_second) == 30
    assert max(in_second.values()) < 60


def test_drones_that_are_due_in_the_same_second_beat_together(watch: LinkMonitor) -> None:
    heartbeat = Heartbeat(DroneId("drn_1"), watch, ManualClock(NOON))
    later = NOON + MINUTE

    due_at = {heartbeat.after(later + timedelta(seconds=part)) for part in (0.0, 0.2, 0.999)}

    assert due_at == {later + BEAT}


@pytest.mark.parametrize("rate", [0.01, 1.0, 600.0])
def test_beats_and_their_seconds_are_of_wall_time(watch: LinkMonitor, rate: float) -> None:
    heartbeat = Heartbeat(DroneId("drn_1"), watch, ManualClock(NOON, rate=rate))
    later = NOON + rate * MINUTE

    due_at = {heartbeat.after(later + rate * timedelta(seconds=part)) for part in (0.0, 0.999)}

    assert due_at == {later + rate * BEAT}
