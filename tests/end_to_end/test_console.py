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

pytestmark = [
    pytest.mark.end_to_end,
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


@pytest.fixture
def console(browser: Browser, system: Any) -> Iterator[ConsolePage]:
    """An operator's console; nothing in it may go wrong, and nothing may come from elsewhere."""
    opened = ConsolePage(browser, system).open_with(system.keys["SKYWAY_OPERATOR_KEY"])
    yield opened
    assert opened.sound(), (opened.foreign, opened.errors)


def publish(system: Any, name: str) -> None:
    system.operate("PUT", f"/v1/networks/{name}", ladders(name))
    system.operate("PUT", "/v1/drone-models/quick-charge", QUICK_CHARGE)


def fleet(system: Any, network: str, *, options: tuple[str, ...] = (), **provider: Any) -> Any:
    """A provider with a drone at the first station of a new network of this name."""
    publish(system, network)
    return system.start_fleet(
        [f"{network}-s1"], model_id="quick-charge", options=options, **provider
    )


def in_the_air(system: Any, name: str) -> str:
    """A delivery on its way from the first station to the last; its mission."""
    delivery_id = system.request_delivery([f"{name}-s5"], pickup=f"{name}-s1")

    def mission() -> str | None:
        live = system.operate("GET", f"/v1/missions?delivery_id={delivery_id}")["items"]
        return live[0]["mission_id"] if live and live[0]["state"] == "ACTIVE" else None

    found: str = system.eventually(mission, f"{delivery_id} in the air")
    return found


def shown_network(page: Page, name: str) -> None:
    page.get_by_label("Network").select_option(name)


def click_map(page: Page, position: str) -> None:
    """Click the map at a position, an expression of JavaScript in which `drones` is its layer."""
    x, y = page.evaluate(
        f"""() => {{
          const {{map, drones}} = {MAP};
          const {{x, y}} = map.project({position});
          const {{left, top}} = map.getCanvas().getBoundingClientRect();
          return [x + left, y + top];
        }}"""
    )
    page.mouse.click(x, y)


def test_an_operator_sees_a_drone_move_and_opens_its_plan(
    console: ConsolePage, system: Any
) -> None:
    drone = fleet(system, "seen")["drones"][0]["drone_id"]
    page = console.page
    shown_network(page, "seen")
    longitude = f"{DRAWN}.get('{drone}')?.drone.position[0]"
    page.wait_for_function(f"() => {longitude} !== undefined")
    before = page.evaluate(f"() => {longitude}")
    in_the_air(system, "seen")
    page.wait_for_function(f"() => {longitude} > {before} + 0.001")

    console.show("map", "drone", drone)
    panel = console.panel("Drone")
    expect(panel).to_contain_text("Flying")
    expect(panel).to_contain_text("Lands next")
    expect(panel.locator(".steps li").first).to_be_visible()
    expect(panel.get_by_label("Charge over time").locator("canvas")).to_be_visible()
    page.wait_for_function(f"() => {MAP}.data.plan.features.length > 0")
    page.wait_for_function(f"() => {MAP}.data.alternatives.features.length > 0")
    expect(panel).to_contain_text("Could land")


def test_a_click_on_the_map_opens_what_is_there(console: ConsolePage, system: Any) -> None:
    publish(system, "clicked")
    page = console.page
    page.reload()
    shown_network(page, "clicked")
    page.wait_for_function(
        f"() => {MAP}.drones.stations.some(({{stationId}}) => stationId === 'clicked-t3')"
    )
    click_map(page, "drones.stations.find(({stationId}) => stationId === 'clicked-t3').position")

    expect(console.panel("Station")).to_contain_text("Clicked T3")


def test_a_pad_is_closed_after_its_dry_run_and_opened_again(
    console: ConsolePage, system: Any
) -> None:
    publish(system, "pads")
    console.show("map", "station", "pads-s2")
    panel = console.panel("Station")
    panel.get_by_role("button", name="Close pad 0").click()
    console.confirm(MARKUP, after="No mission needs another plan")

    expect(panel).to_contain_text("Pad 0 of Pads S2 is closed")
    expect(panel).to_contain_text(MARKUP)
    panel.get_by_role("button", name="Open again").click()
    expect(panel).not_to_contain_text("is closed")


def test_a_closure_of_later_is_seen_on_the_map_ahead(console: ConsolePage, system: Any) -> None:
    publish(system, "later")
    now = datetime.fromisoformat(system.operate("GET", "/v1/clock")["now"])
    span = {"from_at": now + timedelta(hours=20), "until": now + timedelta(hours=30)}
    order = {"reason": "crane", **{name: each.isoformat() for name, each in span.items()}}
    system.operate("POST", "/v1/stations/later-s2/closures", order)
    page = console.page
    page.reload()
    shown_network(page, "later")
    pads = f"""() => {MAP}.data.stations?.features
      .find(({{properties}}) => properties.station_id === 'later-s2')?.properties.pads"""
    page.wait_for_function(f"() => ({pads})() === 'free'")
    page.get_by_label("Closures now").fill("25")
    page.wait_for_function(f"() => ({pads})() === 'closed'")

    console.show("alarms")
    item = page.get_by_role("list", name="Closed later").locator("li", has_text="crane")
    item.get_by_role("button", name="Open again").click()
    expect(item).to_have_count(0)


def test_a_closed_station_diverts_a_drone(console: ConsolePage, system: Any) -> None:
    fleet(system, "divert")
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
    item.get_by_role("button", name="Open again").click()
    expect(item).to_have_count(0)

    delivery_id = system.operate("GET", f"/v1/missions/{mission}")["mission"]["delivery_id"]
    happened = console.show("deliveries", delivery_id).page.get_by_label("What happened")
    expect(happened).to_contain_text(re.compile("p1 (as promised|.+ later than promised)"))


def test_an_area_is_drawn_and_closed(console: ConsolePage, system: Any) -> None:
    publish(system, "area")
    page = console.page
    page.reload()
    shown_network(page, "area")
    console.show("map", "zone")
    page.wait_for_function(f"() => {MAP}.map.areTilesLoaded()")
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
    item.get_by_role("button", name="Open again").click()
    expect(item).to_have_count(0)


def test_a_ground_stop_for_all_is_made_and_lifted(console: ConsolePage) -> None:
    console.show("alarms")
    page = console.page
    page.get_by_role("button", name="Stop all take-offs").click()
    console.confirm("storm", after="mission")

    item = page.locator("li", has_text="storm")
    expect(item).to_contain_text("Ground stop")
    item.get_by_role("button", name="Open again").click()
    expect(item).to_have_count(0)


def test_nothing_happens_when_an_operator_thinks_again(console: ConsolePage, system: Any) -> None:
    console.show("alarms")
    console.page.get_by_role("button", name="Stop all take-offs").click()
    console.page.get_by_role("button", name="Do nothing").click()

    expect(console.page.get_by_role("dialog")).to_have_count(0)
    expect(console.page.locator("main")).to_contain_text("Nothing is closed")


def test_a_mission_is_held_and_resumed(console: ConsolePage, system: Any) -> None:
    drone = fleet(system, "held")["drones"][0]["drone_id"]
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


def test_an_alarm_that_one_acknowledges_leaves_every_console(
    browser: Browser, console: ConsolePage, system: Any
) -> None:
    file = system.folder.path / "cold.toml"
    file.write_text(COLD)
    drone = fleet(system, "cold", options=("--scenario", str(file)))["drones"][0]["drone_id"]
    system.request_delivery(["cold-s2"], pickup="cold-s1")
    other = ConsolePage(browser, system).open_with(system.keys["SKYWAY_OPERATOR_KEY"])
    rows = [
        each.show("alarms").page.locator("tr[data-alarm]", has_text=drone[-6:]).first
        for each in (console, other)
    ]
    for row in rows:
        expect(row).to_contain_text("Battery cold")
    alarm = rows[0].get_attribute("data-alarm")
    rows[0].get_by_label("Note").fill(MARKUP)
    rows[0].get_by_role("button", name="Acknowledge").click()

    for each in (console, other):
        expect(each.page.locator(f"tr[data-alarm='{alarm}']")).to_have_count(0)
        expect(each.page.locator("main")).to_contain_text(f"by operator:operator: {MARKUP}")
    assert other.sound()


def test_a_delivery_is_found_and_followed_to_its_proof(console: ConsolePage, system: Any) -> None:
    fleet(system, "proof", name=MARKUP)
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
    page.get_by_label("Reference").fill(MARKUP)
    page.get_by_label("Reference").press("Enter")
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


def test_the_calendar_shows_missions_and_pads_and_moves_by_keys(
    console: ConsolePage, system: Any
) -> None:
    drone = fleet(system, "booked")["drones"][0]["drone_id"]
    in_the_air(system, "booked")
    page = console.show("schedule").page
    calendar = page.get_by_label("Calendar")
    row = calendar.locator(".row", has_text=drone[-6:])
    expect(row.locator("rect").first).to_be_attached()
    first_hour = calendar.locator("svg text").first.text_content()
    calendar.focus()
    calendar.press("ArrowRight")
    expect(calendar.locator("svg text").first).not_to_have_text(first_hour or "")

    page.get_by_role("button", name="Now").click()
    page.get_by_role("button", name="Pads").click()
    expect(calendar.locator(".row", has_text="Booked S").first).to_be_attached()


def test_the_console_goes_on_after_the_gateway_was_killed(
    console: ConsolePage, system: Any
) -> None:
    drone = fleet(system, "goes-on")["drones"][0]["drone_id"]
    status = console.page.locator(".connection")
    system.kill("skyway_gateway")
    expect(status).to_contain_text("No connection")
    expect(status).to_have_text("Live")
    in_the_air(system, "goes-on")

    console.show("map", "drone", drone)
    expect(console.panel("Drone")).to_contain_text("Flying")


def test_a_silent_service_is_named(console: ConsolePage, system: Any) -> None:
    status = console.page.locator(".connection")
    with system.silent("skyway_provider_registry"):
        expect(status).to_contain_text("No answer from registry")

    expect(status).to_have_text("Live")


def test_a_provider_sees_its_own_drones_and_no_command(browser: Browser, system: Any) -> None:
    own, other = (fleet(system, name)["provider_id"] for name in ("own", "foreign"))
    made = system.operate("POST", "/v1/keys", {"role": "provider", "subject_id": own})
    console = ConsolePage(browser, system).open_with(made["key"])
    page = console.page
    providers = f"() => [...{DRAWN}.values()].map(({{drone}}) => drone.provider_id)"
    page.wait_for_function(f"() => {DRAWN}.size > 0")

    assert page.evaluate(providers) == [own] != [other]
    expect(page.get_by_role("link", name="Deliveries")).to_have_count(0)
    console.show("map", "station", "own-s1")
    expect(console.panel("Station")).to_be_visible()
    expect(page.get_by_role("button", name="Close the station")).to_have_count(0)
    assert console.sound()


def test_every_view_is_accessible(console: ConsolePage, system: Any) -> None:
    """Axe finds nothing serious: names, contrast, roles, order."""
    drone = fleet(system, "axe")["drones"][0]["drone_id"]
    in_the_air(system, "axe")
    views = {
        "Plan of": ("map", "drone", drone),
        "Axe S1": ("map", "station", "axe-s1"),
        "Schedule": ("schedule",),
        "Deliveries": ("deliveries",),
        "Alarms": ("alarms",),
    }
    problems: list[str] = []
    for heading, parts in views.items():
        expect(console.show(*parts).page.get_by_role("heading", name=heading)).to_be_visible()
        problems += console.serious_problems()

    assert problems == []


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


def test_a_past_hour_is_played_again(console: ConsolePage, system: Any) -> None:
    drone = fleet(system, "played")["drones"][0]["drone_id"]
    place = "/v1/stations/played-t5/closures"
    closed = system.operate("POST", place, {"reason": "fog"})["closure_id"]
    delivery_id = system.request_delivery(["played-s2"], pickup="played-s1")
    system.until_state(delivery_id, "COMPLETED")
    system.operate("DELETE", f"{place}/{closed}")
    console.page.reload()
    shown_network(console.page, "played")
    page = console.show("replay").page
    expect(page.locator(".player")).to_contain_text("measured something")
    expect(page.get_by_label("What happened")).to_contain_text("Station Played T5 closed")
    page.get_by_label("Speed").select_option("600")
    page.get_by_role("button", name="Play", exact=True).click()
    longitude = f"{DRAWN}.get('{drone}')?.drone.position[0]"
    page.wait_for_function(f"() => {longitude} > -97.87")
    page.get_by_role("button", name="Pause").click()

    click_map(page, f"drones.tracks.get('{drone}').drone.position")
    page.wait_for_function(f"() => {MAP}.data.plan.features.length > 0")


def test_a_station_is_drawn_where_the_map_has_it(console: ConsolePage, system: Any) -> None:
    """The layer of the drones places points by itself, for speed: as the map does."""
    publish(system, "placed")
    console.page.reload()
    shown_network(console.page, "placed")
    console.page.wait_for_function(
        f"() => {MAP}.drones.stations[0]?.stationId.startsWith('placed')"
    )
    apart = console.page.evaluate(
        f"""async () => {{
          const {{mercator, screenOf}} = await import("/console/map/mercator.js");
          const {{map, drones}} = {MAP};
          const toScreen = screenOf(map);
          return Math.max(...drones.stations.map(({{position}}) => {{
            const [x, y] = toScreen(mercator(position));
            const right = map.project(position);
            return Math.hypot(x - right.x, y - right.y);
          }}));
        }}"""
    )

    assert apart < 0.5
