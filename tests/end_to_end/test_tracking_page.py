"""A recipient follows a delivery in a browser, by its link alone."""

from datetime import datetime, timedelta
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.end_to_end.browser import WatchedPage, needs_browser, serious_problems

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.integration,
    pytest.mark.storage_pair("embedded"),
    # Slow enough to be seen on its way.
    pytest.mark.fleet_rate(60.0),
    needs_browser,
]


def test_a_recipient_follows_a_delivery_to_its_proof(browser: Browser, system: Any) -> None:
    """The page goes on after the gateway was killed, and after nobody has looked at it."""
    system.publish_corridor("followed")
    system.start_fleet(["followed-s1"])
    url = request(system, "followed")["tracking_url"]

    watched = WatchedPage(browser, system.keys["SKYWAY_GATEWAY_URL"])
    page = watched.page
    page.goto(url)
    expect(page.locator("#stages li.now")).to_contain_text("On the way")
    page.wait_for_selector("#map .drone")
    expect(page.locator("#map .planned").first).to_be_attached()
    assert serious_problems(page) == []
    see(page, "hidden")
    system.kill("skyway_gateway")
    see(page, "visible")
    expect(page.locator("#headline")).to_contain_text("Delivered at")
    expect(page.locator("#packages .done")).to_contain_text("Handed over at Followed S2")
    expect(page.locator("#map .drone")).to_have_count(0)
    expect(page.locator("#connection")).to_be_hidden()

    assert (watched.foreign, watched.errors) == ([], [])


@pytest.mark.long
def test_a_page_ends_when_its_link_is_renewed_and_the_new_one_works(
    browser: Browser, system: Any
) -> None:
    system.publish_corridor("renewed")
    now = datetime.fromisoformat(system.operate("GET", "/v1/clock")["now"])
    later = now + timedelta(days=20)
    delivery = request(system, "renewed", earliest_pickup_at=later.isoformat())
    path = f"/v1/deliveries/{delivery['delivery_id']}/tracking-link"

    first, second = (WatchedPage(browser, system.keys["SKYWAY_GATEWAY_URL"]) for _ in range(2))
    first.page.goto(delivery["tracking_url"])
    expect(first.page.locator("#headline")).to_have_text("Requested")
    renewed = system.call("POST", path, key=system.keys["SKYWAY_CUSTOMER_KEY"]).json()
    expect(first.page.locator("#headline")).to_have_text("This link has ended")
    second.page.goto(renewed["tracking_url"])
    expect(second.page.locator("#headline")).to_have_text("Requested")

    cancel(system, delivery)


def see(page: Page, visibility: str) -> None:
    """The recipient looks at another page, or comes back to this one."""
    page.evaluate(
        """visibility => {
          Object.defineProperty(document, "visibilityState",
            {configurable: true, get: () => visibility});
          document.dispatchEvent(new Event("visibilitychange"));
        }""",
        visibility,
    )


def request(system: Any, place: str, **members: Any) -> Any:
    """A delivery that was just requested, as its customer sees it."""
    body = {
        "pickup": {"station_id": f"{place}-s1"},
        "packages": [
            {
                "package_id": "p1",
                "mass_kg": 0.5,
                "destination": {"station_id": f"{place}-s2"},
            }
        ],
        "qos": {"objective": "FASTEST"},
        **members,
    }
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    answer = system.call("POST", "/v1/deliveries", key=key, body=body)
    assert answer.status_code == 202, answer.text
    return answer.json()


def cancel(system: Any, delivery: Any) -> None:
    path = f"/v1/deliveries/{delivery['delivery_id']}/cancel"
    system.call("POST", path, key=system.keys["SKYWAY_CUSTOMER_KEY"], body={})
