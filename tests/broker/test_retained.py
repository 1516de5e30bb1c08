"""What a broker keeps of a topic."""

from skyway_broker.retained import Retained


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
