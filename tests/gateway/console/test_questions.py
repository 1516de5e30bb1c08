"""How people find things, and what the console asks and says before and after they act."""

from typing import Any

import pytest
from playwright.sync_api import expect

from tests.end_to_end.browser import needs_browser
from tests.gateway.console.staged_page import LIVE, StagedPage, delivery

pytestmark = [pytest.mark.integration, needs_browser, pytest.mark.long]


def test_a_closed_area_is_opened_only_after_a_question(stage: StagedPage) -> None:
    page = stage.open("/console#/alarms").page
    zone = {"kind": "ZONE", "from_at": "2026-03-01T11:00:00Z"}
    stage.send(LIVE, "snapshot", {"closures": {"cls_1": zone}})
    page.get_by_role("button", name="Open again").click()
    question = page.get_by_role("dialog")
    expect(question).to_contain_text("New plans may use it again")
    assert not any(each.startswith("DELETE") for each in stage.asked)

    stage.answers["/v1/zones/cls_1"] = {}
    question.get_by_role("button", name="Open it").click()
    expect(question).to_have_count(0)
    assert "DELETE /v1/zones/cls_1?" in stage.asked


def test_a_delivery_is_cancelled_only_after_a_question(stage: StagedPage) -> None:
    path = "/v1/deliveries/dlv_1"
    stage.answers |= {path: delivery("dlv_1"), f"{path}/cancel": {}}
    page = stage.open("/console#/deliveries/dlv_1").page
    page.get_by_role("button", name="Cancel the delivery").click()
    question = page.get_by_role("dialog")
    expect(question).to_contain_text("Packages on board are brought back")
    assert not any(each.startswith("POST") for each in stage.asked)

    question.get_by_role("button", name="Cancel the delivery").click()
    expect(question).to_have_count(0)
    assert f"POST {path}/cancel?" in stage.asked


#: Two stations with a segment from the first to the second.
TWO_STATIONS = {
    "features": [
        *(
            {
                "geometry": {"type": "Point", "coordinates": [place, 0]},
                "properties": {"kind": "station", "station_id": name, "pads": 2},
            }
            for name, place in (("a", 0), ("b", 1))
        ),
        {
            "geometry": {"type": "LineString", "coordinates": [[0, 0], [1, 0]]},
            "properties": {"kind": "segment", "from": "a", "to": "b"},
        },
    ]
}


@pytest.fixture
def two_stations(stage: StagedPage) -> StagedPage:
    """A console with a network of two stations."""
    networks = {"items": [{"network_id": "n"}], "next_cursor": None}
    stage.answers |= {"/v1/networks": networks, "/v1/networks/n": TWO_STATIONS}
    return stage


def test_a_customer_asks_for_a_shared_trip(two_stations: StagedPage) -> None:
    two_stations.answers["/v1/sessions/current"] = {"subject_id": "books", "role": "customer"}
    page = two_stations.open("/console#/new").page
    page.get_by_role("combobox", name="Pickup").select_option("a")
    page.get_by_role("combobox", name="To", exact=True).select_option("b")
    page.get_by_text("More wishes").click()
    page.get_by_label("Share the trip").check()
    page.get_by_label("Wait for others, minutes").fill("15")
    page.get_by_label("Farthest other station where I can hand over, metres").fill("900")
    with page.expect_request(lambda request: request.url.endswith("/v1/quotes")) as asked:
        page.get_by_role("button", name="Ask for offers").click()

    wishes = {"pooling": True, "pooling_wait_s": 900, "pickup_within_m": 900}
    qos = {
        "objective": "FASTEST",
        "firm_within_s": 0,
        "may_be_later_s": 0,
        "may_change_provider": False,
        **wishes,
    }
    body: Any = asked.value.post_data_json
    assert body["qos"] == qos
    # Only a delivery without an offer can join the trip of another one.
    two_stations.answers["/v1/deliveries"] = {"delivery_id": "dlv_1"}
    path = "/v1/deliveries"
    with page.expect_request(lambda request: request.url.endswith(path)) as requested:
        page.get_by_role("button", name="Request it without an offer").click()
    sent: Any = requested.value.post_data_json
    assert (sent["qos"], "hold" in sent) == (qos, False)


