"""Customers use the console in a browser: they ask, take an offer, follow it, and have keys."""

import re
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.end_to_end.browser import WatchedPage, needs_browser
from tests.end_to_end.clicks import Clicks
from tests.end_to_end.console_page import ConsolePage
from tests.end_to_end.ladder_network import ladders
from tests.end_to_end.local_system import LocalSystem
from tests.end_to_end.shared_fleet import shared_fleet

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.integration,
    pytest.mark.storage_pair("embedded"),
    pytest.mark.fleet_rate(60.0),
    needs_browser,
]

MARKUP = "<img src=x onerror=alert(1)><b>bold</b>"


def opened_console(browser: Browser, system: Any, key: str) -> Iterator[ConsolePage]:
    opened = ConsolePage(browser, system).open_with(key)
    yield opened
    assert opened.sound(), (opened.foreign, opened.errors)


@pytest.fixture
def customer(browser: Browser, system: Any) -> Iterator[ConsolePage]:
    yield from opened_console(browser, system, system.keys["SKYWAY_CUSTOMER_KEY"])


@pytest.fixture
def operator(browser: Browser, system: Any) -> Iterator[ConsolePage]:
    yield from opened_console(browser, system, system.keys["SKYWAY_OPERATOR_KEY"])


@pytest.fixture(scope="module", autouse=True)
def fleets(running_system: LocalSystem) -> Iterator[dict[str, Any]]:
    """A provider with a drone for each story, by the name of the story's network."""
    near = ("offered", "quoted", "ordered")
    with shared_fleet(running_system, {name: {} for name in near}, near=near) as registered:
        yield registered


def new_delivery(console: ConsolePage, network: str) -> Page:
    """The view with the form of a request in this network."""
    page = console.show("new").page
    page.get_by_label("Network").select_option(network)
    expect(page.locator(f"option[value={network}-s1]").first).to_be_attached()
    return page


def click_station(page: Page, station_id: str) -> None:
    """Click where the map shows a station."""
    place = page.wait_for_function(
        """id => {
          const {map, network, stations} = document.querySelector(".map").fleetMap ?? {};
          const isDrawn = stations?.stations.some(({stationId}) => stationId === id);
          if (!isDrawn) return null;
          const {geometry} = network.features.find(({properties}) => properties.station_id === id);
          const {x, y} = map.project(geometry.coordinates);
          return {x, y};
        }""",
        arg=station_id,
    ).json_value()
    page.locator(".map").click(position=place)


def test_a_customer_takes_an_offer_and_follows_its_delivery(
    browser: Browser, customer: ConsolePage
) -> None:
    """A recipient without a key follows too, until the customer withdraws the link."""
    page = new_delivery(customer, "offered")
    click_station(page, "offered-s1")
    expect(page.get_by_role("combobox", name="Pickup")).to_have_value("offered-s1")
    click_station(page, "offered-s3")
    expect(page.get_by_role("combobox", name="To", exact=True)).to_have_value("offered-s3")

    page.get_by_role("button", name="Ask for offers").click()
    offers = page.get_by_role("list", name="Offers")
    expect(offers).to_contain_text("Offered S1 – Offered S2 – Offered S3")
    page.wait_for_function(
        """() => document.querySelector(".map").fleetMap.data.plan.features
          .some(({properties}) => properties.status === "ENDED")"""
    )
    assert customer.serious_problems() == []
    page.get_by_role("button", name="Take the offer of Test Air").first.click()

    expect(page.get_by_role("heading", name="Delivery …")).to_be_visible()
    expect(page.get_by_label("What happened")).to_contain_text("Delivery requested")
    page.get_by_role("button", name="Show the link").click()
    customer.show_key()
    link = page.get_by_role("link", name="this link")
    earlier = link.get_attribute("href")
    expect(page.get_by_role("img", name="The link as a QR code")).to_be_visible()
    page.get_by_role("button", name="Another link").click()
    customer.show_key()
    expect(link).not_to_have_attribute("href", str(earlier))
    recipient = WatchedPage(browser, customer.gateway_url)
    recipient.page.goto(str(link.get_attribute("href")))
    expect(recipient.page.locator("#packages")).to_contain_text("p1 to Offered S3")
    page.get_by_role("button", name="Withdraw the link").click()
    page.get_by_role("button", name="Yes, withdraw").click()
    expect(page.get_by_label("Tracking link")).to_contain_text("There is no link")
    assert recipient.page.request.get(f"{recipient.page.url}/state").status == 404
    assert (recipient.foreign, recipient.errors) == ([], [])
    expect(page.get_by_label("What happened")).to_contain_text("Delivery completed")


@pytest.mark.long
def test_a_customer_orders_on_a_phone_with_few_clicks(browser: Browser, system: Any) -> None:
    """From the login to the accepted offer; the pickup is that of an earlier delivery."""
    # The story has one drone: an offer that is made before it flies would be lost to this delivery.
    system.until_ended(system.request_delivery(["ordered-s2"], pickup="ordered-s1"))
    phone = WatchedPage(
        browser, system.keys["SKYWAY_GATEWAY_URL"], viewport={"width": 390, "height": 844}
    )
    page = phone.page
    page.goto(f"{system.keys['SKYWAY_GATEWAY_URL']}/console")
    clicks = Clicks()
    page.get_by_label("API key").fill(system.keys["SKYWAY_CUSTOMER_KEY"])
    clicks.press(page.get_by_label("API key"), "Enter")
    clicks.click(page.get_by_role("link", name="New delivery").first)
    page.get_by_label("Network").select_option("ordered")
    expect(page.get_by_role("combobox", name="Pickup")).to_have_value("ordered-s1")
    page.get_by_label("Station, address").fill("Ordered S3")
    clicks.press(page.get_by_label("Station, address"), "Enter")
    clicks.click(page.get_by_role("button", name="Ask for offers"))
    clicks.click(page.get_by_role("button", name="Take the offer of Test Air").first)

    expect(page).to_have_url(re.compile("#/deliveries/dlv_"))
    assert clicks.count <= 8
    assert (phone.foreign, phone.errors) == ([], [])


