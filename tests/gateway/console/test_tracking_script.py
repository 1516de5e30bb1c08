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
        "eta_until_at": after(eta_s + 240),
        "is_p90": True,
        "due_at": after(eta_s + 240),
        "delivered_at": None,
        "code": None,
        "alternative_id": "c",
    }
    return {
        "stage": "ON_THE_WAY",
        "state": "IN_PROGRESS",
        "is_over": False,
        "is_replanning": False,
        "is_waiting": False,
        "is_shared": False,
        "activity": "FLYING",
        "requested_at": after(-900),
        "loaded_at": after(-300),
        "drone_free_at": None,
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


WAITING: dict[str, Any] = {"stage": "REQUESTED", "state": "REQUESTED", "is_waiting": True}


def ended(stage: str, **package: Any) -> dict[str, Any]:
    """A delivery that is over."""
    shown = state(stage=stage, state=stage, is_over=True)
    shown["packages"][0] |= {"eta_at": None} | package
    return shown


@pytest.mark.parametrize(
    ("shown", "headline", "below"),
    [
        (state(eta_s=50), "Your package is about to land", "Very likely by 12:04"),
        (state(eta_s=-60), "Your package is about to land", "Very likely by 12:03"),
        (state(), "Your package lands in 10 min", "The drone flies to B."),
        (state(), "Your package lands in 10 min", "It is expected at 12:10."),
        (state(eta_s=8000), "Your package lands in 2 h 13 min", "Very likely by 14:17"),
        (state(eta_s=30_000), "Your package lands at 20:20", "Very likely by 20:24"),
        (state(activity="RECHARGING"), "Your package lands in 10 min", "charges its battery"),
        (state(is_shared=True), "Your package lands in 10 min", "carries packages of others too."),
        (state(eta_s=60, is_replanning=True), "On the way", "The plan is being changed"),
        (state(eta_s=-600), "On the way", "It takes longer than planned"),
        (state(eta_s=-600, stage="LOADING"), "Planned", "Expected at 11:50"),
        (state(**WAITING), "Waiting for a drone", "as soon as one is free"),
        (state(**WAITING, drone_free_at=after(420)), "Waiting for a drone", "free in 7 min"),
        (ended("DELIVERED", delivered_at=after(-60)), "Delivered at 11:59", "15 min earlier"),
        (ended("PARTLY_DELIVERED"), "Delivered in part", "can send it again"),
        (ended("ENDED"), "Not delivered", "The sender knows what happened"),
        (ended("CANCELLED"), "This delivery was cancelled", "if you still expect it"),
    ],
)
def test_the_headline_says_only_what_is_known(
    stage: StagedPage, shown: dict[str, Any], headline: str, below: str
) -> None:
    stage.answers[f"{PAGE}/state"] = shown

    page = stage.open(PAGE).page

    expect(page.locator("#headline")).to_have_text(headline)
    expect(page.locator("#hero")).to_contain_text(below)


def test_without_a_p90_nothing_is_called_likely(stage: StagedPage) -> None:
    shown = state()
    shown["packages"][0] |= {"is_p90": False, "due_at": after(300)}
    stage.answers[f"{PAGE}/state"] = shown

    page = stage.open(PAGE).page

    expect(page.locator("#promise")).to_have_text(
        "Expected at 12:10, later than the promise, 12:05"
    )


def test_stages_have_their_times_and_the_page_its_zone(stage: StagedPage) -> None:
    stage.answers[f"{PAGE}/state"] = state()

    page = stage.open(PAGE).page

    stages = ["Requested11:45", "Planned", "On the way11:55", "Delivered12:10"]
    expect(page.locator("#stages li")).to_have_text(stages)
    expect(page.locator("#zone")).to_contain_text("your time zone, UTC")


@pytest.mark.parametrize(
    ("code", "why"),
    [("RECIPIENT_ABSENT", "Nobody took it at the pad."), ("SILENT", "could not finish")],
)
def test_a_package_that_comes_back_says_why(stage: StagedPage, code: str, why: str) -> None:
    shown = state()
    shown["packages"][0] |= {"state": "RETURNING", "code": code, "eta_at": None}
    stage.answers[f"{PAGE}/state"] = shown

    card = stage.open(PAGE).page.locator("#packages article")

    expect(card).to_contain_text("On its way back to the sender")
    expect(card).to_contain_text(why)


def test_the_walk_to_the_pad_is_worked_out_in_the_browser(stage: StagedPage) -> None:
    stage.answers[f"{PAGE}/state"] = state(
        places=[{"station_id": "b", "position": [0, 0], "role": "DESTINATION"}]
    )
    stage.page.add_init_script(
        """Object.defineProperty(window, "isSecureContext", {get: () => true});
        Object.defineProperty(navigator, "geolocation", {get: () => ({getCurrentPosition: (found) =>
          found({coords: {longitude: -0.004, latitude: -0.004}})})});"""
    )
    page = stage.open(PAGE).page

    page.get_by_role("button", name="How far is it?").click()

    walk = "About 630 m to the northeast of you in a straight line, 8 min on foot."
    expect(page.locator("#packages .walk")).to_have_text(walk)
    assert not [each for each in stage.asked if "0.004" in each]


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
    expect(page).to_have_title("Your package lands in 10 min – Hill <b>Books</b>")
    card = page.locator("#packages article")
    expect(card).to_contain_text("29.50000° north, 97.88000° west")
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

    expect(page.locator("#headline")).to_have_text("Your package lands in 5 min")
    expect(page.locator("#map .drone")).to_have_count(0)
    assert stage.streams(STREAM) == 2


def test_the_page_goes_on_when_the_gateway_answers_again(stage: StagedPage) -> None:
    stage.install_clock()
    stage.answers[f"{PAGE}/state"] = state()
    page = stage.open(PAGE).page
    expect(page.locator("#headline")).to_have_text("Your package lands in 10 min")
    stage.is_silent = True
    stage.fail(STREAM, is_refused=True)
    expect(page.locator("#connection")).to_contain_text("No connection since 12:00")

    stage.is_silent = False
    page.clock.fast_forward(6_000)
    expect(page.locator("#connection")).to_be_hidden()


def test_a_drone_glides_between_two_reports_and_fades_when_it_is_silent(stage: StagedPage) -> None:
    stage.install_clock()
    stage.page.emulate_media(reduced_motion="no-preference")
    ends = [
        {"station_id": name, "position": [0.0, latitude], "role": "STOP"}
        for name, latitude in (("a", 0.1), ("b", 0.0))
    ]
    stage.answers[f"{PAGE}/state"] = state(places=ends)
    page = stage.open(PAGE).page
    drone = {"position": [0.0, 0.1], "at": after(0)}
    stage.send(STREAM, "snapshot", {"drones": {"drn_1": drone}})
    expect(page.locator("#map .drone")).to_have_count(1)
    page.clock.run_for(2_000)
    stage.send(STREAM, "change", {"drones": {"drn_1": {"position": [0.0, 0.0], "at": after(2)}}})
    places = []
    for _ in range(6):
        page.clock.run_for(900)
        places.append(page.locator("#map .drone").get_attribute("transform"))

    # It moves for as long as the report before was away, and then stands.
    assert places[0] not in places[1:]
    assert places[-1] == places[-2]
    stage.answers[f"{PAGE}/state"] = state(places=ends, now=after(120))
    page.clock.run_for(61_000)
    expect(page.locator("#map .drone.old")).to_have_count(1)
    expect(page.locator("#seen")).to_have_text("The drone was last seen at 12:00.")


@pytest.mark.long
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
