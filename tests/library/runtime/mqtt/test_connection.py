"""A connection is looked at when a ping can be due, and often only while one is."""

from skyway.runtime.mqtt.connection import next_check_s


def test_a_connection_is_left_alone_until_a_ping_can_be_due() -> None:
    assert next_check_s(101.0, received_s=100.5, sent_s=100.0, keepalive_s=10) == 110.0


def test_one_that_has_been_silent_for_long_is_looked_at_often() -> None:
    assert next_check_s(112.0, received_s=100.0, sent_s=111.0, keepalive_s=10) == 114.0


def test_a_look_is_late_by_a_fifth_of_the_keepalive_at_most() -> None:
    assert next_check_s(109.5, received_s=100.0, sent_s=109.0, keepalive_s=10) == 111.5
