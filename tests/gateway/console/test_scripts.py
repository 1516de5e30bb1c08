"""What the console's scripts do in a browser with what the gateway sends."""

from typing import Any

import pytest
from playwright.sync_api import expect

from tests.end_to_end.browser import needs_browser
from tests.gateway.console.staged_page import LIVE, StagedPage, delivery

pytestmark = [pytest.mark.integration, needs_browser]


def package(package_id: str, delivered_at: str | None = None) -> dict[str, Any]:
    return {
        "package_id": package_id,
        "state": "DELIVERED" if delivered_at else "IN_TRANSIT",
        "delivered_at": delivered_at,
        "destination": {"station_id": "b"},
    }


def proof(package_id: str, at: str | None = None, mass_kg: float | None = None) -> dict[str, Any]:
    return {
        "package_id": package_id,
        "station_id": at and "b",
        "at": at,
        "mass_kg": mass_kg,
    }


def test_the_proof_grows_with_each_hand_over(stage: StagedPage) -> None:
    first, second = "2026-03-01T12:01:00Z", "2026-03-01T12:05:00Z"
    path = "/v1/deliveries/dlv_1"
    stage.answers |= {
        path: delivery("dlv_1", packages=[package("p1", first), package("p2")]),
        f"{path}/proof": {"packages": [proof("p1", first, 0.45), proof("p2")]},
    }
    listed = stage.open("/console#/deliveries/dlv_1").page.get_by_role("list", name="Proof")
    expect(listed.get_by_role("listitem")).to_have_count(1)
    expect(listed).to_contain_text("p1 handed over at B, 0.45 kg")

    stage.answers |= {
        path: delivery("dlv_1", packages=[package("p1", first), package("p2", second)]),
        f"{path}/proof": {"packages": [proof("p1", first), proof("p2", second)]},
    }
    stage.send(LIVE, "snapshot", {"deliveries": {"dlv_1": {"packages": {}}}})
    expect(listed.get_by_role("listitem")).to_have_count(2)


@pytest.mark.parametrize(
    ("taken", "closed", "shown"),
    [(1, [0], "busy"), (2, [0], "full"), (2, [0, 1], "closed"), (0, [], "free"), (2, [], "full")],
)
def test_a_closed_pad_counts_once(
    stage: StagedPage, taken: int, closed: list[int], shown: str
) -> None:
    network = {
        "features": [
            {
                "geometry": {"coordinates": [0, 0]},
                "properties": {"kind": "station", "station_id": "a", "pads": 2},
            }
        ]
    }
    closures = {f"c{pad}": {"kind": "PAD", "station_id": "a", "pad": pad} for pad in closed}

    points = stage.open("/track/none").page.evaluate(
        """async ([network, live, closures]) => {
          const {stationPoints} = await import("/console/map/features.js");
          return stationPoints(network, live, closures);
        }""",
        [network, {"a": {"pads_taken": taken}}, closures],
    )

    assert [each["properties"]["pads"] for each in points["features"]] == [shown]


@pytest.mark.long
def test_a_stream_that_goes_on_is_shown_as_live(stage: StagedPage) -> None:
    status = stage.open("/console#/alarms").page.locator(".connection")
    stage.send(LIVE, "snapshot", {})
    expect(status).to_have_text("Live")
    stage.fail(LIVE, is_refused=False)
    expect(status).to_contain_text("No connection")

    stage.reconnect(LIVE)
    expect(status).to_have_text("Live")


@pytest.mark.long
def test_a_page_that_slept_follows_the_picture_anew(stage: StagedPage) -> None:
    stage.install_clock()
    stage.open("/console#/alarms")
    stage.send(LIVE, "snapshot", {})
    stage.sleep(2)
    assert stage.streams(LIVE) == 1

    stage.sleep(60)
    stage.page.wait_for_function("() => streams.length === 2")


@pytest.mark.long
def test_a_drone_on_a_mission_is_shown_before_a_network_is_known(stage: StagedPage) -> None:
    mission = {"delivery_id": "dlv_1", "drone_id": "drn_1", "state": "ACTIVE", "steps": {}}
    drone = {"position": [0, 0], "state": "ON_MISSION", "mission_id": "msn_1"}
    panel = stage.open("/console#/map/drone/drn_1").page.get_by_role("region", name="Drone")

    stage.send(LIVE, "snapshot", {"drones": {"drn_1": drone}, "missions": {"msn_1": mission}})

    expect(panel.get_by_role("group", name="Commands to the mission")).to_be_visible()


