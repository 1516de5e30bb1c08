"""People log in to the console in a browser; its tabs share a stream, and a drone moves."""

from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.end_to_end.browser import needs_browser
from tests.end_to_end.console_page import ConsolePage
from tests.end_to_end.ladder_network import ladders
from tests.end_to_end.shared_fleet import shared_fleet

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.integration,
    pytest.mark.storage_pair("embedded"),
    pytest.mark.fleet_rate(60.0),
    needs_browser,
]


def login_link(system: Any, key: str) -> str:
    """A link as `skyway console` prints it."""
    url: str = system.call("POST", "/v1/session-links", key=system.keys[key]).json()["url"]
    return url


@pytest.mark.long
def test_a_key_opens_the_console_and_a_wrong_key_does_not(browser: Browser, system: Any) -> None:
    console = ConsolePage(browser, system)
    page = console.page
    page.goto(f"{console.gateway_url}/console")
    page.get_by_label("API key").fill("sk_wrong")
    page.get_by_role("button", name="Log in").click()
    expect(page.get_by_role("alert")).to_be_visible()

    page.get_by_label("API key").fill(system.keys["SKYWAY_OPERATOR_KEY"])
    page.get_by_role("button", name="Log in").click()
    expect(page.locator(".person")).to_have_text("Operator")
    stored = page.evaluate("JSON.stringify([localStorage, sessionStorage, document.cookie])")
    assert (stored, page.url) == ('[{},{},""]', f"{console.gateway_url}/console")

    page.locator(".person").click()
    page.get_by_role("button", name="Log out").click()
    expect(page.get_by_label("API key")).to_be_visible()
    page.reload()
    expect(page.get_by_label("API key")).to_be_visible()


@pytest.mark.long
def test_a_login_link_opens_the_console_once(browser: Browser, system: Any) -> None:
    url = login_link(system, "SKYWAY_OPERATOR_KEY")
    first, second = ConsolePage(browser, system), ConsolePage(browser, system)

    first.page.goto(url)
    expect(first.page.locator(".person")).to_have_text("Operator")
    assert "login" not in first.page.url
    second.page.goto(url)
    expect(second.page.get_by_role("alert")).to_be_visible()
    expect(second.page.get_by_label("API key")).to_be_visible()


def test_an_operator_sees_a_drone_move_and_opens_its_plan(browser: Browser, system: Any) -> None:
    console = ConsolePage(browser, system).open_with(system.keys["SKYWAY_OPERATOR_KEY"])
    page, map_ = console.show("map").page, "document.querySelector('.map').fleetMap"
    with shared_fleet(system, {"seen": {}}) as fleets:
        drone = fleets["seen"]["drones"][0]["drone_id"]
        # The only network is shown without a choice.
        page.evaluate(
            """async (id) => (await import("/console/networks.js")).showNetwork(id)""", "seen"
        )
        longitude = f"{map_}.drones.tracks.get('{drone}')?.drone.position[0]"
        page.wait_for_function(f"() => {longitude} !== undefined")
        before = page.evaluate(f"() => {longitude}")
        system.request_delivery(["seen-s5"], pickup="seen-s1")
        page.wait_for_function(f"() => {longitude} > {before} + 0.001")

        console.show("map", "drone", drone)
        panel = console.panel("Drone")
        expect(panel).to_contain_text("Flies to Seen S")
        expect(panel.locator(".steps li").first).to_be_visible()
        expect(panel.get_by_label("Charge over time").locator("canvas")).to_be_visible()
        page.wait_for_function(f"() => {map_}.data.plan.features.length > 0")
        page.wait_for_function(f"() => {map_}.data.alternatives.features.length > 0")
        expect(panel).to_contain_text("Could land")
        assert console.serious_problems() == []
        assert console.sound(), (console.foreign, console.errors)


@pytest.mark.long
def test_a_link_asks_before_it_replaces_a_session(browser: Browser, system: Any) -> None:
    console = ConsolePage(browser, system).open_with(system.keys["SKYWAY_OPERATOR_KEY"])
    page, name = console.page, console.page.locator(".person")
    link = login_link(system, "SKYWAY_CUSTOMER_KEY")

    page.goto(link)
    expect(page.get_by_text("You are logged in as Operator")).to_be_visible()
    assert console.serious_problems() == []
    page.get_by_role("button", name="Stay logged in").click()
    expect(name).to_have_text("Operator")

    page.evaluate("link => { location.hash = new URL(link).hash }", link)
    with page.expect_event("load"):
        page.get_by_role("button", name="Use the link").click()
    expect(name).to_have_text("Newcomer")
    assert "login" not in page.url

    page.evaluate("link => { location.hash = new URL(link).hash }", link)
    page.get_by_role("button", name="Use the link").click()
    expect(page.get_by_text("this login link was used")).to_be_visible()
    expect(name).to_have_text("Newcomer")
    assert console.sound()


@pytest.mark.long
def test_a_deleted_key_ends_its_console(browser: Browser, system: Any) -> None:
    made = system.operate("POST", "/v1/keys", {"role": "operator", "subject_id": "night-shift"})
    console = ConsolePage(browser, system).open_with(made["key"])
    system.operate("DELETE", f"/v1/keys/{made['key_id']}")

    expect(console.page.get_by_label("API key")).to_be_visible()


_COUNTED_STREAMS = """
window.streams = [];
window.EventSource = class extends EventSource {
  constructor(url) { super(url); streams.push(this); }
};
"""
_OPEN_STREAMS = "() => streams.filter((each) => each.readyState === EventSource.OPEN).length"


def open_streams(pages: list[Page]) -> int:
    """How many streams of the live picture these tabs have together."""
    return sum(page.evaluate(_OPEN_STREAMS) for page in pages)


@pytest.mark.long
def test_tabs_of_a_browser_share_one_stream(browser: Browser, system: Any) -> None:
    """Another tab takes over within seconds from one that is closed or stands still."""
    console = ConsolePage(browser, system)
    first = console.page
    pages = [first, first.context.new_page(), first.context.new_page()]
    for page in pages:
        page.add_init_script(_COUNTED_STREAMS)
    console.open_with(system.keys["SKYWAY_OPERATOR_KEY"])
    for page in pages[1:]:
        page.goto(f"{console.gateway_url}/console")
        expect(page.locator(".connection")).to_have_text("Live")
    assert open_streams(pages) == 1

    first.close()
    left = pages[1:]
    system.eventually(lambda: open_streams(left) == 1, "another tab has the stream")
    network = ladders("shared-stream")
    system.operate("PUT", "/v1/networks/shared-stream", network)
    body = {"reason": "a stream for all"}
    system.operate("POST", "/v1/stations/shared-stream-s1/closures", body)
    for page in left:
        page.evaluate("location.hash = '#/alarms'")
        expect(page.locator("main")).to_contain_text("a stream for all")

    [leader] = [page for page in left if page.evaluate(_OPEN_STREAMS)]
    [other] = [page for page in left if page is not leader]
    leader.evaluate(
        """() => setTimeout(() => {
          for (const until = Date.now() + 12_000; Date.now() < until;);
        })"""
    )
    other.wait_for_function(_OPEN_STREAMS)
    leader.wait_for_function(
        "() => streams.every((each) => each.readyState === EventSource.CLOSED)"
    )
    other.locator(".person").click()
    other.get_by_role("button", name="Log out").click()
    for page in left:
        expect(page.get_by_label("API key")).to_be_visible()
        page.close()
