"""A busy world whose first drone stands at a."""

from collections.abc import AsyncIterator

import pytest

from tests.composition.busy_world import BusyWorld


@pytest.fixture
def package() -> str:
    return "skyway_composition"


@pytest.fixture
async def world(migrated_url: str) -> AsyncIterator[BusyWorld]:
    async with BusyWorld(migrated_url) as world:
        yield world