def test_a_drone_shows_all_deliveries_of_a_shared_trip(stage: StagedPage) -> None:
    def mission(delivery_id: str, place: str, **members: Any) -> dict[str, Any]:
        times = {"start_at": "2026-03-01T12:04:00Z", "end_at": "2026-03-01T12:05:00Z"}
        step = {"kind": "DELIVER", "status": "PLANNED", "station_id": place, **times}
        shown = {"delivery_id": delivery_id, "drone_id": "drn_1", "state": "ACTIVE"}
        return shown | {"packages": {}, "steps": {"1": step}} | members

    picture = {
        "drones": {"drn_1": {"position": [0, 0], "state": "ON_MISSION", "mission_id": "msn_1"}},
        "missions": {
            "msn_1": mission("dlv_1", "hill"),
            "msn_2": mission("dlv_2", "vale", flown_as="msn_1"),
            "msn_3": mission("dlv_3", "moor"),
        },
    }
    panel = stage.open("/console#/map/drone/drn_1").page.get_by_role("region", name="Drone")
    stage.send(LIVE, "snapshot", picture)

    expect(panel).to_contain_text("A shared trip with packages of 2 deliveries.")
    expect(panel).to_contain_text("Deliver at Hill")
    expect(panel).to_contain_text("Deliver at Vale")
    expect(panel).not_to_contain_text("Moor")

    known = [{"mission_id": "msn_2", "drone_id": "drn_1", "is_pooled": False}]
    stage.answers["/v1/deliveries/dlv_2"] = delivery("dlv_2", missions=known)
    stage.page.evaluate("location.hash = '#/deliveries/dlv_2'")
    expect(stage.page.get_by_text("It is a guest of mission msn_1.")).to_be_visible()


@pytest.mark.parametrize(
    ("state", "is_pooled", "shown"),
    [
        ("PLANNED", False, "possible until the drone is loaded"),
        ("IN_PROGRESS", True, "yes, at the lower price"),
        ("COMPLETED", False, "no"),
    ],
)
def test_a_delivery_says_whether_its_trip_is_shared(
    stage: StagedPage, state: str, is_pooled: bool, shown: str
) -> None:
    mission = {"mission_id": "msn_1", "drone_id": None, "is_pooled": is_pooled}
    request = {"pickup": {"station_id": "a"}, "qos": {"pooling": True}}
    stage.answers["/v1/deliveries/dlv_1"] = delivery(
        "dlv_1", state=state, request=request, missions=[mission]
    )

    page = stage.open("/console#/deliveries/dlv_1").page

    expect(page.locator("dt:text-is('Shared trip') + dd")).to_have_text(shown)


@pytest.mark.parametrize(
    ("pickup", "shown"), [("a", "A"), ("b", "B: the packages are handed over there, not at A")]
)
def test_a_delivery_says_where_its_packages_are_handed_over(
    stage: StagedPage, pickup: str, shown: str
) -> None:
    asked = {"pickup": {"station_id": "a"}, "qos": {}}
    stage.answers["/v1/deliveries/dlv_1"] = delivery(
        "dlv_1", request=asked, pickup={"station_id": pickup}
    )

    page = stage.open("/console#/deliveries/dlv_1").page

    expect(page.locator("dt:text-is('Pickup') + dd")).to_have_text(shown)


def test_events_of_a_delivery_go_on_after_a_refusal_without_repetition(stage: StagedPage) -> None:
    stage.answers["/v1/deliveries/dlv_1"] = delivery("dlv_1")
    events = "/v1/deliveries/dlv_1/events"
    stage.install_clock()
    page = stage.open("/console#/deliveries/dlv_1").page
    event = {"type": "delivery.planned", "occurred_at": "2026-03-01T12:00:00Z", "data": {}}
    stage.send(events, "delivery.planned", {**event, "event_id": "evt_1"})
    stage.fail(events, is_refused=True)
    page.clock.fast_forward(3_000)
    assert stage.streams(events) == 2
    stage.send(events, "delivery.planned", {**event, "event_id": "evt_1"})
    stage.send(events, "delivery.delayed", {**event, "event_id": "evt_2"})

    expect(page.get_by_label("What happened").get_by_role("listitem")).to_have_count(2)


