"""What the map draws: names without overlap, drones between readings, sheets on a phone."""

from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.end_to_end.browser import needs_browser
from tests.gateway.console.staged_page import LIVE, StagedPage

pytestmark = [pytest.mark.integration, needs_browser]

NAMES = ("Alamo Heights", "Balcones Heights", "Castle Hills", "Olmos Park", "Terrell Hills")


@pytest.fixture(scope="module")
def scripts(browser: Browser) -> Iterator[Page]:
    """A page that runs the map's modules without a map."""
    stage = StagedPage(browser, {})
    yield stage.open("/console#/alarms").page
    stage.close()


def station(number: int, name: str, *, pads: int = 2) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": [-98.5 + number / 100, 29.5]},
        "properties": {"kind": "station", "station_id": f"s{number}", "name": name, "pads": pads},
    }


@pytest.fixture
def corridor(stage: StagedPage) -> StagedPage:
    """A network of near stations; the one with the most pads comes last."""
    pads = (2, 2, 2, 2, 6)
    stations = [station(n, name, pads=pads[n]) for n, name in enumerate(NAMES)]
    network = {"type": "FeatureCollection", "features": stations}
    stage.answers |= {
        "/v1/networks": {"items": [{"network_id": "near"}], "next_cursor": None},
        "/v1/networks/near": network,
        "/v1/stations/s0/schedule": {"pads": []},
    }
    return stage


def test_what_asks_first_for_a_place_on_the_map_has_it(scripts: Page) -> None:
    found = scripts.evaluate(
        """async () => {
          const {LabelSpace, boxesAround} = await import("/console/map/label_space.js");
          const space = new LabelSpace();
          const taken = Array.from(
            {length: 30}, () => space.takeFirst(boxesAround([100, 100], 80, 14, 8)));
          const across = space.takeFirst([[60, 60, 900, 140]]);
          return {taken: taken.filter(Boolean), across: across ?? null};
        }"""
    )

    # Above and below: the sides would touch what stands above.
    assert found["taken"] == [[60, 78, 140, 92], [60, 108, 140, 122]]
    assert found["across"] is None


@pytest.mark.parametrize(
    ("pads", "live", "closed", "state"),
    [
        (2, {}, {}, "free"),
        (2, {"pads_taken": 1}, {}, "busy"),
        (2, {"pads_taken": 2}, {}, "full"),
        (2, {"pads_taken": 1, "queue": 2}, {}, "congested"),
        (2, {"pads_taken": 2}, {"kind": "STATION"}, "closed"),
        (0, {}, {}, "parking"),
        (0, {}, {"kind": "STATION"}, "closed"),
    ],
)
def test_a_station_is_drawn_by_what_a_drone_finds_there(
    scripts: Page, pads: int, live: Any, closed: Any, state: str
) -> None:
    closures = {"c": {**closed, "station_id": "s0"}} if closed else {}
    drawn = scripts.evaluate(
        """async ([network, live, closures]) => {
          const {stationPoints} = await import("/console/map/features.js");
          return stationPoints(network, live, closures).features[0].properties.pads;
        }""",
        [{"features": [station(0, "A", pads=pads)]}, {"s0": live}, closures],
    )

    assert drawn == state


def test_a_drone_flies_on_between_readings_and_not_beyond_its_landing(scripts: Page) -> None:
    scripts.emulate_media(reduced_motion="no-preference")
    found = scripts.evaluate(
        """async () => {
          const {Track, isOld} = await import("/console/map/drone_motion.js");
          const {mercator} = await import("/console/map/mercator.js");
          const drone = (longitude, second, activity = "FLYING") => ({
            position: [longitude, 0], activity, at: new Date(second * 1000).toISOString()});
          const degrees = (track, nowMs, wallMs) => 360 * track.placeAt(nowMs, wallMs)[0];
          const read = (track, reading, nowMs, more = {}) =>
            track.read(reading, {nowMs, wallMs: nowMs, isLive: true, ...more});
          const live = new Track(drone(0, 0), 0);
          read(live, drone(1, 10), 10_000);
          const steady = degrees(live, 12_000, 12_000);
          const atJump = degrees(live, 14_000, 14_000);
          read(live, drone(1.2, 14), 14_000);
          const afterJump = degrees(live, 14_000, 14_000);
          const longAfter = degrees(live, 1e9, 1e9);
          const landing = new Track(drone(0, 0), 0);
          read(landing, drone(1, 10), 10_000, {landing: mercator([1.1, 0])});
          const landed = degrees(landing, 30_000, 30_000);
          const past = new Track(drone(0, 0), 0);
          read(past, drone(1, 10), 10_000, {isLive: false});
          return {steady, jump: afterJump - atJump, longAfter, landed,
            past: degrees(past, 15_000, 15_000),
            old: [isOld(drone(0, 0), 19_000, 1), isOld(drone(0, 0), 21_000, 1),
              isOld(drone(0, 0), 21_000, 30), isOld(drone(0, 0, "IDLE"), 1e9, 1)],
            trail: live.trail.length};
        }"""
    )

    assert found["steady"] == pytest.approx(1.2)
    assert found["jump"] == pytest.approx(0, abs=1e-9)
    # At most three gaps of 4 s, at 0.05 degrees a second.
    assert found["longAfter"] == pytest.approx(1.2 + 12 * 0.05)
    assert found["landed"] == pytest.approx(1.1)
    assert found["past"] == pytest.approx(1)
    assert found["old"] == [False, True, False, False]
    assert found["trail"] == 3


