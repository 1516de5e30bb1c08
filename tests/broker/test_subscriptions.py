"""Subscriptions and retained messages: filters that match a topic."""

import pytest
from skyway_broker.subscriptions import Retained, Subscriptions, is_filter, matches


@pytest.mark.parametrize(
    ("topic_filter", "topic"),
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
def test_a_filter_matches(topic_filter, topic):
    assert matches(topic_filter.split("/"), topic.split("/"))


@pytest.mark.parametrize(
    ("topic_filter", "topic"),
    [("a/+", "a"), ("a/+", "a/b/c"), ("a/b/#", "a"), ("+", "/a"), ("a", "b")],
)
def test_a_filter_does_not_match(topic_filter, topic):
    assert not matches(topic_filter.split("/"), topic.split("/"))


@pytest.mark.parametrize("topic_filter", ["", "a#", "a+/b", "#/a", "a/#/b"])
def test_an_invalid_filter_is_recognised(topic_filter):
    assert not is_filter(topic_filter)


@pytest.mark.parametrize("topic_filter", ["a", "+", "#", "a/+/b", "a/#", "/"])
def test_a_valid_filter_is_recognised(topic_filter):
    assert is_filter(topic_filter)


def test_overlapping_filters_find_a_client_once_at_its_highest_qos():
    topic_filter = Subscriptions()
    topic_filter.add("c", "a/b", 0)
    topic_filter.add("c", "a/+", 1)
    topic_filter.add("c", "#", 0)

    assert topic_filter.matching("a/b") == {"c": 1}


def test_a_removed_filter_finds_no_client_and_other_filters_stay():
    topic_filter = Subscriptions()
    topic_filter.add("c", "a/b", 1)
    topic_filter.add("c", "a/+", 1)
    topic_filter.add("d", "a/+", 1)

    topic_filter.remove("c", "a/+")
    topic_filter.remove("c", "never/there")

    assert topic_filter.matching("a/b") == {"c": 1, "d": 1}
    assert topic_filter.matching("a/x") == {"d": 1}


def test_a_dropped_client_is_not_found():
    topic_filter = Subscriptions()
    topic_filter.add("c", "a/b", 1)
    topic_filter.add("c", "#", 1)

    topic_filter.drop("c")

    assert topic_filter.matching("a/b") == {}


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
