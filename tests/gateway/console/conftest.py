"""A browser for tests of the pages' scripts."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser

from tests.end_to_end.browser import opened_browser
from tests.gateway.console.staged_page import StagedPage


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """The browser of one file: while it is open, no test can run an event loop of its own."""
    with opened_browser() as opened:
        yield opened


@pytest.fixture
def stage(browser: Browser) -> Iterator[StagedPage]:
    """A page in which no script fails; the test says what the gateway answers, and opens it."""
    staged = StagedPage(browser, {})
    yield staged
    assert staged.errors == []
    staged.close()
