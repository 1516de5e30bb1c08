"""Subscriptions and their filters, each narrowed to what its client may read."""

import pytest
from skyway_broker.subscriptions import Subscriptions, is_filter, overlaps


@pytest.mark.parametrize("topic_filter", ["", "a#", "a+/b", "#/a", "a/#/b"])
def test_an_invalid_filter_is_recognised(topic_filter):
    assert not is_filter(topic_filter)


@pytest.mark.parametrize("topic_filter", ["a", "+", "#", "a/+/b", "a/#", "/"])
def test_a_valid_filter_is_recognised(topic_filter):
    assert is_filter(topic_filter)


@pytest.mark.parametrize(
    ("topic_filter", "readable", "part"),
    [
        ("a/b", "a/+", "a/b"),
        ("a/+", "a/b", "a/b"),
        ("a/+", "+/+", "a/+"),
        ("+/+", "a/b", "a/b"),
        ("#", "a/+/c", "a/+/c"),
        ("a/#", "a", "a"),
        ("+/b/#", "a/+/c", "a/b/c"),
        ("a/b/c/#", "a/b/c", "a/b/c"),
    ],
)
def test_a_filter_is_narrowed_to_what_both_filters_match(topic_filter, readable, part):
    assert overlaps(topic_filter, [readable]) == {part}


@pytest.mark.parametrize(
    ("topic_filter", "readable"),
    [("a", "b"), ("a/b", "a"), ("a", "a/b"), ("a/b/#", "a"), ("a/+", "b/+"), ("+", "/a")],
)
def test_filters_without_a_common_topic_have_no_overlap(topic_filter, readable):
    assert overlaps(topic_filter, [readable]) == frozenset()


def test_overlapping_filters_find_a_client_once_at_its_highest_qos():
    subscriptions = Subscriptions()
    subscriptions.add("c", "a/b", 0, readable=["+/+"])
    subscriptions.add("c", "a/+", 1, readable=["+/+"])
    subscriptions.add("c", "#", 0, readable=["+/+"])

    assert subscriptions.matching("a/b") == {"c": 1}


def test_a_client_is_not_found_under_topics_that_it_may_not_read():
    subscriptions = Subscriptions()
    subscriptions.add("c", "#", 1, readable=["own/c", "world/+"])

    assert subscriptions.matching("own/c") == {"c": 1}
    assert subscriptions.matching("world/x") == {"c": 1}
    assert subscriptions.matching("own/d") == {}


def test_a_removed_filter_finds_no_client_and_other_filters_stay():
    subscriptions = Subscriptions()
    subscriptions.add("c", "a/b", 1, readable=["a/+"])
    subscriptions.add("c", "a/+", 1, readable=["a/+"])
    subscriptions.add("d", "a/+", 1, readable=["a/+"])

    subscriptions.remove("c", "a/+")
    subscriptions.remove("c", "never/there")

    assert subscriptions.matching("a/b") == {"c": 1, "d": 1}
    assert subscriptions.matching("a/x") == {"d": 1}


def test_a_removed_filter_leaves_what_another_filter_of_the_client_asks_for():
    subscriptions = Subscriptions()
    subscriptions.add("c", "#", 1, readable=["a/+"])
    subscriptions.add("c", "a/+", 0, readable=["a/+"])

    subscriptions.remove("c", "#")

    assert subscriptions.matching("a/b") == {"c": 0}
    assert subscriptions.count("c") == 1


def test_a_dropped_client_is_not_found():
    subscriptions = Subscriptions()
    subscriptions.add("c", "a/b", 1, readable=["a/+"])
    subscriptions.add("c", "#", 1, readable=["a/+"])

    subscriptions.drop("c")

    assert subscriptions.matching("a/b") == {}
    assert subscriptions.count("c") == 0