def test_packages_aboard_are_those_picked_up_and_not_handed_over(scripts: Page) -> None:
    def step(kind: str, status: str, *packages: str) -> dict[str, Any]:
        return {"kind": kind, "status": status, "package_ids": list(packages)}

    host = [
        step("PICK_UP", "ENDED", "p1", "p2"),
        step("DELIVER", "ENDED", "p1"),
        step("DELIVER", "PLANNED", "p2"),
    ]
    guest = [step("PICK_UP", "ENDED", "q1"), step("DELIVER", "PLANNED", "q1")]
    missions = {
        "m1": {"steps": dict(enumerate(host))},
        "m2": {"steps": dict(enumerate(guest)), "flown_as": "m1"},
        "m3": {"steps": {"0": step("PICK_UP", "PLANNED", "r1")}},
    }
    counts = scripts.evaluate(
        """async (missions) => {
          const {packagesAboard} = await import("/console/map/packages_aboard.js");
          return Object.fromEntries(packagesAboard(missions));
        }""",
        missions,
    )

    assert counts == {"m1": 2, "m3": 0}


def test_drones_of_a_small_map_are_one_count(scripts: Page) -> None:
    clusters = scripts.evaluate(
        """async () => {
          const {clustersOf} = await import("/console/map/clusters.js");
          return clustersOf([{droneId: "a", point: [10, 10]}, {droneId: "b", point: [20, 30]},
            {droneId: "c", point: [500, 10]}]);
        }"""
    )

    assert clusters == [
        {"droneIds": ["a", "b"], "point": [15, 20]},
        {"droneIds": ["c"], "point": [500, 10]},
    ]


@pytest.mark.long
def test_the_ground_is_drawn_and_the_largest_station_keeps_its_name(corridor: StagedPage) -> None:
    page = corridor.open("/console#/map").page
    corridor.send(LIVE, "snapshot", {})
    page.wait_for_function(
        """() => document.querySelector(".map")?.fleetMap?.stations.places.length > 1000"""
    )
    kept = page.evaluate(
        """() => {
          const {map, stations} = document.querySelector(".map").fleetMap;
          const written = [];
          const context = stations.canvas.getContext("2d");
          context.fillText = (text, x, y) => written.push(text);
          map.jumpTo({center: [-98.48, 29.5], zoom: 9});
          return written;
        }"""
    )

    assert kept[0] == NAMES[-1]
    assert set(NAMES) - set(kept), "names that have no room are left out"
    expect(page.locator(".maplibregl-ctrl-attrib")).to_contain_text("OpenStreetMap")


@pytest.mark.long
def test_a_phone_has_the_legend_the_search_and_panels_as_sheets(corridor: StagedPage) -> None:
    corridor.page.set_viewport_size({"width": 360, "height": 780})
    page = corridor.open("/console#/map").page
    corridor.send(
        LIVE, "snapshot", {"drones": {"drn_1": {"name": "Heron", "position": [-98.5, 29.5]}}}
    )
    close_area = page.get_by_role("link", name="Close an area")
    search = page.get_by_role("searchbox", name="Find a drone or a station")
    expect(close_area).to_be_hidden()
    expect(search).to_be_hidden()

    page.get_by_role("button", name="Legend").click()
    close_area.click()
    expect(page.get_by_role("heading", name="Close an area")).to_be_visible()
    page.get_by_role("button", name="Close the panel").click()
    page.get_by_role("button", name="Search").click()
    expect(search).to_be_focused()
    search.press_sequentially("heron")
    search.press("Enter")

    sheet = page.get_by_role("region", name="Drone Heron")
    expect(sheet).to_contain_text("Stands.")
    expect(search).to_be_hidden()
    box = sheet.bounding_box()
    assert box is not None
    assert (box["x"], box["width"]) == (0, 360)
    bar = page.locator("nav.bottom").bounding_box()
    assert bar is not None
    assert box["y"] + box["height"] == pytest.approx(bar["y"], abs=1)
    assert page.evaluate("document.documentElement.scrollWidth") == 360
