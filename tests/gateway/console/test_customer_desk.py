"""The customer's desk: a request by address or by a click on the map, people, and terms."""

import re
from copy import deepcopy
from typing import Any
from urllib.parse import parse_qs

import pytest
from playwright.sync_api import Page, Route, expect

from tests.end_to_end.browser import needs_browser, serious_problems
from tests.gateway.console.staged_page import StagedPage
from tests.gateway.console.test_questions import TWO_STATIONS

pytestmark = [pytest.mark.integration, needs_browser]

SESSION = {"subject_id": "alice", "role": "customer"}
SOON = "2026-03-01T12:30:00Z"


def near(station_id: str, walk_m: float) -> dict[str, Any]:
    return {"station_id": station_id, "name": None, "walk_m": walk_m}


def candidates(query: str) -> dict[str, Any]:
    """What /v1/places answers: stations of another network come first."""
    asked = {name: values[0] for name, values in parse_qs(query).items()}
    label, station_id = ("12 Oak Street", "b") if "address" in asked else ("0, 0.4", "a")
    stations = [near("elsewhere", 20.0), near(station_id, 320.4)]
    return {"candidates": [{"label": label, "position": [0.9, 0.001], "stations": stations}]}


def quote(**members: Any) -> dict[str, Any]:
    terms = {
        "cancellation": {"until_loaded": 0.2, "in_flight": 0.8},
        "late": [{"after_min": 15, "share": 0.1}],
    }
    offer = {
        "offer_id": "off_1",
        "provider_id": "prv_1",
        "drone_model_id": "m",
        "price": {"amount": 900, "currency": "USD"},
        "delivery_time_s": 600.0,
        "distance_m": 1000.0,
        "recharges": 0,
        "energy_j": 3600.0,
        "trips": 1,
        "pickup_at": SOON,
        "pickup_station_id": "a",
        "packages": [{"package_id": "p1", "eta_at": SOON, "destination_station_id": "b"}],
        "ways": [["a", "b"]],
        "tariff": {"payment_terms": terms},
    }
    place = {
        "fields": ["packages.0.destination"],
        "served_by": near("c", 100.0),
        "alternatives": [near("b", 320.4)],
    }
    return {
        "quote_id": "quo_1",
        "request": {"packages": [{"package_id": "p1"}]},
        "expires_wall_at": "2100-01-01T00:00:00Z",
        "places": [place],
        "offers": [offer],
        "infeasible": [],
    } | members


@pytest.fixture
def page(stage: StagedPage) -> Page:
    stage.answers |= {
        "/v1/sessions/current": SESSION,
        "/v1/networks": {"items": [{"network_id": "n"}], "next_cursor": None},
        "/v1/networks/n": TWO_STATIONS,
        "/v1/providers": {"items": [], "next_cursor": None},
        "/v1/places": candidates,
        "/v1/quotes": quote(),
        "/v1/deliveries": {"delivery_id": "dlv_1", "items": [], "next_cursor": None},
    }
    return stage.open("/console#/new").page


def choose_address(page: Page, button: str) -> None:
    page.get_by_label("Address, plus code").fill("12 Oak Street")
    page.get_by_role("button", name="Find", exact=True).click()
    page.get_by_role("button", name=button).click()


def asked_body(page: Page, button: str, path: str) -> Any:
    with page.expect_request(f"**{path}") as asked:
        page.get_by_role("button", name=button).click()
    return asked.value.post_data_json


def test_an_address_becomes_a_destination_with_its_station_and_walk(page: Page) -> None:
    page.get_by_role("combobox", name="Pickup").select_option("a")

    choose_address(page, "Deliver here")

    expect(page.get_by_role("combobox", name="To", exact=True)).to_have_value("b")
    expect(page.locator(".package")).to_contain_text("12 Oak Street: B, 320 m in a straight line")
    body = asked_body(page, "Ask for offers", "/v1/quotes")
    assert body["pickup"] == {"station_id": "a"}
    place = {"location": {"latitude": 0.001, "longitude": 0.9}, "max_walk_m": 1000}
    assert body["packages"][0]["destination"] == place


def test_a_package_is_ordered_with_its_proof(page: Page) -> None:
    page.get_by_role("combobox", name="Pickup").select_option("a")
    page.get_by_role("combobox", name="To", exact=True).select_option("b")

    plain = asked_body(page, "Ask for offers", "/v1/quotes")
    page.get_by_text("More wishes").click()
    page.get_by_label("Proof of the hand-over").select_option("PIN")
    proven = asked_body(page, "Ask for offers", "/v1/quotes")

    assert "dropoff_verification" not in plain["packages"][0]
    assert proven["packages"][0]["dropoff_verification"] == {"method": "PIN"}


