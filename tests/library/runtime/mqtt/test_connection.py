"""A connection is checked when a ping may be due, and often only while a ping is due."""

from skyway.runtime.mqtt.connection import next_check_s


def test_a_connection_is_not_checked_before_a_ping_can_be_due() -> None:
    assert next_check_s(101.0, received_s=100.5, sent_s=100.0, keepalive_s=10) == 110.0


def test_a_connection_that_was_silent_for_long_is_checked_often() -> None:
    assert next_check_s(112.0, received_s=100.0, sent_s=111.0, keepalive_s=10) == 114.0


def test_a_check_is_late_by_at_most_a_fifth_of_the_keepalive() -> None:
    assert next_check_s(109.5, received_s=100.0, sent_s=109.0, keepalive_s=10) == 111.5