def test_a_customer_says_what_the_dispatcher_may_do(two_stations: StagedPage) -> None:
    two_stations.answers["/v1/sessions/current"] = {"subject_id": "books", "role": "customer"}
    page = two_stations.open("/console#/new").page
    page.get_by_role("combobox", name="Pickup").select_option("a")
    page.get_by_role("combobox", name="To", exact=True).select_option("b")
    page.get_by_text("More wishes").click()
    page.get_by_label("Promise an arrival time within, minutes").fill("10")
    page.get_by_label("It may come later than promised by, minutes").fill("7.5")
    page.get_by_label("Another provider may fly it, for the same price").check()

    with page.expect_request(lambda request: request.url.endswith("/v1/quotes")) as asked:
        page.get_by_role("button", name="Ask for offers").click()

    body: Any = asked.value.post_data_json
    assert body["qos"] == {
        "objective": "FASTEST",
        "firm_within_s": 600,
        "may_be_later_s": 450,
        "may_change_provider": True,
    }


def test_a_segment_is_closed_for_some_hours(two_stations: StagedPage) -> None:
    path = "/v1/segments/a/b/closures"
    two_stations.answers[path] = {"affected_missions": []}
    page = two_stations.open("/console#/map/station/a").page
    page.get_by_text("Segments from here").click()
    page.get_by_role("button", name="Close the segment to B").click()
    question = page.get_by_role("dialog")
    expect(question).to_contain_text("No mission needs another plan")
    with page.expect_request(lambda request: "dry_run" in request.url):
        question.get_by_label("From, fleet time").fill("2026-03-01T14:00")
    with page.expect_request(lambda request: "dry_run" in request.url) as looked:
        question.get_by_label("Until, fleet time").fill("2026-03-01T16:30")
    chosen = {"from_at": "2026-03-01T14:00:00.000Z", "until": "2026-03-01T16:30:00.000Z"}
    assert looked.value.post_data_json == {**chosen, "reason": "dry run"}

    question.get_by_label("Reason").fill("crane")
    with page.expect_request(lambda request: request.url.endswith(path)) as closed:
        question.get_by_role("button", name="Close it").click()
    assert closed.value.post_data_json == {**chosen, "reason": "crane"}


def test_drones_and_stations_are_opened_by_keyboard(two_stations: StagedPage) -> None:
    page = two_stations.open("/console#/map").page
    drone = {"name": "Heron 7", "position": [0, 0], "state": "AVAILABLE"}
    two_stations.send(LIVE, "snapshot", {"drones": {"drn_1": drone}})
    search = page.get_by_role("searchbox", name="Find a drone or a station")
    search.press_sequentially("heron")
    search.press("Enter")
    expect(page.get_by_role("heading", name="Drone Heron 7")).to_be_visible()

    search.fill("b")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    expect(page.get_by_role("region", name="Station").get_by_role("heading")).to_have_text("B")


def test_the_corners_of_an_area_are_chosen_by_keyboard(two_stations: StagedPage) -> None:
    page = two_stations.open("/console#/map/zone").page
    corner = page.get_by_role("button", name="Corner at the middle")
    page.wait_for_function("() => document.querySelector('.map')?.fleetMap?.map")
    centre = "() => document.querySelector('.map').fleetMap.map.getCenter().toArray()"
    for key in ("ArrowLeft", "ArrowUp", "ArrowRight"):
        before = page.evaluate(centre)
        page.locator(".maplibregl-canvas").press(key)
        page.wait_for_function(f"before => String(({centre})()) !== String(before)", arg=before)
        corner.press("Enter")

    expect(page.get_by_role("region", name="Close an area")).to_contain_text("3 corners")
    expect(page.get_by_role("button", name="Close to flights")).to_be_enabled()