@pytest.mark.long
def test_a_station_that_is_chosen_later_replaces_the_place(page: Page) -> None:
    page.get_by_role("combobox", name="Pickup").select_option("a")
    choose_address(page, "Deliver here")

    page.get_by_role("combobox", name="To", exact=True).select_option("b")

    expect(page.locator(".chosen-place")).to_have_count(0)
    body = asked_body(page, "Ask for offers", "/v1/quotes")
    assert body["packages"][0]["destination"] == {"station_id": "b"}


@pytest.mark.long
def test_a_click_beside_the_stations_chooses_the_point(stage: StagedPage, page: Page) -> None:
    place = page.wait_for_function(
        """() => {
          const {map, network} = document.querySelector(".map")?.fleetMap ?? {};
          return network ? map.project([0.4, 0]) : null;
        }"""
    ).json_value()

    page.locator(".map").click(position=place)

    expect(page.get_by_role("combobox", name="Pickup")).to_have_value("a")
    expect(page.locator(".chosen-place")).to_contain_text("A point on the map: A, 320 m")
    searched = next(each for each in stage.asked if "/v1/places" in each)
    assert "max_walk_m=1000" in searched
    assert abs(float(parse_qs(searched.partition("?")[2])["longitude"][0]) - 0.4) < 0.01


@pytest.mark.long
def test_coordinates_and_plus_codes_are_asked_as_such(stage: StagedPage, page: Page) -> None:
    for typed in ("29.88, -97.94", "V3M5+8C San Marcos"):
        page.get_by_label("Address, plus code").fill(typed)
        with page.expect_response("**/v1/places**"):
            page.get_by_role("button", name="Find", exact=True).click()

    searched = [parse_qs(each.partition("?")[2]) for each in stage.asked if "/v1/places" in each]
    assert searched[0]["latitude"] == ["29.88"]
    assert searched[0]["longitude"] == ["-97.94"]
    assert searched[-1]["plus_code"] == ["V3M5+8C San Marcos"]


def test_an_offer_shows_its_walk_and_terms_and_is_taken_with_the_people(page: Page) -> None:
    page.get_by_role("combobox", name="Pickup").select_option("a")
    choose_address(page, "Deliver here")
    page.get_by_text("Who takes the packages (optional)").first.click()
    page.get_by_label("Name of the recipient").fill("Ana Ruiz")
    page.get_by_label("Phone").fill("+15125550100")
    page.get_by_label("Instructions").fill("Ring at the blue door.")

    quoted = asked_body(page, "Ask for offers", "/v1/quotes")

    assert "recipient" not in quoted
    offers = page.get_by_role("list", name="Offers")
    expect(offers).to_contain_text("Hand-over at B, 320 m in a straight line")
    expect(offers).to_contain_text("Cancellation: 20 % of the price once booked, 80 % after")
    expect(offers).to_contain_text("10 % if more than 15 min late")
    assert serious_problems(page) == []
    assert asked_body(page, "Take the offer", "/v1/deliveries") == {
        "quote_id": "quo_1",
        "offer_id": "off_1",
        "recipient": {"name": "Ana Ruiz", "phone": "+15125550100"},
        "instructions": "Ring at the blue door.",
    }


def refuse_once(page: Page, status: int, **members: Any) -> list[str]:
    """The gateway refuses the first order; the list gets the body of each order."""
    sent: list[str] = []

    def answer(route: Route) -> None:
        if route.request.method != "POST":
            return route.fallback()
        sent.append(str(route.request.post_data))
        if len(sent) > 1:
            return route.fulfill(status=202, json={"delivery_id": "dlv_1"})
        return route.fulfill(status=status, json=members, headers={"Retry-After": "0"})

    page.route("**/v1/deliveries", answer)
    return sent


def accept_best_offer(page: Page) -> None:
    page.get_by_role("combobox", name="Pickup").select_option("a")
    page.get_by_role("combobox", name="To", exact=True).select_option("b")
    page.get_by_role("button", name="Ask for offers").click()
    page.get_by_role("button", name="Take the offer").click()


def test_an_offer_that_is_gone_is_followed_by_new_offers_and_the_reason_stays(
    stage: StagedPage, page: Page
) -> None:
    refuse_once(page, 409, code="OFFER_LOST", detail="offer off_1 cannot be kept")
    quotes = iter([quote(), quote(quote_id="quo_2")])
    stage.answers["/v1/quotes"] = lambda _: next(quotes)
    stage.install_clock()

    accept_best_offer(page)

    said = page.get_by_text("That offer is gone: its drone flies for somebody else")
    expect(said).to_be_visible()
    page.clock.run_for(60_000)
    expect(said).to_be_visible()
    assert asked_body(page, "Take the offer", "/v1/deliveries")["quote_id"] == "quo_2"
    expect(said).to_have_count(0)


