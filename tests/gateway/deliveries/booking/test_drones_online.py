"""Drones that come online count seldom, so that no drone drives the bookings of others."""

from datetime import UTC, datetime, timedelta

from skyway_gateway.deliveries.booking.wake_waiting import DronesOnline

from tests.gateway.deliveries.booking.connections import connection

NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)


def after(seconds: float) -> datetime:
    return NOON + timedelta(seconds=seconds)


def test_a_drone_that_was_online_before_does_not_count() -> None:
    online = DronesOnline()

    assert online.note([connection("drn_1", "ONLINE")], now=NOON)
    assert not online.note([connection("drn_1", "ONLINE")], now=after(60))
    assert not online.note([connection("drn_1", "LOST")], now=after(120))
    assert online.note([connection("drn_1", "ONLINE")], now=after(180))


def test_the_drones_of_a_provider_count_once_in_ten_seconds() -> None:
    online = DronesOnline()

    counted = [
        second
        for second in range(25)
        if online.note([connection(f"drn_{second}", "ONLINE")], now=after(second))
    ]

    assert counted == [0, 10, 20]


def test_the_drones_of_all_providers_count_once_in_a_second() -> None:
    online = DronesOnline()

    counted = [
        tenth
        for tenth in range(25)
        if online.note([connection("drn_1", "ONLINE", f"prv_{tenth}")], now=after(tenth / 10))
    ]

    assert counted == [0, 10, 20]


def test_another_provider_counts_beside_one_that_counted_before() -> None:
    online = DronesOnline()
    online.note([connection("drn_1", "ONLINE", "prv_1")], now=NOON)

    both = [connection("drn_2", "ONLINE", "prv_1"), connection("drn_3", "ONLINE", "prv_2")]

    assert online.note(both, now=after(1))


def test_the_memory_is_bounded() -> None:
    online = DronesOnline(most_drones=10)
    for number in range(100):
        batch = [connection(f"drn_{number}", "ONLINE", f"prv_{number}")]
        online.note(batch, now=after(number))

    assert len(online._online) == 10
    assert len(online._counted_of) <= 11