def test_more_deliveries_stay_when_one_comes_and_one_goes(stage: StagedPage) -> None:
    ids = [f"dlv_{number:03}" for number in range(120)]

    def listed(query: str) -> Any:
        asked = dict(pair.split("=") for pair in query.split("&") if pair)
        start = int(asked.get("cursor", 0))
        end = start + int(asked["limit"])
        items = [delivery(each) for each in ids[start:end]]
        return {"items": items, "next_cursor": str(end) if end < len(ids) else None}

    stage.answers["/v1/deliveries"] = listed
    page = stage.open("/console#/deliveries").page
    rows = page.get_by_role("table", name="Deliveries").locator("tbody tr")
    stage.send(LIVE, "snapshot", {"deliveries": {"dlv_000": {"packages": {}}}})
    expect(rows).to_have_count(50)
    page.get_by_role("button", name="Show more").click()
    expect(rows).to_have_count(100)

    ids.insert(0, "dlv_new")
    change: Any = {"deliveries": {"dlv_000": None, "dlv_new": {"packages": {}}}}
    stage.send(LIVE, "change", change)
    expect(rows.first).to_contain_text("dlv_new")
    expect(rows).to_have_count(100)


def test_deliveries_are_found_by_a_part_of_their_texts(stage: StagedPage) -> None:
    items = [delivery("dlv_1", reference="order 1042"), delivery("dlv_2", customer_id="hill")]
    stage.answers["/v1/deliveries"] = {"items": items, "next_cursor": None}
    page = stage.open("/console#/deliveries").page
    rows = page.get_by_role("table", name="Deliveries").locator("tbody tr")
    expect(rows).to_have_count(2)

    for text, found in (("104", "dlv_1"), ("HIL", "dlv_2"), ("nobody", "No delivery.")):
        page.get_by_label("Find below").fill(text)
        expect(rows).to_have_count(1)
        expect(rows).to_contain_text(found)


@pytest.mark.long
def test_a_drag_that_rests_counts_once(stage: StagedPage) -> None:
    """One pixel of the chart is the same time before and after a pause."""
    stage.answers["/v1/providers"] = {"items": [{"provider_id": "prv_1"}], "next_cursor": None}
    free = {"drone_id": "drn_1", "entries": []}
    stage.answers["/v1/providers/prv_1/schedule"] = {"items": [free], "next_cursor": None}
    page = stage.open("/console#/schedule").page
    page.wait_for_function(
        """() => {
          const drawn = document.querySelector(".gantt svg");
          return drawn && drawn.viewBox.baseVal.width === drawn.clientWidth;
        }"""
    )
    now = "() => Number(document.querySelector('.gantt .now').getAttribute('x1'))"
    before = page.evaluate(now)
    box = page.locator(".gantt svg").bounding_box()
    assert box is not None
    x, y = box["x"] + 600, box["y"] + 10
    page.mouse.move(x, y)
    page.mouse.down()
    with page.expect_request(lambda request: "/schedule?" in request.url):
        page.mouse.move(x - 100, y)
    page.mouse.move(x - 150, y)
    page.mouse.up()

    assert page.evaluate(now) == pytest.approx(before - 150, abs=3)


def test_money_is_written_with_the_digits_of_its_currency(stage: StagedPage) -> None:
    texts = stage.open("/console#/alarms").page.evaluate(
        """async () => {
          const {money} = await import("/console/words.js");
          return [["JPY", 500], ["USD", 1234], ["KWD", 1500]]
            .map(([currency, amount]) => money({amount, currency}).replace(/[^0-9.,]/g, ""));
        }"""
    )

    assert texts == ["500", "12.34", "1.500"]


def test_a_margin_that_follows_from_a_risk_is_a_line_of_text(stage: StagedPage) -> None:
    texts = stage.open("/console#/alarms").page.evaluate(
        """async () => {
          const {marginText} = await import("/console/words.js");
          const risk = {reserve_risk: 0.001, flight_margin: 0.2784, from: "a", to: "b-c"};
          return [undefined, {}, {risk}, {risk: {...risk, from: null, limited_by: "MOST"}}]
            .map(marginText);
        }"""
    )

    share = "0.1 % of landings"
    assert texts == [
        "",
        "",
        f"28 % more energy on the flight from A to B C: at most {share} are below the reserve",
        f"28 % more energy: the largest margin, but more than {share} may be below the reserve",
    ]


