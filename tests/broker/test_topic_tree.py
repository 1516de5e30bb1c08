"""Values under topics and filters."""

import pytest
from skyway_broker.topic_tree import TopicTree


@pytest.mark.parametrize(
    ("path", "topic", "is_found"),
    [
        ("a/b", "a/b", True),
        ("a/+", "a/b", True),
        ("+/+", "a/b", True),
        ("a/+", "a/", True),
        ("a/+", "a", False),
        ("a/+", "a/b/c", False),
        ("+", "/a", False),
    ],
)
def test_a_topic_finds_the_filters_that_match_it(path, topic, is_found):
    tree: TopicTree[str] = TopicTree()
    tree.put(path, "found")

    assert tree.matching(topic) == (["found"] if is_found else [])


def test_a_filter_finds_the_topics_that_it_matches():
    tree: TopicTree[int] = TopicTree()
    for number, topic in enumerate(("a/b", "a/c", "x/c", "a/b/c")):
        tree.put(topic, number)

    assert sorted(tree.under("a/+")) == [("a/b", 0), ("a/c", 1)]
    assert sorted(tree.under("+/c")) == [("a/c", 1), ("x/c", 2)]
    assert list(tree.under("a/x")) == []


def test_a_removed_path_leaves_longer_and_shorter_paths():
    tree: TopicTree[int] = TopicTree()
    tree.put("a", 1)
    tree.put("a/b", 2)
    tree.put("a/b/c", 3)

    tree.pop("a/b")
    tree.pop("never/there")

    assert [tree.get(path) for path in ("a", "a/b", "a/b/c", "a/x/y")] == [1, None, 3, None]
    tree.pop("a/b/c")
    assert list(tree.under("a")) == [("a", 1)]
