"""A chain of hashes shows that an entry was changed, removed or added."""

from collections.abc import Iterable

from skyway.runtime.hash_chain import next_hash


def hashes_of(entries: Iterable[str]) -> list[str]:
    hashes = [""]
    for entry in entries:
        hashes.append(next_hash(hashes[-1], entry))
    return hashes[1:]


def test_a_change_of_one_entry_changes_all_later_hashes() -> None:
    before = hashes_of(["first", "second", "third"])
    after = hashes_of(["first", "SECOND", "third"])

    assert before[0] == after[0]
    assert before[1] != after[1]
    assert before[2] != after[2]


def test_an_exchange_of_two_entries_changes_the_last_hash() -> None:
    assert hashes_of(["first", "second"])[-1] != hashes_of(["second", "first"])[-1]


def test_the_border_between_two_parts_counts() -> None:
    assert next_hash("", "ab", "c") != next_hash("", "a", "bc")


def test_an_empty_part_counts() -> None:
    assert next_hash("", "a", "") != next_hash("", "a")
