"""What the tracking page's script shows of a delivery, and how it goes on after trouble."""

import re
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from playwright.sync_api import expect

from tests.end_to_end.browser import needs_browser, serious_problems
from tests.gateway.console.staged_page import StagedPage

pytestmark = [pytest.mark.integration, needs_browser]

NOW = datetime(2026, 3, 1, 12, tzinfo=UTC)
PAGE = "/track/secret"
STREAM = f"{PAGE}/events"


def after(seconds: float) -> str:
    return (NOW + timedelta(seconds=seconds)).isoformat()


def state(*, eta_s: float = 600.0, drones: Any = (), **members: Any) -> dict[str, Any]:
    """A delivery on its way, as the page gets it."""
    package = {
        "package_id": "p1",
        "state": "IN_TRANSIT",
        "station_id": "b",
        "eta_at": after(eta_s),
        "eta_until_at": after(eta_s),
        "alternative_id": "c",
    }
    return {
        "stage": "ON_THE_WAY",
        "state": "IN_PROGRESS",
        "is_over": False,
        "is_replanning": False,
        "is_waiting": False,
        "is_shared": False,
        "now": NOW.isoformat(),
        "rate": 1.0,
        "packages": [package],
        "flights": [],
        "station_names": {},
        "places": [{"station_id": "b", "position": [0, 0], "role": "DESTINATION"}],
        "drones": list(drones),
        "shop": {"name": None, "colour": None, "text_colour": None},
        **members,
    }


@pytest.mark.parametrize(
    ("shown", "headline", "detail"),
    [
        (state(eta_s=60), "Arriving", "1 min to B"),
        (state(eta_s=-60), "Arriving", "0 min to B"),
        (state(eta_s=600), "Arrives at 12:10", "10 min to B"),
        (state(is_shared=True), "Arrives at 12:10", "B. The drone carries packages of others too."),
        (state(eta_s=60, is_replanning=True), "On the way", "The plan is being changed"),
        (state(eta_s=-600), "On the way", "It takes longer than planned"),
        (state(eta_s=-600, stage="LOADING"), "Planned", "Expected at 11:50"),
    ],
)
def test_the_headline_says_only_what_is_known(
    stage: StagedPage, shown: dict[str, Any], headline: str, detail: str
) -> None:
    stage.answers[f"{PAGE}/state"] = shown

    page = stage.open(PAGE).page

    expect(page.locator("#headline")).to_have_text(headline)
    expect(page.locator("#detail")).to_contain_text(detail)


def test_the_head_shows_the_shop_and_a_package_its_station(stage: StagedPage) -> None:
    branding = {"name": "Hill <b>Books</b>", "colour": "#0b6bcb", "text_colour": "#ffffff"}
    stage.answers[f"{PAGE}/state"] = state(
        shop=branding,
        places=[{"station_id": "b", "position": [-97.88, 29.5], "role": "DESTINATION"}],
    )
    page = stage.open(PAGE).page
    head = page.locator("#shop")

    expect(head).to_have_text("Hill <b>Books</b>")
    expect(head).to_have_css("background-color", "rgb(11, 107, 203)")
    expect(page).to_have_title("Arrives at 12:10 – Hill <b>Books</b>")
    card = page.locator("#packages article")
    expect(card).to_contain_text("Pick-up place: B, 29.50000° north, 97.88000° west")
    expect(card.locator("a")).to_have_attribute("href", "geo:29.5,-97.88")
    assert serious_problems(page) == []


def test_a_page_without_branding_shows_no_shop(stage: StagedPage) -> None:
    stage.answers[f"{PAGE}/state"] = state()
    page = stage.open(PAGE).page

    expect(page.locator("#packages article")).to_be_visible()
    expect(page.locator("#shop")).to_be_hidden()


def test_a_hand_over_is_shown_with_what_the_drone_measured(stage: StagedPage) -> None:
    shown = state()
    shown["packages"][0] |= {
        "delivered_at": after(-60),
        "proof_station_id": "b",
        "proof_mass_kg": 0.45,
        "proof_position": [-97.88, 29.5],
    }
    stage.answers[f"{PAGE}/state"] = shown
    card = stage.open(PAGE).page.locator("#packages article")

    expect(card).to_contain_text("Handed over at B, 11:59")
    expect(card).to_contain_text("Mass: 0.45 kg")
    expect(card).to_contain_text("Place: 29.50000° north, 97.88000° west")


def test_a_newer_state_wins_over_a_stream_that_ended(stage: StagedPage) -> None:
    stage.answers[f"{PAGE}/state"] = state()
    page = stage.open(PAGE).page
    stage.send(STREAM, "snapshot", {"drones": {"drn_1": {"position": [0.1, 0.1]}}})
    drone = page.locator("#map .drone")
    expect(drone).to_have_count(1)
    stage.answers[f"{PAGE}/state"] = state(drones=[])
    stage.fail(STREAM, is_refused=True)

    expect(drone).to_have_count(0)


def test_a_page_that_is_seen_again_follows_anew(stage: StagedPage) -> None:
    stage.install_clock()
    stage.answers[f"{PAGE}/state"] = state()
    page = stage.open(PAGE).page
    stage.send(STREAM, "snapshot", {"drones": {"drn_1": {"position": [0.1, 0.1]}}})
    expect(page.locator("#map .drone")).to_have_count(1)
    stage.answers[f"{PAGE}/state"] = state(eta_s=300)

    stage.sleep(60)

    expect(page.locator("#headline")).to_have_text("Arrives at 12:05")
    expect(page.locator("#map .drone")).to_have_count(0)
    assert stage.streams(STREAM) == 2


def test_the_page_goes_on_when_the_gateway_answers_again(stage: StagedPage) -> None:
    stage.install_clock()
    stage.answers[f"{PAGE}/state"] = state()
    page = stage.open(PAGE).page
    expect(page.locator("#headline")).to_have_text("Arrives at 12:10")
    stage.is_silent = True
    stage.fail(STREAM, is_refused=True)
    expect(page.locator("#connection")).to_contain_text("No connection")

    stage.is_silent = False
    page.clock.fast_forward(6_000)
    expect(page.locator("#connection")).to_be_hidden()


def test_a_way_across_longitude_180_is_drawn_the_short_way(stage: StagedPage) -> None:
    west, east = [179.95, -17.0], [-179.95, -17.0]
    flight = {"status": "PLANNED", "from_position": west, "to_position": east}
    places = [
        {"station_id": "a", "position": west, "role": "PICKUP"},
        {"station_id": "b", "position": east, "role": "DESTINATION"},
    ]
    stage.answers[f"{PAGE}/state"] = state(flights=[flight], places=places)

    line = stage.open(PAGE).page.locator("#map line.planned")

    # The whole way fills the picture between its margins, from west to east.
    expect(line).to_have_attribute("x1", re.compile("^(44|43.9)"))
    expect(line).to_have_attribute("x2", re.compile("^(356|355.9)"))