def test_a_broken_address_opens_a_view(stage: StagedPage) -> None:
    stage.answers["/v1/deliveries"] = {"items": [], "next_cursor": None}

    page = stage.open("/console#/deliveries/%E0%A4%A").page

    expect(page.get_by_role("navigation", name="Views")).to_be_visible()


@pytest.mark.long
def test_a_map_that_is_gone_ignores_the_theme(stage: StagedPage) -> None:
    page = stage.open("/console#/map").page
    page.locator(".maplibregl-canvas").wait_for()
    page.evaluate(
        """() => {
          const {map} = document.querySelector(".map").fleetMap;
          map.setStyle = (style) => { if (style) window.styled = true; };
          matchMedia("(prefers-color-scheme: dark)")
            .addEventListener("change", () => { window.isDark = true; });
        }"""
    )
    page.evaluate("location.hash = '#/alarms'")
    expect(page.get_by_role("heading", name="Alarms")).to_be_visible()
    page.emulate_media(color_scheme="dark")
    page.wait_for_function("window.isDark")

    assert page.evaluate("window.styled") is None


@pytest.mark.long
def test_what_lies_across_longitude_180_is_drawn_the_short_way(stage: StagedPage) -> None:
    script = """async () => {
      const {collectionNear, drawAround} = await import("/console/map/longitudes.js");
      const {closureShapes, planLines} = await import("/console/map/features.js");
      const {mercator} = await import("/console/map/mercator.js");
      drawAround(179.96);
      const rings = [[[179, 0], [-179, 0], [-179, 2], [179, 0]]];
      const mission = {steps: {1: {kind: "FLY", from_position: [179.9, 0], position: [-179.9, 1]}}};
      const drawn = (features) => collectionNear(features).features[0].geometry.coordinates;
      return {
        zone: drawn(closureShapes({features: []}, {z: {kind: "ZONE", rings}}))[0],
        plan: drawn(planLines(mission, undefined)),
        drones: [mercator([179.9, 0])[0], mercator([-179.9, 0])[0]],
      };
    }"""

    found = stage.open("/console#/alarms").page.evaluate(script)

    assert found["zone"] == [[179, 0], [181, 0], [181, 2], [179, 0]]
    assert found["plan"] == [pytest.approx(end) for end in ([179.9, 0], [180.1, 1])]
    assert found["drones"] == pytest.approx([179.9 / 360, 180.1 / 360])


@pytest.mark.long
def test_a_past_flight_crosses_longitude_180_the_short_way(stage: StagedPage) -> None:
    script = """async () => {
      const {dronesAt} = await import("/console/parts/flight_record.js");
      const sample = (atMs, position) => ({atMs, position, soc: 1});
      const samples = [sample(0, [179.9, 0]), sample(10, [-179.9, 0])];
      return dronesAt(new Map([["drn_1", samples]]), 5).drn_1;
    }"""

    drone = stage.open("/console#/alarms").page.evaluate(script)

    assert drone["position"] == pytest.approx([180.0, 0])
    assert drone["heading_deg"] == pytest.approx(90.0)


@pytest.mark.long
@pytest.mark.parametrize("centre", [179.0, 181.0, -179.0])
def test_drones_stay_on_a_map_that_moves_across_longitude_180(
    stage: StagedPage, centre: float
) -> None:
    # The world is 512 pixels wide, and the map 300.
    script = """async (centre) => {
      const {mercator, screenOf} = await import("/console/map/mercator.js");
      const map = {
        getContainer: () => ({clientWidth: 300}),
        getZoom: () => 0,
        project: () => ({x: 150 - (512 * centre) / 360, y: 0}),
      };
      return [179.9, -179.9].map((longitude) => screenOf(map)(mercator([longitude, 0]))[0]);
    }"""

    found = stage.open("/console#/alarms").page.evaluate(script, centre)

    middle = 180.0 if centre > 0 else -180.0
    assert found == pytest.approx(
        [150 + 512 / 360 * (middle + aside - centre) for aside in (-0.1, 0.1)]
    )
