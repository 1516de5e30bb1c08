"""Operators use the console in a browser: they watch, look into, close, command and acknowledge."""

import re
from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.end_to_end.browser import needs_browser
from tests.end_to_end.console_page import ConsolePage
from tests.end_to_end.ladder_network import QUICK_CHARGE, ladders
from tests.end_to_end.local_system import LocalSystem
from tests.end_to_end.shared_fleet import shared_fleet

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.long,
    pytest.mark.integration,
    pytest.mark.storage_pair("embedded"),
    pytest.mark.fleet_rate(60.0),
    needs_browser,
]

MARKUP = "<img src=x onerror=alert(1)><b>bold</b>"

#: The map, and the drones that it draws, in the page.
MAP = "document.querySelector('.map').fleetMap"
DRAWN = f"{MAP}.drones.tracks"

#: Drones whose batteries are cold raise an alarm.
COLD = "[battery]\ntemperature_c = -8\n"


@pytest.fixture(scope="module")
def operators_console(
    chromium: Browser, running_system: LocalSystem, fleets: dict[str, Any]
) -> Iterator[ConsolePage]:
    """The console of an operator who looks at one story after the other."""
    opened = ConsolePage(chromium, running_system)
    yield opened.open_with(running_system.keys["SKYWAY_OPERATOR_KEY"])
    opened.page.close()


@pytest.fixture
def console(operators_console: ConsolePage, system: Any) -> Iterator[ConsolePage]:
    """An operator's console; nothing in it may go wrong, and nothing may come from elsewhere."""
    page = operators_console.page
    page.emulate_media(color_scheme="light")
    if page.get_by_role("dialog").count():
        page.reload()  # the story before has failed
    yield operators_console.show("map")
    assert operators_console.sound(), (operators_console.foreign, operators_console.errors)


def publish(system: Any, name: str) -> None:
    system.operate("PUT", f"/v1/networks/{name}", ladders(name))
    system.operate("PUT", "/v1/drone-models/quick-charge", QUICK_CHARGE)


@pytest.fixture(scope="module")
def fleets(running_system: LocalSystem) -> Iterator[dict[str, Any]]:
    """A provider for each story that needs a drone, by the name of the story's network."""
    names = ("divert", "held", "commanded", "booked", "goes-on", "own", "foreign")
    near: dict[str, Any] = {"proof": {"name": MARKUP}, "played": {}}
    for name in ("clicked", "pads", "later", "area"):
        running_system.operate("PUT", f"/v1/networks/{name}", ladders(name))
    providers = {name: {} for name in names} | near
    with shared_fleet(running_system, providers, near=tuple(near)) as registered:
        yield registered


def drone_of(fleets: dict[str, Any], network: str) -> str:
    drone_id: str = fleets[network]["drones"][0]["drone_id"]
    return drone_id


def in_the_air(system: Any, name: str) -> str:
    """A delivery on its way from the first station to the last; its mission."""
    delivery_id = system.request_delivery([f"{name}-s5"], pickup=f"{name}-s1")

    def mission() -> str | None:
        package = system.operate("GET", f"/v1/deliveries/{delivery_id}")["packages"][0]
        is_on_board = (package.get("custodian") or {}).get("kind") == "DRONE"
        return package["mission_id"] if is_on_board else None

    found: str = system.eventually(mission, f"{delivery_id} in the air")
    return found


def shown_network(page: Page, name: str) -> None:
    page.get_by_label("Network").select_option(name)


def click_map(page: Page, position: str) -> None:
    """Click the map at a position, in JavaScript with the layers `drones` and `stations`."""
    x, y = page.evaluate(
        f"""() => {{
          const {{map, drones, stations}} = {MAP};
          const {{x, y}} = map.project({position});
          const {{left, top}} = map.getCanvas().getBoundingClientRect();
          return [x + left, y + top];
        }}"""
    )
    page.mouse.click(x, y)


def test_a_click_on_the_map_opens_what_is_there(console: ConsolePage, system: Any) -> None:
    page = console.page
    shown_network(page, "clicked")
    page.wait_for_function(
        f"() => {MAP}.stations.stations.some(({{stationId}}) => stationId === 'clicked-t3')"
    )
    click_map(page, "stations.stations.find(({stationId}) => stationId === 'clicked-t3').position")

    expect(console.panel("Station")).to_contain_text("Clicked T3")


def test_a_pad_is_closed_after_its_dry_run_and_opened_again(
    console: ConsolePage, system: Any
) -> None:
    console.show("map", "station", "pads-s2")
    panel = console.panel("Station")
    panel.get_by_role("button", name="Close pad 0").click()
    console.confirm(MARKUP, after="No mission needs another plan")

    expect(panel).to_contain_text("Pad 0 of Pads S2 is closed")
    expect(panel).to_contain_text(MARKUP)
    console.open_again(panel)
    expect(panel).not_to_contain_text("is closed")


