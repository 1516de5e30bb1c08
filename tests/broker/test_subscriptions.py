"""Subscriptions and retained messages: filters that match a topic."""

import pytest
from skyway_broker.subscriptions import Retained, Subscriptions, is_filter, matches


@pytest.mark.parametrize(
    ("wanted", "topic"),
    [
        ("a/b", "a/b"),
        ("a/+", "a/b"),
        ("+/+", "a/b"),
        ("#", "a/b"),
        ("a/#", "a"),
        ("a/#", "a/b/c"),
        ("a/+", "a/"),
    ],
)
def test_a_filter_matches(wanted, topic):
    assert matches(wanted.split("/"), topic.split("/"))


@pytest.mark.parametrize(
    ("wanted", "topic"), [("a/+", "a"), ("a/+", "a/b/c"), ("a/b/#", "a"), ("+", "/a"), ("a", "b")]
)
def test_a_filter_does_not_match(wanted, topic):
    assert not matches(wanted.split("/"), topic.split("/"))


@pytest.mark.parametrize("wanted", ["", "a#", "a+/b", "#/a", "a/#/b"])
def test_an_invalid_filter_is_recognised(wanted):
    assert not is_filter(wanted)


@pytest.mark.parametrize("wanted", ["a", "+", "#", "a/+/b", "a/#", "/"])
def test_a_valid_filter_is_recognised(wanted):
    assert is_filter(wanted)


def test_overlapping_filters_find_a_client_once_at_its_highest_qos():
    wanted = Subscriptions()
    wanted.add("c", "a/b", 0)
    wanted.add("c", "a/+", 1)
    wanted.add("c", "#", 0)

    assert wanted.matching("a/b") == {"c": 1}


def test_a_removed_filter_finds_no_client_and_other_filters_stay():
    wanted = Subscriptions()
    wanted.add("c", "a/b", 1)
    wanted.add("c", "a/+", 1)
    wanted.add("d", "a/+", 1)

    wanted.remove("c", "a/+")
    wanted.remove("c", "never/there")

    assert wanted.matching("a/b") == {"c": 1, "d": 1}
    assert wanted.matching("a/x") == {"d": 1}


def test_a_dropped_client_is_not_found():
    wanted = Subscriptions()
    wanted.add("c", "a/b", 1)
    wanted.add("c", "#", 1)

    wanted.drop("c")

    assert wanted.matching("a/b") == {}


def test_the_last_message_of_a_topic_is_kept():
    kept = Retained()
    kept.keep("a/b", b"1", 1)
    kept.keep("a/b", b"2", 1)

    assert list(kept.under("a/b")) == [("a/b", b"2", 1)]


def test_an_empty_message_clears_a_topic():
    kept = Retained()
    kept.keep("a/b", b"1", 1)

    kept.keep("a/b", b"", 1)

    assert list(kept.under("#")) == []


def test_a_wildcard_finds_all_topics_that_it_matches():
    kept = Retained()
    kept.keep("a/b", b"1", 1)
    kept.keep("a/c", b"2", 0)
    kept.keep("x/c", b"3", 0)

    assert sorted(kept.under("a/+")) == [("a/b", b"1", 1), ("a/c", b"2", 0)]
    assert list(kept.under("a/x")) == []
