"""Missions and reservations as a machine: whatever happens in whatever order, nothing breaks."""

import asyncio
import os

import pytest
from hot_story import DEEDS, Story
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

_DEEDS = st.lists(
    st.tuples(st.sampled_from(DEEDS), st.integers(0, 10_000)), min_size=25, max_size=45
)
_SETTINGS = settings(
    derandomize=True,
    deadline=None,
    suppress_health_check=[
        HealthCheck.too_slow,
        HealthCheck.data_too_large,
        HealthCheck.function_scoped_fixture,
    ],
    max_examples=int(os.environ.get("HOT_EXAMPLES", "15")),
)


@_SETTINGS
@given(deeds=_DEEDS)
def test_nothing_breaks_whatever_happens(migrated_url: str, deeds: list[tuple[str, int]]) -> None:
    asyncio.run(Story.told(migrated_url, deeds))
