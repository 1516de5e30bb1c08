"""Missions and reservations as a machine: whatever happens in whatever order, nothing breaks."""

import asyncio

from hot_story import DEEDS, Story
from hypothesis import given, settings
from hypothesis import strategies as st

_DEEDS = st.lists(
    st.tuples(st.sampled_from(DEEDS), st.integers(0, 10_000)), min_size=25, max_size=45
)
#: On PostgreSQL each statement is a round trip, and the machine is the same.
_STORIES = {"sqlite": 14, "postgresql": 3}


def test_nothing_breaks_whatever_happens(migrated_url: str) -> None:
    dialect, _, _ = migrated_url.partition(":")

    @settings(max_examples=_STORIES[dialect])
    @given(deeds=_DEEDS)
    def tell(deeds: list[tuple[str, int]]) -> None:
        asyncio.run(Story.told(migrated_url, deeds))

    tell()