def test_a_closure_of_later_is_seen_on_the_map_ahead(console: ConsolePage, system: Any) -> None:
    now = datetime.fromisoformat(system.operate("GET", "/v1/clock")["now"])
    span = {"from_at": now + timedelta(hours=20), "until": now + timedelta(hours=30)}
    order = {"reason": "crane", **{name: each.isoformat() for name, each in span.items()}}
    system.operate("POST", "/v1/stations/later-s2/closures", order)
    page = console.page
    shown_network(page, "later")
    pads = f"""() => {MAP}.data.stations?.features
      .find(({{properties}}) => properties.station_id === 'later-s2')?.properties.pads"""
    page.wait_for_function(f"() => ({pads})() === 'free'")
    page.get_by_label("Closures now").fill("25")
    page.wait_for_function(f"() => ({pads})() === 'closed'")
    page.get_by_label("Closures in").fill("0")

    console.show("alarms")
    item = page.get_by_role("list", name="Closed later").locator("li", has_text="crane")
    console.open_again(item)
    expect(item).to_have_count(0)


def test_a_closed_station_diverts_a_drone(
    console: ConsolePage, system: Any, fleets: dict[str, Any]
) -> None:
    mission = in_the_air(system, "divert")
    console.show("map", "station", "divert-s4")
    console.panel("Station").get_by_role("button", name="Close the station").click()
    expect(console.page.get_by_role("dialog")).to_contain_text("1 mission needs another plan")
    console.confirm("roof works", after="its last package comes")

    system.eventually(
        lambda: system.operate("GET", f"/v1/missions/{mission}")["mission"]["revision"] > 1,
        "another plan",
    )
    console.show("alarms")
    expect(console.page.locator("main")).to_contain_text("roof works")
    item = console.page.locator("li", has_text="Divert S4")
    console.open_again(item)
    expect(item).to_have_count(0)

    delivery_id = system.operate("GET", f"/v1/missions/{mission}")["mission"]["delivery_id"]
    happened = console.show("deliveries", delivery_id).page.get_by_label("What happened")
    expect(happened).to_contain_text(re.compile("p1 (as planned|.+ (earlier|later) than planned)"))


def test_an_area_is_drawn_and_closed(console: ConsolePage, system: Any) -> None:
    page = console.page
    shown_network(page, "area")
    console.show("map", "zone")
    page.wait_for_function(f"() => {MAP}.map.areTilesLoaded()")
    expect(console.panel("Close an area")).to_contain_text("0 corners")
    for x, y in ((300, 300), (500, 300), (500, 420)):
        page.mouse.click(x, y)
    expect(console.panel("Close an area")).to_contain_text("3 corners")
    page.get_by_role("button", name="Forbid take-offs").click()
    expect(page.get_by_role("dialog")).to_contain_text("mission")
    page.get_by_role("button", name="Do nothing").click()
    page.get_by_role("button", name="Close to flights").click()
    console.confirm("air show", after="mission")

    console.show("alarms")
    item = page.locator("li", has_text="air show")
    expect(item).to_contain_text("Area")
    console.open_again(item)
    expect(item).to_have_count(0)


def test_a_ground_stop_for_all_is_made_and_lifted(console: ConsolePage) -> None:
    console.show("alarms")
    page = console.page
    page.get_by_role("button", name="Stop all take-offs").click()
    console.confirm("storm", after="mission")

    item = page.locator("li", has_text="storm")
    expect(item).to_contain_text("Ground stop")
    console.open_again(item)
    expect(item).to_have_count(0)


def test_nothing_happens_when_an_operator_thinks_again(console: ConsolePage, system: Any) -> None:
    console.show("alarms")
    console.page.get_by_role("button", name="Stop all take-offs").click()
    console.page.get_by_role("button", name="Do nothing").click()

    expect(console.page.get_by_role("dialog")).to_have_count(0)
    expect(console.page.locator("main")).to_contain_text("Nothing is closed")


def test_a_mission_is_held_and_resumed(
    console: ConsolePage, system: Any, fleets: dict[str, Any]
) -> None:
    drone = drone_of(fleets, "held")
    mission = in_the_air(system, "held")
    console.show("map", "drone", drone)
    panel = console.panel("Drone")
    packages = console.page.get_by_label("What becomes of the packages")
    panel.get_by_role("button", name="Hold").click()
    expect(packages).to_contain_text("waits")
    console.confirm("crowd at the station", after="The drone lands at the next station")
    expect(panel).to_contain_text("held")

    panel.get_by_role("button", name="Resume").click()
    expect(packages).to_contain_text(re.compile("later|earlier"))
    console.confirm("the crowd has gone", after="A new plan is found")
    expect(panel.get_by_role("button", name="Hold")).to_be_visible()

    delivery_id = system.operate("GET", f"/v1/missions/{mission}")["mission"]["delivery_id"]
    ordered = console.show("deliveries", delivery_id).page.get_by_label("Who ordered what")
    expect(ordered).to_contain_text("crowd at the station")