@pytest.mark.long
def test_a_customer_asks_by_keyboard_and_learns_why_nobody_can_fly(
    customer: ConsolePage, system: Any
) -> None:
    system.operate("PUT", "/v1/networks/unserved", ladders("unserved"))
    page = new_delivery(customer, "unserved")
    page.get_by_role("combobox", name="Pickup").focus()
    page.keyboard.press("ArrowDown")
    page.get_by_role("combobox", name="To", exact=True).focus()
    page.keyboard.press("End")
    page.get_by_label("Mass in kg").press("Enter")

    answer = page.get_by_role("region", name="Answer")
    expect(answer).to_contain_text("Nobody can fly this")
    expect(answer.get_by_role("listitem").first).to_be_visible()


@pytest.mark.long
def test_markup_in_a_reference_stays_text(customer: ConsolePage, system: Any) -> None:
    page = new_delivery(customer, "quoted")
    page.get_by_role("combobox", name="Pickup").select_option("quoted-s1")
    page.get_by_role("combobox", name="To", exact=True).select_option("quoted-s2")
    page.get_by_text("More wishes").click()
    page.get_by_label("Reference").fill(MARKUP)
    page.get_by_role("button", name="Ask for offers").click()
    page.get_by_role("button", name="Take the offer of").first.click()

    expect(page.get_by_role("heading", name="What happened")).to_be_visible()
    expect(page.get_by_role("heading", name=MARKUP)).to_be_visible()
    customer.show("deliveries")
    expect(page.get_by_role("rowheader", name=MARKUP).first).to_be_visible()
    assert page.locator("main img, main b").count() == 0


@pytest.mark.long
def test_a_key_is_made_shown_once_and_deleted(operator: ConsolePage, system: Any) -> None:
    page = operator.show("account").page
    page.get_by_label("For: a customer").fill("river-books")
    page.get_by_label("Name (optional)").fill("laptop of River Books")
    page.get_by_text("Allow only some calls").click()
    page.get_by_label("account:read").check()
    page.get_by_role("button", name="Make the key").click()
    operator.show_key("sk_a_wrong_key")
    expect(page.get_by_text("this API key is not known")).to_be_visible()
    page.get_by_role("button", name="Make the key").click()
    operator.show_key()
    made = page.get_by_role("textbox", name="Key", exact=True).input_value()
    assert system.call("GET", "/v1/clock", key=made).status_code == 200
    assert system.call("GET", "/v1/deliveries", key=made).status_code == 403

    page.get_by_role("button", name="I have kept it").click()
    row = page.get_by_role("row", name="laptop of River Books")
    expect(row).to_contain_text("account:read")
    assert made not in page.content()
    row.get_by_role("button", name="Delete key").click()
    row.get_by_role("button", name="Yes, delete").click()
    expect(row).to_have_count(0)
    assert system.call("GET", "/v1/clock", key=made).status_code == 401


@pytest.mark.long
def test_a_customer_gets_the_next_key_and_the_session_ends_with_the_first(
    browser: Browser, system: Any
) -> None:
    made = system.operate("POST", "/v1/keys", {"role": "customer", "subject_id": "hill-books"})
    console = ConsolePage(browser, system).open_with(made["key"])
    page = console.show("account").page
    page.get_by_role("button", name="Get the next key").click()
    page.get_by_role("button", name="Yes, get the next key").click()
    console.show_key()
    following = page.get_by_role("textbox", name="Key", exact=True).input_value()

    assert system.call("GET", "/v1/clock", key=following).status_code == 200
    expect(page.get_by_label("API key")).to_be_visible()
    assert system.call("GET", "/v1/clock", key=made["key"]).status_code == 401


@pytest.mark.long
def test_a_customer_tests_a_webhook_and_sees_the_attempt(
    customer: ConsolePage, system: Any
) -> None:
    page = customer.show("account").page
    page.get_by_label("URL", exact=True).fill("http://127.0.0.1:9/nobody-listens")
    page.get_by_role("button", name="Add the webhook").click()
    customer.show_key()
    expect(page.get_by_role("textbox", name="Secret")).to_have_value(re.compile("whsec_.+"))
    row = page.get_by_role("row", name="nobody-listens").first
    row.get_by_role("button", name="Test").click()
    row.get_by_role("button", name="Attempts").click()
    attempts = page.get_by_role("table", name="Attempts")
    expect(attempts).to_contain_text("webhook.test")

    system.operate("PUT", "/v1/networks/notified", ladders("notified"))
    system.request_delivery(["notified-s2"], pickup="notified-s1")
    attempts.get_by_role("button", name="Send delivery.requested again").first.click()
    expect(page.get_by_text("What was found is sent again.")).to_be_visible()
    row.get_by_role("button", name="Delete the webhook").click()
    row.get_by_role("button", name="Yes, delete").click()
    expect(page.get_by_role("table", name="Webhooks")).to_contain_text("No webhook.")


@pytest.mark.long
def test_a_customer_sees_no_view_of_others(customer: ConsolePage) -> None:
    page = customer.page
    views = page.get_by_role("navigation", name="Views").get_by_role("link")
    expect(views).to_have_text(["Home", "Map", "New delivery", "Deliveries", "Statements"])
    for view in ("fleet", "schedule", "alarms"):
        customer.show(view)
        expect(page.get_by_role("heading", level=1)).to_contain_text("Newcomer")
