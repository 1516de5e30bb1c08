"""On the smallest phones nothing is cut, and a finger hits every button."""

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.end_to_end.browser import needs_browser, serious_problems
from tests.gateway.console.hostile_names import PICTURE
from tests.gateway.console.staged_page import LIVE
from tests.gateway.console.test_every_view import VIEWS, staged

pytestmark = [pytest.mark.integration, needs_browser, pytest.mark.long]

#: What does not fit on the screen, and what is too small for a finger. Links within a sentence and
#: the bars of charts are not meant for fingers alone.
_PROBLEMS = """() => {
  const problems = [];
  // The map fills its view, and moves below the finger.
  const scrolled = [...document.querySelectorAll("html, main:not(:has(.map-view))")];
  if (scrolled.some((each) => each.scrollWidth > innerWidth)) {
    const wide = [...document.querySelectorAll("body *")].find((each) =>
      each.getBoundingClientRect().right > innerWidth + 1 && !each.closest(".table, .map, .gantt"));
    problems.push(`wider than the screen: ${wide?.outerHTML.slice(0, 100)}`);
  }
  const isInSentence = (link) => link.matches("a") && [...link.parentElement.childNodes]
    .some((each) => each.nodeType === Node.TEXT_NODE && each.data.trim());
  const small = [...document.querySelectorAll(
    "main button, main select, main a, nav.bottom > *, header.frame .brand")]
    .filter((each) => !each.closest("p, label, svg, .map-view") && !isInSentence(each))
    .filter((each) => each.checkVisibility() && each.getBoundingClientRect().height < 43.5);
  return problems.concat(small.map((each) => `too small: ${each.outerHTML.slice(0, 120)}`));
}"""


def problems_of(page: Page, address: str) -> list[str]:
    """What is cut or too small in the view that is open."""
    return [f"{address}: {each}" for each in page.evaluate(_PROBLEMS)]


@pytest.mark.parametrize("role", list(VIEWS))
def test_nothing_is_cut_or_too_small_on_a_phone(browser: Browser, role: str) -> None:
    stage = staged(browser, role)
    page = stage.page
    page.set_viewport_size({"width": 360, "height": 740})
    stage.open("/console#/home")
    stage.send(LIVE, "snapshot", PICTURE)
    problems: list[str] = []
    for address, text in VIEWS[role].items():
        page.evaluate("address => { location.hash = `#/${address}` }", address)
        shown = page.locator("main").get_by_text(text).filter(visible=True)
        expect(shown.first).to_be_attached()
        problems += problems_of(page, address)

    assert problems == []
    stage.close()


def test_the_menu_of_a_phone_leads_to_the_other_views(browser: Browser) -> None:
    stage = staged(browser, "operator")
    page = stage.page
    page.set_viewport_size({"width": 360, "height": 740})
    stage.open("/console#/home")
    stage.send(LIVE, "snapshot", PICTURE)
    bar = page.get_by_role("navigation", name="Views")
    expect(bar.get_by_role("link")).to_have_text(["Home", "Map", "Deliveries", "Alarms1"])
    bar.get_by_role("button", name="More").click()
    menu = page.locator("#menu")
    expect(menu.get_by_role("link")).to_have_text(
        ["Schedule", "Fleet", "Statements", "Replay", "Health", "Keys"]
    )
    problems = serious_problems(page)
    menu.get_by_role("link", name="Fleet").click()
    expect(menu).to_be_hidden()
    page.get_by_role("button", name="What to do with").click()
    sheet = page.get_by_role("dialog")
    expect(sheet).to_contain_text("It gets no more missions until you put it back in service.")
    problems += serious_problems(page)
    page.keyboard.press("Escape")

    expect(sheet).to_have_count(0)
    assert problems == []
    stage.close()
