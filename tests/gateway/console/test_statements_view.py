"""The view of statements: a month's sums and lines, and both as CSV."""

from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, Route, expect

from tests.end_to_end.browser import needs_browser
from tests.gateway.console.hostile_names import ANSWERS
from tests.gateway.console.staged_page import StagedPage

pytestmark = [pytest.mark.integration, needs_browser]


@pytest.fixture
def page(stage: StagedPage) -> Page:
    stage.answers |= ANSWERS
    stage.answers["/v1/sessions/current"] = {"subject_id": "alice", "role": "customer"}
    return stage.open("/console#/statements").page


def saved(page: Page, button: str) -> tuple[str, str]:
    """The name and the text of the file that a button saves."""
    with page.expect_download() as download:
        page.get_by_role("button", name=button).click()
    return download.value.suggested_filename, Path(download.value.path()).read_text()


def test_the_present_month_is_shown_with_its_items_and_lines(page: Page) -> None:
    statement = page.locator(".statements section")

    expect(statement).to_contain_text("pays US$9.00")
    expect(statement.get_by_role("row")).to_have_count(2)
    expect(statement).to_contain_text("Correction-US$1.00")
    expect(page.get_by_role("table", name="Lines", exact=True)).to_contain_text("-US$1.00")
    link = page.get_by_role("link", name="Page to print")
    expect(link).to_have_attribute("href", "/v1/statements?month=2026-03&limit=200")


@pytest.mark.long
def test_another_month_is_asked_for(stage: StagedPage, page: Page) -> None:
    expect(page.locator(".statements section")).to_be_visible()
    stage.answers["/v1/statements"] = {"items": [], "next_cursor": None}

    page.get_by_label("Month").fill("2026-02")

    expect(page.get_by_text("No lines in this month.")).to_be_visible()
    assert "GET /v1/statements?month=2026-02&limit=200" in stage.asked


def test_all_pages_of_a_list_are_saved_with_one_row_of_names(page: Page) -> None:
    following = '</v1/statements/lines?cursor=2>; rel="next"'

    def answer(route: Route) -> None:
        if route.request.headers["accept"] != "text/csv":
            route.fallback()
            return
        first = "cursor" not in route.request.url
        headers: dict[str, Any] = {"Link": following} if first else {}
        row = "one" if first else "two"
        route.fulfill(body=f"name\r\n{row}\r\n", headers=headers, content_type="text/csv")

    page.route("**/v1/statements/lines*", answer)

    assert saved(page, "Lines as CSV") == ("lines-2026-03.csv", "name\none\ntwo\n")


def test_a_provider_sees_its_earnings_by_route(stage: StagedPage, page: Page) -> None:
    table = page.get_by_role("table", name="Earnings of the month by")
    expect(page.locator(".statements section")).to_be_visible()
    expect(table).to_have_count(0)
    stage.answers["/v1/sessions/current"] = {"subject_id": "prv_1", "role": "provider"}
    page.reload()
    expect(table).to_contain_text("2026-03-01")

    page.get_by_label("Earnings of the month by").first.select_option("Route")

    expect(table).to_contain_text("archived")
    expect(table).to_contain_text("US$9.00")


@pytest.mark.long
def test_the_view_fits_a_phone(page: Page) -> None:
    page.set_viewport_size({"width": 360, "height": 800})
    expect(page.locator(".statements section")).to_be_visible()

    assert page.evaluate("document.querySelector('main').scrollWidth <= innerWidth")
