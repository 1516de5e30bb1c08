"""Retained messages, and how many of them one account may have."""

import dataclasses

import pytest
from amqtt.errors import MQTTError
from skyway_broker.limits import Limits
from skyway_broker.retained import Retained

LIMITS = dataclasses.replace(Limits().client, retained=2, retained_bytes=10)


def keep(kept: Retained, topic: str, data: bytes, writer: str = "w") -> None:
    kept.keep(topic, data, 1, writer=writer, limits=LIMITS)


def test_the_last_message_of_a_topic_is_kept():
    kept = Retained()
    keep(kept, "a/b", b"1")
    keep(kept, "a/b", b"2")

    assert list(kept.under("a/b")) == [("a/b", b"2", 1)]


def test_an_empty_message_clears_a_topic():
    kept = Retained()
    keep(kept, "a/b", b"1")

    keep(kept, "a/b", b"")

    assert list(kept.under("+/+")) == []


def test_an_account_may_retain_so_many_messages_and_a_cleared_one_makes_room():
    kept = Retained()
    keep(kept, "a", b"1")
    keep(kept, "b", b"1")
    keep(kept, "b", b"2")

    with pytest.raises(MQTTError, match="retained"):
        keep(kept, "c", b"1")
    keep(kept, "c", b"1", writer="another")
    keep(kept, "a", b"")
    keep(kept, "d", b"1")

    assert sorted(topic for topic, _, _ in kept.under("+")) == ["b", "c", "d"]


def test_an_account_may_retain_so_many_bytes():
    kept = Retained()
    keep(kept, "a", b"12345678")

    with pytest.raises(MQTTError, match="retained"):
        keep(kept, "b", b"123")
    keep(kept, "a", b"1234567890")

    assert list(kept.under("+")) == [("a", b"1234567890", 1)]
