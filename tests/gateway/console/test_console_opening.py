"""What the console shows while it opens, and when it cannot."""

import pytest
from playwright.sync_api import expect

from tests.end_to_end.browser import needs_browser
from tests.gateway.console.staged_page import StagedPage

pytestmark = [pytest.mark.integration, needs_browser, pytest.mark.long]


def test_a_console_whose_file_was_refused_says_what_to_do(stage: StagedPage) -> None:
    stage.page.route("**/console/api.js", lambda route: route.fulfill(status=429))

    page = stage.open("/console").page

    expect(page.get_by_text("load the page again")).to_be_visible()


def test_the_open_console_shows_nothing_of_its_opening(stage: StagedPage) -> None:
    page = stage.open("/console#/alarms").page

    expect(page.get_by_role("navigation", name="Views")).to_be_visible()
    expect(page.get_by_text("Opening the console")).to_have_count(0)
