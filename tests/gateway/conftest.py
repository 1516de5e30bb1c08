"""What all tests of the gateway start with."""

from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest

from tests.gateway.fake_composition import make_mission
from tests.gateway.peers import make_candidate, make_reason
from tests.gateway.whole_gateway import Gateway, make_request, opened_gateway


@pytest.fixture
def package() -> str:
    """Whose tables `migrated_url` has."""
    return "skyway_gateway"


@pytest.fixture
async def gateway(sqlite_url: str, tmp_path: Path) -> AsyncIterator[Gateway]:
    """A gateway on SQLite; a broken invariant fails the test at its end."""
    async with opened_gateway(sqlite_url, tmp_path) as opened:
        yield opened


@pytest.fixture
async def gateway_on_both(
    request: pytest.FixtureRequest, migrated_url: str, tmp_path: Path
) -> AsyncIterator[Gateway]:
    """The same, once on SQLite and once on PostgreSQL.

    The databases of a story that is played on both are checked once: on SQLite, which is faster.
    """
    runs_once = request.node.get_closest_marker("databases") is not None
    async with opened_gateway(migrated_url, tmp_path) as opened:
        opened.is_checked = runs_once or opened.parts.db.dialect == "sqlite"
        yield opened


@pytest.fixture
def request_body() -> Callable[..., dict[str, Any]]:
    """Makes the JSON of a delivery request."""
    return make_request


@pytest.fixture
def reason() -> Callable[..., Any]:
    """Makes a provider's reason."""
    return make_reason


@pytest.fixture
def candidate() -> Callable[..., Any]:
    """Makes a candidate."""
    return make_candidate


@pytest.fixture
def mission() -> Callable[..., Any]:
    """Makes a mission."""
    return make_mission