def test_a_click_at_the_moment_when_the_panel_appears_is_a_corner(two_stations: StagedPage) -> None:
    page = two_stations.open("/console#/map").page
    page.wait_for_function("() => document.querySelector('.map')?.fleetMap?.map")

    page.evaluate(
        """() => {
          const {map} = document.querySelector(".map").fleetMap;
          new MutationObserver((_, observer) => {
            if (!document.querySelector("[aria-label='Close an area']")) return;
            observer.disconnect();
            map.fire("click", {point: {x: 9, y: 9}, lngLat: map.unproject([9, 9])});
          }).observe(document.body, {childList: true, subtree: true});
          location.hash = "#/map/zone";
        }"""
    )

    expect(page.get_by_role("region", name="Close an area")).to_contain_text("1 corner.")


def test_an_empty_system_says_what_comes_next(stage: StagedPage) -> None:
    """First a network, then drones, then customers; a hint that is closed stays away."""
    stage.answers |= {"/v1/system": {"small_world": "AVAILABLE", "services": []}}
    stage.answers["/v1/deliveries"] = {"items": [], "next_cursor": None}
    page = stage.open("/console#/map").page
    hint = page.get_by_role("region", name="First steps")
    stage.send(LIVE, "snapshot", {})
    expect(hint).to_contain_text("There is no network yet")
    expect(hint.get_by_role("button", name="Start a small world")).to_be_visible()

    networks = {"items": [{"network_id": "n"}], "next_cursor": None}
    stage.answers |= {"/v1/networks": networks, "/v1/networks/n": {"features": []}}
    page.reload()
    stage.send(LIVE, "snapshot", {})
    expect(hint).to_contain_text("There is no drone yet")

    drone = {"state": "AVAILABLE", "position": [0, 0]}
    stage.send(LIVE, "change", {"drones": {"drn_1": drone}})
    expect(hint).to_contain_text("Nobody has requested a delivery yet")
    hint.get_by_role("button", name="Close the panel").click()
    expect(hint).to_have_count(0)


def test_requests_that_wait_for_a_drone_are_in_the_schedule(stage: StagedPage) -> None:
    stage.answers["/v1/providers"] = {"items": [], "next_cursor": None}
    page = stage.open("/console#/schedule").page
    waiting = {
        "is_waiting": True,
        "created_at": "2026-03-01T11:50:00Z",
        "pickup": {"station_id": "a"},
        "packages": {"p1": {"destination": {"station_id": "b"}}},
    }
    deliveries = {"dlv_1": waiting, "dlv_2": {**waiting, "is_waiting": False}}
    stage.send(LIVE, "snapshot", {"deliveries": deliveries})

    items = page.get_by_role("list", name="Waits for a drone").get_by_role("listitem")
    expect(items).to_have_count(1)
    expect(items).to_contain_text("since 11:50")
    expect(items).to_contain_text("from A to B")


def test_a_station_is_drawn_where_the_map_has_it(two_stations: StagedPage) -> None:
    """The layer of the stations places points by itself, for speed: as the map does."""
    page = two_stations.open("/console#/map").page
    page.wait_for_function(
        "() => document.querySelector('.map')?.fleetMap?.stations.stations.length === 2"
    )
    apart = page.evaluate(
        """async () => {
          const {mercator, screenOf} = await import("/console/map/mercator.js");
          const {map, stations} = document.querySelector(".map").fleetMap;
          const toScreen = screenOf(map);
          return Math.max(...stations.stations.map(({position}) => {
            const [x, y] = toScreen(mercator(position));
            const right = map.project(position);
            return Math.hypot(x - right.x, y - right.y);
          }));
        }"""
    )

    assert apart < 0.5
