"""Every view with markup in all texts: it stays text, and axe finds nothing serious."""

import json
from pathlib import Path

import pytest
from fastapi import FastAPI
from playwright.sync_api import Browser, Page, expect
from skyway_gateway.console.console_files import BaseMap
from skyway_gateway.console.page_routes import console_routes

from tests.end_to_end.browser import needs_browser, serious_problems
from tests.gateway.console.hostile_names import ANSWERS, DELIVERY, EVENT, MARKUP, PICTURE
from tests.gateway.console.map_archive import LAND, write_archive
from tests.gateway.console.staged_page import LIVE, StagedPage

pytestmark = [pytest.mark.integration, needs_browser]

#: By role: the address of each view, and a text that it shows when it has loaded.
VIEWS = {
    "operator": {
        "home": "Deliveries today",
        "map/station/a": "Segments from here",
        "map/drone/drn_1": MARKUP,
        "schedule": "Waits for a drone",
        "deliveries": MARKUP,
        "deliveries/dlv_1": "mission ",
        "fleet": MARKUP,
        "fleet/earnings": "with 2 deliveries",
        "statements": "The month is open",
        "alarms": "Closed now",
        "replay": "measured something",
        "health": "Counted failures",
        "account": "New key",
    },
    "provider": {
        "home": "Next maintenance",
        "fleet/loading": "Confirm loading",
        "fleet/exchanges": "left today",
        "statements": MARKUP,
    },
    "customer": {
        "home": "New delivery",
        "account": "Your shop on tracking pages",
        "deliveries/dlv_1": "Tracking link",
        "new": "Deliveries are accepted.",
    },
}


def staged(browser: Browser, role: str) -> StagedPage:
    session = {"subject_id": "prv_1" if role == "provider" else "someone", "role": role}
    return StagedPage(browser, ANSWERS | {"/v1/sessions/current": session})


def markup_that_works(page: Page) -> int:
    """How many elements the texts have made."""
    return page.locator("img, b").count()


@pytest.mark.parametrize("role", list(VIEWS))
def test_every_view_shows_markup_as_text_and_is_accessible(browser: Browser, role: str) -> None:
    stage = staged(browser, role)
    page = stage.page
    stage.open("/console#/alarms")
    stage.send(LIVE, "snapshot", PICTURE)
    problems: list[str] = []
    for address, text in VIEWS[role].items():
        page.evaluate("address => { location.hash = `#/${address}` }", address)
        shown = page.locator("main").get_by_text(text).filter(visible=True)
        expect(shown.first).to_be_attached()
        if address.startswith("deliveries/"):
            stage.send(f"{DELIVERY}/events", "delivery.delayed", EVENT)
            expect(page.get_by_label("What happened")).to_contain_text(MARKUP)
        assert markup_that_works(page) == 0, address
        problems += [f"{address}: {each}" for each in serious_problems(page)]

    assert problems == []
    assert stage.errors == []
    stage.close()


def test_a_question_and_the_login_are_accessible(browser: Browser) -> None:
    stage = staged(browser, "operator")
    page = stage.open("/console#/alarms").page
    stage.send(LIVE, "snapshot", PICTURE)
    page.get_by_role("button", name="Stop all take-offs").click()
    expect(page.get_by_role("dialog")).to_contain_text("1 mission needs another plan")
    problems = serious_problems(page)
    stage.answers["/v1/sessions/current"] = None
    page.reload()
    expect(page.get_by_label("API key")).to_be_visible()
    problems += serious_problems(page)

    assert problems == []
    stage.close()


@pytest.mark.long
def test_the_hints_of_an_empty_system_are_accessible(stage: StagedPage) -> None:
    stage.answers["/v1/system"] = {"small_world": "AVAILABLE", "services": []}
    page = stage.open("/console#/map").page
    stage.send(LIVE, "snapshot", {})
    expect(page.get_by_role("region", name="First steps")).to_be_visible()

    assert serious_problems(page) == []


@pytest.mark.long
def test_an_own_base_map_lies_below_the_fleet(stage: StagedPage) -> None:
    """Addresses of the style lie in the folder of the base map."""
    lake = {
        "type": "Feature",
        "properties": {},
        "geometry": {
            "type": "Polygon",
            "coordinates": [[[-99, 29], [-97, 29], [-98, 31], [-99, 29]]],
        },
    }
    stage.answers |= {
        "/console-map/style.json": {
            "version": 8,
            "sources": {"lakes": {"type": "geojson", "data": "lakes.json"}},
            "layers": [{"id": "lakes", "type": "fill", "source": "lakes"}],
        },
        "/console-map/lakes.json": lake,
    }
    page = stage.open("/console#/map").page

    page.wait_for_function(
        """() => document.querySelector(".map")?.fleetMap?.map
          .queryRenderedFeatures({layers: ["lakes"]}).length > 0"""
    )
    layers = page.evaluate(
        "document.querySelector('.map').fleetMap.map.getStyle().layers.map(({id}) => id)"
    )
    assert layers[0] == "lakes"
    assert "segments" in layers


@pytest.mark.long
def test_an_own_base_map_may_be_one_file_of_tiles(stage: StagedPage, tmp_path: Path) -> None:
    """The console reads parts of a PMTiles file, as the gateway sends them."""
    write_archive(tmp_path / "world.pmtiles")
    style = {
        "version": 8,
        "sources": {"world": {"type": "vector", "url": "pmtiles://world.pmtiles"}},
        "layers": [{"id": "land", "type": "fill", "source": "world", "source-layer": LAND}],
    }
    (tmp_path / "style.json").write_text(json.dumps(style))
    gateway = FastAPI()
    gateway.include_router(console_routes(base_map=BaseMap(tmp_path)))
    statuses = stage.ask(gateway, "**/console-map/**")

    page = stage.open("/console#/map").page

    page.wait_for_function(
        """() => document.querySelector(".map")?.fleetMap?.map
          .queryRenderedFeatures({layers: ["land"]}).length > 0"""
    )
    assert statuses[0] == 200
    assert set(statuses[1:]) == {206}
