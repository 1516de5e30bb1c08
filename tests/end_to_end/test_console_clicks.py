"""An operator and a provider find what they look for with few clicks.

The customer's order is in test_console_customer.py.
"""

from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, expect

from tests.end_to_end.browser import needs_browser
from tests.end_to_end.clicks import Clicks
from tests.end_to_end.console_page import ConsolePage
from tests.end_to_end.local_system import LocalSystem
from tests.end_to_end.shared_fleet import shared_fleet

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.long,
    pytest.mark.integration,
    pytest.mark.storage_pair("embedded"),
    pytest.mark.fleet_rate(60.0),
    # The first page names three late deliveries, and other stories leave late ones behind.
    pytest.mark.system_name("clicks"),
    needs_browser,
]

#: The most clicks of each story.
DIVERTS_WITHIN = 4
READS_WITHIN = 3


@pytest.fixture(scope="module")
def fleets(running_system: LocalSystem) -> Iterator[dict[str, Any]]:
    """A provider whose drone will be late, and one that looks at its day."""
    providers: dict[str, dict[str, Any]] = {"late": {}, "day": {}}
    with shared_fleet(running_system, providers) as registered:
        yield registered


def flying(system: Any, name: str) -> tuple[str, str]:
    """A delivery whose package is on board of a drone, and its mission."""
    delivery_id = system.request_delivery([f"{name}-s5"], pickup=f"{name}-s1")

    def mission() -> str | None:
        package = system.operate("GET", f"/v1/deliveries/{delivery_id}")["packages"][0]
        is_on_board = (package.get("custodian") or {}).get("kind") == "DRONE"
        return package["mission_id"] if is_on_board else None

    return delivery_id, system.eventually(mission, f"{delivery_id} in the air")


def command(system: Any, mission_id: str, name: str) -> None:
    order = {"command": name, "reason": "a fair below"}
    system.operate("POST", f"/v1/missions/{mission_id}/commands", order)


def hold_until_late(system: Any, delivery_id: str, mission_id: str) -> None:
    """Hold the drone until its package can only come after its promise."""
    command(system, mission_id, "HOLD")

    def package() -> Any:
        return system.operate("GET", f"/v1/deliveries/{delivery_id}")["packages"][0]

    def is_too_late() -> bool:
        due = package()["due_at"] or package()["promised_at"]
        return bool(system.operate("GET", "/v1/clock")["now"] > due)

    system.eventually(is_too_late, "the promise has passed")


def test_an_operator_diverts_the_drone_that_is_late(
    browser: Browser, system: Any, fleets: dict[str, Any]
) -> None:
    console = ConsolePage(browser, system).open_with(system.keys["SKYWAY_OPERATOR_KEY"])
    page, clicks = console.show("home").page, Clicks()
    delivery_id, mission_id = flying(system, "late")
    hold_until_late(system, delivery_id, mission_id)

    clicks.click(page.locator(".headline").get_by_role("link", name="is late"))
    panel = console.panel("Drone")
    expect(panel).to_contain_text("held")
    # A drone that goes on earlier may land before a slow browser has opened its panel.
    command(system, mission_id, "RESUME")
    panel.get_by_label("Station for a diversion").select_option("late-t4")
    clicks.click(panel.get_by_role("button", name="Divert"))
    question = page.get_by_role("dialog")
    expect(question).to_contain_text("waits at Late T4")
    question.get_by_label("Reason").fill("the pad is needed")
    clicks.click(question.locator("button.danger"))

    expect(panel).to_contain_text("held")
    assert clicks.count <= DIVERTS_WITHIN
    assert console.sound()


def test_a_provider_reads_its_day(browser: Browser, system: Any, fleets: dict[str, Any]) -> None:
    delivery_id = system.request_delivery(["day-s2"], pickup="day-s1")
    system.eventually(
        lambda: system.operate("GET", f"/v1/deliveries/{delivery_id}")["state"] == "COMPLETED",
        "the delivery is over",
    )
    console = ConsolePage(browser, system).open_with(fleets["day"]["key"])
    page, clicks = console.page, Clicks()

    home = page.locator("main")
    for tile in ("Earned today", "Next maintenance", "Alarms"):
        expect(home).to_contain_text(tile)
    clicks.click(home.get_by_role("link", name="Earned today"))
    expect(page.locator("main")).to_contain_text("US$")

    assert clicks.count <= READS_WITHIN
    assert console.sound()