@pytest.mark.parametrize(
    ("status", "code"), [(503, "OVERLOADED"), (429, "OVERLOADED"), (503, None)]
)
def test_an_order_that_was_not_taken_for_lack_of_time_is_sent_again(
    page: Page, status: int, code: str | None
) -> None:
    sent = refuse_once(page, status, code=code, detail="too much is asked")

    accept_best_offer(page)

    expect(page).to_have_url(re.compile("#/deliveries/dlv_1"))
    assert len(sent) == 2
    assert sent[0] == sent[1]


@pytest.mark.long
def test_the_pickup_of_the_last_delivery_is_suggested_unless_one_is_chosen(
    stage: StagedPage, page: Page
) -> None:
    stage.answers["/v1/deliveries"] = {"items": [{"pickup": {"station_id": "b"}}]}
    page.reload()

    pickup = page.get_by_role("combobox", name="Pickup")
    expect(pickup).to_have_value("b")
    pickup.select_option("a")
    page.get_by_role("button", name="Begin again").click()
    expect(pickup).to_have_value("")


@pytest.mark.long
def test_a_station_is_found_by_a_part_of_its_name(stage: StagedPage, page: Page) -> None:
    named: Any = deepcopy(TWO_STATIONS)
    named["features"][1]["properties"]["name"] = "Beta Square"
    stage.answers["/v1/networks/n"] = named
    page.reload()
    page.get_by_role("combobox", name="Pickup").select_option("a")
    search = page.get_by_label("Address, plus code")
    search.fill("b")
    expect(page.get_by_role("list", name="Stations")).to_have_count(0)
    search.fill("squ")
    expect(page.get_by_role("button", name="Deliver to Beta Square")).to_be_visible()

    search.press("Enter")

    expect(page.get_by_role("combobox", name="To", exact=True)).to_have_value("b")
    expect(search).to_have_value("")


@pytest.mark.long
def test_busy_drones_say_how_long_the_wait_probably_is(stage: StagedPage, page: Page) -> None:
    reason = {"provider_id": None, "code": "BUSY", "detail": "busy", "is_temporary": True}
    free = {"data": {"free_at": "2026-03-01T12:20:00Z"}}
    stage.answers["/v1/quotes"] = quote(offers=[], infeasible=[reason | free])
    stage.answers["/v1/networks/n/status"] = {
        "status": "DEGRADED",
        "restrictions": [{"code": "NO_IDLE_DRONES", "detail": "all are busy", "until": None}],
        "more_restrictions": 0,
    }
    page.reload()
    page.get_by_role("combobox", name="Pickup").select_option("a")
    page.get_by_role("combobox", name="To", exact=True).select_option("b")
    status = page.get_by_role("status", name="Service status")
    expect(status).to_contain_text("the next free drone flies your delivery")
    expect(status).not_to_contain_text("restricted")

    page.get_by_role("button", name="Ask for offers").click()

    answer = page.get_by_role("region", name="Answer")
    expect(answer).to_contain_text("All drones are busy just now")
    expect(answer).to_contain_text("free in 20 min")
    body = asked_body(page, "Order it all the same", "/v1/deliveries")
    assert body["packages"][0]["destination"] == {"station_id": "b"}


@pytest.mark.long
def test_a_place_without_a_station_near_is_said(stage: StagedPage, page: Page) -> None:
    stage.answers["/v1/places"] = {"candidates": []}
    page.get_by_label("Address, plus code").fill("Nowhere")

    page.get_by_role("button", name="Find", exact=True).click()

    expect(page.get_by_text("No station of this network is near")).to_be_visible()


@pytest.mark.long
@pytest.mark.parametrize("width", [390, 360])
def test_the_form_fits_a_phone_with_targets_for_a_thumb(page: Page, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 844})
    choose_address(page, "Pick up here")
    expect(page.locator(".chosen-place")).to_be_visible()

    assert page.evaluate("document.querySelector('main').scrollWidth <= innerWidth")
    page.get_by_role("combobox", name="To", exact=True).select_option("b")
    page.get_by_role("button", name="Ask for offers").click()
    expect(page.get_by_role("button", name="Take the offer")).to_be_in_viewport(ratio=1)
    page.evaluate("document.querySelectorAll('details').forEach((each) => (each.open = true))")
    small = page.evaluate(
        """[...document.querySelectorAll(".request-view button, .request-view select,"
            + " .request-view input:not([type=checkbox])")]
          .filter((each) => !each.closest(".map") && each.getBoundingClientRect().height < 44)
          .map(({outerHTML}) => outerHTML)"""
    )
    assert small == []
