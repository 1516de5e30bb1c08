"""Missions and reservations as a machine: whatever happens in whatever order, nothing breaks."""

import asyncio

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.composition.hot_story import DEEDS, Story

_SEEDS = st.integers(0, 10_000)
_DEEDS = st.lists(st.tuples(st.sampled_from(DEEDS), _SEEDS), min_size=25, max_size=45)
#: On PostgreSQL each statement is a round trip, and the machine is the same.
_STORIES = {"sqlite": 10, "postgresql": 3}
_RETOLD = {"sqlite": 2, "postgresql": 1}


def test_nothing_breaks_whatever_happens(migrated_url: str) -> None:
    dialect, _, _ = migrated_url.partition(":")

    @settings(max_examples=_STORIES[dialect])
    @given(deeds=_DEEDS)
    def tell(deeds: list[tuple[str, int]]) -> None:
        asyncio.run(Story.told(migrated_url, deeds))

    tell()


#: Who of several customers at once is first, their threads decide.
_ONE_BY_ONE = st.lists(
    st.tuples(st.sampled_from([each for each in DEEDS if each != "book_at_once"]), _SEEDS),
    min_size=25,
    max_size=45,
)


def test_the_same_deeds_tell_the_same_story(migrated_url: str) -> None:
    dialect, _, _ = migrated_url.partition(":")

    @settings(max_examples=_RETOLD[dialect])
    @given(deeds=_ONE_BY_ONE)
    def tell_twice(deeds: list[tuple[str, int]]) -> None:
        once, again = (asyncio.run(Story.told(migrated_url, deeds)) for _ in range(2))
        assert once == again

    tell_twice()