def test_a_drone_is_diverted_after_the_dry_runs_of_other_commands(
    console: ConsolePage, system: Any, fleets: dict[str, Any]
) -> None:
    mission = in_the_air(system, "commanded")
    console.show("map", "drone", drone_of(fleets, "commanded"))
    panel, question = console.panel("Drone"), console.page.get_by_role("dialog")
    for command, meaning in (
        ("Cancel", "The mission ends"),
        ("Call home", "The drone brings its packages back"),
    ):
        panel.get_by_role("button", name=command).click()
        expect(question).to_contain_text(meaning)
        question.get_by_role("button", name="Do nothing").click()

    panel.get_by_label("Station for a diversion").select_option("commanded-t3")
    panel.get_by_role("button", name="Divert").click()
    console.confirm("smoke ahead", after="waits at Commanded T3")
    expect(panel).to_contain_text("held")
    panel.get_by_role("button", name="Call home").click()
    expect(question).to_contain_text("resume it first")
    expect(question.locator("button.danger")).to_be_disabled()
    question.get_by_role("button", name="Do nothing").click()

    delivery_id = system.operate("GET", f"/v1/missions/{mission}")["mission"]["delivery_id"]
    ordered = console.show("deliveries", delivery_id).page.get_by_label("Who ordered what")
    expect(ordered).to_contain_text("smoke ahead")


def test_an_alarm_that_one_acknowledges_leaves_every_console(
    chromium: Browser, console: ConsolePage, system: Any
) -> None:
    file = system.folder.path / "cold.toml"
    file.write_text(COLD)
    publish(system, "cold")
    scenario = ("--scenario", str(file))
    fleet = system.start_fleet(["cold-s1"], model_id="quick-charge", options=scenario)
    drone = fleet["drones"][0]["drone_id"]
    system.request_delivery(["cold-s2"], pickup="cold-s1")
    other = ConsolePage(chromium, system).open_with(system.keys["SKYWAY_OPERATOR_KEY"])
    rows = [
        each.show("alarms").page.locator(f"tr[data-alarm]:has(a[href$='{drone}'])").first
        for each in (console, other)
    ]
    for row in rows:
        expect(row).to_contain_text("Battery cold")
    alarm = rows[0].get_attribute("data-alarm")
    rows[0].get_by_role("button", name="Acknowledge").click()
    question = console.page.get_by_role("dialog")
    expect(question).to_contain_text("leaves the open alarms of everybody")
    question.get_by_label("Note").fill(MARKUP)
    question.get_by_role("button", name="Acknowledge").click()

    for each in (console, other):
        expect(each.page.locator(f"tr[data-alarm='{alarm}']")).to_have_count(0)
        expect(each.page.locator("main")).to_contain_text(f"by operator:operator: {MARKUP}")
    assert other.sound()
    other.page.close()


def test_a_delivery_is_found_and_followed_to_its_proof(console: ConsolePage, system: Any) -> None:
    body = {
        "pickup": {"station_id": "proof-s1"},
        "packages": [
            {"package_id": "p1", "mass_kg": 0.5, "destination": {"station_id": "proof-s2"}}
        ],
        "reference": MARKUP,
    }
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    delivery_id = system.call("POST", "/v1/deliveries", key=key, body=body).json()["delivery_id"]
    page = console.show("deliveries").page
    page.get_by_label("Whole reference").fill(MARKUP)
    page.get_by_label("Whole reference").press("Enter")
    row = page.get_by_role("row", name=re.compile(delivery_id[-6:]))
    expect(row).to_contain_text(MARKUP)
    row.get_by_role("link").click()

    events = page.get_by_label("What happened")
    expect(events).to_contain_text("Package delivered")
    expect(events).to_contain_text("Delivery completed")
    expect(page.get_by_role("heading", name="Proof")).to_be_visible()
    expect(page.locator("main")).to_contain_text("handed over at Proof S2")
    expect(page.locator("main")).to_contain_text(MARKUP)
    expect(page.locator("main img, main b")).to_have_count(0)
    steps = page.get_by_label("Planned and real")
    expect(steps.get_by_role("listitem").filter(has_text="Deliver at Proof S2")).to_contain_text(
        re.compile("on time|late|early")
    )
    page.get_by_role("link", name="Replay this flight").click()
    expect(page.locator(".chosen")).to_contain_text("with its plan of that time")


