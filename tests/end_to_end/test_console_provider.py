"""Providers use the console in a browser: drones, enrolment, maintenance, the loading desk."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, expect

from tests.end_to_end.browser import needs_browser
from tests.end_to_end.console_page import ConsolePage
from tests.end_to_end.local_system import LocalSystem
from tests.end_to_end.shared_fleet import shared_fleet

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.integration,
    pytest.mark.storage_pair("embedded"),
    pytest.mark.fleet_rate(60.0),
    needs_browser,
]

#: Opens a console with a key.
OpenConsole = Callable[[str], ConsolePage]

MARKUP = "<img src=x onerror=alert(1)><b>bold</b>"


@pytest.fixture
def opened(browser: Browser, system: Any) -> Iterator[OpenConsole]:
    """Opens consoles; nothing in them may go wrong, and nothing may come from elsewhere."""
    consoles: list[ConsolePage] = []

    def with_key(key: str) -> ConsolePage:
        consoles.append(ConsolePage(browser, system))
        return consoles[-1].open_with(key)

    yield with_key
    for console in consoles:
        assert console.sound(), (console.foreign, console.errors)


@pytest.fixture(scope="module")
def fleets(running_system: LocalSystem) -> Iterator[dict[str, Any]]:
    """A provider with a drone for each story, by the name of the story's network."""
    by_hand = {"loading": "CONFIRMED"}
    providers: dict[str, dict[str, Any]] = {
        "enrolled": {},
        "repaired": {},
        "weighed": by_hand,
        "missing": by_hand,
        "own-air": {"name": "Own Air"},
        "other-air": {"name": "Other Air"},
    }
    with shared_fleet(running_system, providers, near=tuple(providers)) as registered:
        yield registered


def drones_of(system: Any, provider: Any) -> Any:
    return system.operate("GET", f"/v1/providers/{provider['provider_id']}/drones")["items"]


def test_a_provider_registers_a_drone_and_sees_its_token(
    opened: OpenConsole, system: Any, fleets: dict[str, Any]
) -> None:
    provider = fleets["enrolled"]
    console = opened(provider["key"])
    page = console.show("fleet").page
    page.get_by_label("Model", exact=True).select_option("quick-charge")
    page.get_by_label("Home station").select_option("enrolled-s2")
    page.get_by_label("Name (optional)").fill(MARKUP)
    page.get_by_role("button", name="Register the drone").click()
    console.show_key()

    token = page.get_by_role("textbox", name="Token", exact=True)
    first = token.input_value()
    assert first.startswith("enr_")
    code = page.get_by_role("img", name=f"Enrolment token of {MARKUP} as a QR code")
    expect(code.locator("path")).to_be_attached()
    assert console.serious_problems() == []
    row = page.get_by_role("table", name="Drones").get_by_role("row", name=MARKUP)
    expect(row.locator(".state")).to_have_text("Registered")

    page.get_by_role("button", name="I have kept it").click()
    expect(token).to_have_count(0)
    row.get_by_role("button", name="What to do with").click()
    page.get_by_role("button", name="Another enrolment token").click()
    console.show_key()
    expect(token).not_to_have_value(first)
    assert page.locator("main img, main b").count() == 0
    assert len(drones_of(system, provider)) == 2


@pytest.mark.long
def test_a_provider_takes_a_drone_into_maintenance_and_back(
    opened: OpenConsole, system: Any, fleets: dict[str, Any]
) -> None:
    provider = fleets["repaired"]
    console = opened(provider["key"])
    page = console.show("fleet").page
    [drone] = provider["drones"]
    state = page.locator(f"[data-drone={drone['drone_id']}] .state")

    menu = page.get_by_role("button", name="What to do with")
    menu.click()
    page.get_by_role("button", name="into maintenance").click()
    console.agree(after="gets no missions until")
    expect(state).to_have_text("Maintenance")
    assert [each["state"] for each in drones_of(system, provider)] == ["MAINTENANCE"]
    menu.click()
    page.get_by_role("button", name="back in service").click()
    console.agree(after="gets missions again")
    expect(state).to_have_text("Available")
    system.until_available(provider["provider_id"], drones=1)


@pytest.mark.long
def test_loading_is_confirmed_at_the_desk(
    opened: OpenConsole, system: Any, fleets: dict[str, Any]
) -> None:
    provider = fleets["weighed"]
    console = opened(provider["key"])
    page = console.show("fleet", "loading").page
    expect(page.get_by_text("No drone waits for its packages.")).to_be_visible()
    delivery_id = system.request_delivery(["weighed-s2", "weighed-s2"], pickup="weighed-s1")

    desk = page.get_by_role("list", name="Drones that wait").get_by_role("form")
    expect(desk).to_contain_text("at Weighed S1")
    expect(desk).to_contain_text("The drone waits there.")
    expect(desk).to_contain_text("By the request 1 kg in all.")
    for package_id in ("p1", "p2"):
        desk.get_by_label(f"Measured mass of {package_id} in kg").fill("0.45")
    desk.get_by_role("button", name="Confirm loading").click()
    expect(page.get_by_text("Loading is confirmed.")).to_be_visible()
    expect(desk).to_have_count(0)

    system.until_state(delivery_id, "COMPLETED")
    earnings = f"/v1/providers/{provider['provider_id']}/earnings"
    system.eventually(lambda: system.operate("GET", earnings)["missions"], "a mission that earned")
    console.show("fleet", "earnings")
    expect(page.get_by_role("table", name="Earnings by day").locator("tbody tr")).to_have_count(1)
    expect(page.get_by_text("with 1 delivery in 1 mission")).to_be_visible()


@pytest.mark.long
def test_a_missing_package_ends_the_mission(
    opened: OpenConsole, system: Any, fleets: dict[str, Any]
) -> None:
    provider = fleets["missing"]
    console = opened(provider["key"])
    page = console.show("fleet", "loading").page
    system.request_delivery(["missing-s2"], pickup="missing-s1")

    page.get_by_label("p1 is not here").check()
    page.get_by_role("button", name="Confirm loading").click()
    expect(page.get_by_role("status").filter(has_text="The mission has ended")).to_be_visible()


@pytest.mark.long
def test_a_provider_sees_its_own_fleet_and_an_operator_every_one(
    opened: OpenConsole, system: Any, fleets: dict[str, Any]
) -> None:
    own = fleets["own-air"]
    other = fleets["other-air"]
    console = opened(own["key"])
    page = console.show("fleet").page
    views = page.get_by_role("navigation", name="Views").get_by_role("link")
    expect(page.get_by_role("heading", name="Fleet of Own Air")).to_be_visible()
    expect(page.get_by_role("table", name="Drones").locator("tbody tr")).to_have_count(1)
    expect(views).not_to_contain_text(["New delivery"])
    for view in ("new", "deliveries"):
        console.show(view)
        expect(page.get_by_role("heading", name="Your fleet")).to_be_visible()

    operator = opened(system.keys["SKYWAY_OPERATOR_KEY"])
    page = operator.show("fleet").page
    for provider in (own, other):
        page.get_by_label("Provider").select_option(provider["provider_id"])
        [drone] = provider["drones"]
        expect(page.locator("tr[data-drone]")).to_have_attribute("data-drone", drone["drone_id"])