def test_the_calendar_shows_missions_and_pads_and_moves_by_keys(
    console: ConsolePage, system: Any, fleets: dict[str, Any]
) -> None:
    drone = drone_of(fleets, "booked")
    in_the_air(system, "booked")
    page = console.show("schedule").page
    calendar = page.get_by_label("Calendar")
    row = calendar.locator(".row", has_text=console.drone_name(drone))
    expect(row.locator("rect.ACTIVE")).to_be_attached()
    expect(row.get_by_role("link", name="p1 → Booked S5")).to_be_attached()
    first_hour = calendar.locator("svg text").first.text_content()
    calendar.focus()
    calendar.press("ArrowRight")
    expect(calendar.locator("svg text").first).not_to_have_text(first_hour or "")

    page.get_by_role("button", name="Now").click()
    page.get_by_role("button", name="Pads").click()
    expect(calendar.locator(".row", has_text="Booked S").first).to_be_attached()


def test_the_console_goes_on_after_the_gateway_was_killed(
    console: ConsolePage, system: Any, fleets: dict[str, Any]
) -> None:
    drone = drone_of(fleets, "goes-on")
    status = console.page.locator(".connection")
    system.kill("skyway_gateway")
    expect(status).to_contain_text("No connection")
    expect(status).to_have_text("Live")
    in_the_air(system, "goes-on")

    console.show("map", "drone", drone)
    expect(console.panel("Drone")).to_contain_text("Flies to")


def test_a_silent_service_is_named(console: ConsolePage, system: Any) -> None:
    status = console.page.locator(".connection")
    with system.silent("skyway_provider_registry"):
        expect(status).to_have_text("Partly old")
        expect(console.page.get_by_role("alert")).to_contain_text("Registry has not answered since")
        expect(console.page.locator("main.stale-registry")).to_be_attached()

    expect(status).to_have_text("Live")


def test_a_provider_sees_its_own_drones_and_no_command(
    chromium: Browser, system: Any, fleets: dict[str, Any]
) -> None:
    own, other = (fleets[name]["provider_id"] for name in ("own", "foreign"))
    made = system.operate("POST", "/v1/keys", {"role": "provider", "subject_id": own})
    console = ConsolePage(chromium, system).open_with(made["key"])
    page = console.show("map").page
    providers = f"() => [...{DRAWN}.values()].map(({{drone}}) => drone.provider_id)"
    page.wait_for_function(f"() => {DRAWN}.size > 0")

    assert page.evaluate(providers) == [own] != [other]
    expect(page.get_by_role("link", name="Deliveries")).to_have_count(0)
    console.show("map", "station", "own-s1")
    expect(console.panel("Station")).to_be_visible()
    expect(page.get_by_role("button", name="Close the station")).to_have_count(0)
    assert console.sound()
    page.close()


def test_an_operator_sees_how_the_services_are(console: ConsolePage, system: Any) -> None:
    page = console.show("health").page
    for service in ("Gateway", "Registry", "Composition"):
        card = page.locator(".card", has_text=service)
        expect(card).to_contain_text("all ready")
        expect(card).to_contain_text("% of a core")
        expect(card).to_contain_text("MB")
    expect(page.get_by_label("Queues")).to_contain_text("Queue: booking")
    with system.silent("skyway_composition"):
        expect(page.locator(".card", has_text="Composition")).to_contain_text("It does not answer")

    expect(page.locator(".card", has_text="Composition")).to_contain_text("all ready")


def test_a_past_hour_is_played_again(
    console: ConsolePage, system: Any, fleets: dict[str, Any]
) -> None:
    drone = drone_of(fleets, "played")
    place = "/v1/stations/played-t5/closures"
    closure = system.operate("POST", place, {"reason": "fog"})
    delivery_id = system.request_delivery(["played-s2"], pickup="played-s1")
    system.until_state(delivery_id, "COMPLETED")
    system.operate("DELETE", f"{place}/{closure['closure_id']}")
    shown_network(console.page, "played")
    page = console.show("replay").page
    # On a slow machine the hour that has just passed may begin after the flight.
    console.replay_from(closure["made_at"])
    expect(page.locator(".player")).to_contain_text("measured something")
    expect(page.get_by_label("What happened")).to_contain_text("Station Played T5 closed")
    page.get_by_label("Speed").select_option("60")
    page.get_by_role("button", name="Play", exact=True).click()
    longitude = f"{DRAWN}.get('{drone}')?.drone.position[0]"
    # A second of a busy machine is a minute of the replay, so the page itself pauses in time.
    pause = (
        """[...document.querySelectorAll("button")].find((one) => one.textContent === "Pause")"""
    )
    page.wait_for_function(f"() => {longitude} > -97.97 && ({pause}.click(), true)")

    click_map(page, f"drones.tracks.get('{drone}').drone.position")
    page.wait_for_function(f"() => {MAP}.data.plan.features.length > 0")
