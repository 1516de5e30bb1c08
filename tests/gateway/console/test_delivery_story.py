"""The page of a delivery says what was planned, what happened, and why plans have changed."""

from typing import Any, Final

import pytest
from playwright.sync_api import expect

from tests.end_to_end.browser import needs_browser, serious_problems
from tests.gateway.console.staged_page import StagedPage, delivery

pytestmark = [pytest.mark.integration, needs_browser]

PATH: Final = "/v1/deliveries/dlv_1"
EVENTS: Final = f"{PATH}/events"


def moment(minute: int) -> str:
    return f"2026-03-01T12:{minute:02}:00Z"


def step(number: int, kind: str, place: str, planned: int, **members: Any) -> dict[str, Any]:
    """A step of a mission whose plan ends it at this minute; `real` is when it ended."""
    real = members.pop("real", None)
    at = {"to": place} if kind == "FLY" else {"station_id": place, "package_ids": ["p1"]}
    return {
        "step": {"step_id": number, "kind": kind, "planned_end_at": moment(planned), **at},
        "revision": members.pop("revision", 1),
        "status": "PLANNED" if real is None else "ENDED",
        "event": None if real is None else {"ended_at": moment(real), "soc": 0.42},
    }


MISSION: Final = {
    "mission_id": "msn_1",
    "drone_id": "drn_1",
    "start_at": "2026-03-01T11:50:00Z",
    "is_pooled": False,
}
PACKAGE: Final = {
    "package_id": "p1",
    "state": "IN_TRANSIT",
    "destination": {"station_id": "far-hill"},
    "due_at": moment(10),
    "eta_at": moment(16),
    "recipient": {"name": "Ada"},
}


@pytest.fixture
def story(stage: StagedPage) -> StagedPage:
    """A delivery whose second step was late, and which got a new plan then."""
    stage.answers |= {
        PATH: delivery(
            "dlv_1",
            packages=[PACKAGE],
            missions=[MISSION],
            reference="order 7",
            price={
                "amount": 900,
                "currency": "USD",
                "line_items": [{"kind": "BASE", "amount": 900}],
            },
        ),
        f"{PATH}/track": {"type": "FeatureCollection", "features": []},
        "/v1/audit": {"items": [], "next_cursor": None},
        "/v1/statements/lines": {
            "items": [{"kind": "BASE", "amount": 700, "currency": "USD", "at": moment(1)}],
            "next_cursor": None,
        },
        "/v1/missions/msn_1": {
            "steps": [
                step(1, "PICK_UP", "a", 1, real=1),
                step(2, "FLY", "moor", 3, real=6),
                step(3, "FLY", "far-hill", 15, revision=2),
                step(4, "DELIVER", "far-hill", 16, revision=2),
            ]
        },
    }
    return stage


def stop(station_id: str, longitude_deg: float) -> dict[str, Any]:
    """A stop on the way of a delivery where a package is handed over."""
    stops = [{"kind": "DELIVER", "status": "PLANNED"}]
    return {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": [longitude_deg, 29.9]},
        "properties": {
            "kind": "STATION",
            "station_id": station_id,
            "is_pickup": False,
            "stops": stops,
        },
    }


def replan(story: StagedPage, later_s: float, revision: int = 2) -> None:
    data = {
        "mission_id": "msn_1",
        "revision": revision,
        "code": "STATION_CLOSED",
        "detail": "Moor is closed",
        "given_up": None,
        "packages": [{"package_id": "p1", "later_s": later_s}],
    }
    event = {"event_id": f"evt_{revision}", "type": "delivery.replanned", "data": data}
    story.send(EVENTS, "delivery.replanned", {**event, "occurred_at": moment(6)})


def test_the_timeline_is_planned_against_real_with_the_reasons(story: StagedPage) -> None:
    page = story.open("/console#/deliveries/dlv_1").page
    replan(story, 360)
    rows = page.get_by_role("list", name="Planned and real").get_by_role("listitem")

    expect(rows).to_have_count(5)
    expect(rows.nth(0)).to_contain_text("12:01, on time")
    expect(rows.nth(1)).to_contain_text("lands 12:03")
    expect(rows.nth(1)).to_contain_text("12:06, 3 min late")
    expect(rows.nth(2)).to_have_text("New plan at 12:06: Moor is closed. p1 6 min later.")
    expect(rows.nth(3)).to_contain_text("Fly to Far Hill")
    expect(page.locator(".headline")).to_contain_text("6 min later than promised")
    expect(page.get_by_role("table", name="Packages")).to_contain_text("for Ada")
    expect(page.get_by_role("table", name="Charged")).to_contain_text("7.00")
    assert serious_problems(page) == []
    replay = page.get_by_role("link", name="Replay this flight").get_attribute("href")
    assert replay == "#/replay/2026-03-01T11%3A45%3A00.000Z/drn_1"


def test_a_new_plan_is_compared_with_the_plan_before_it(story: StagedPage) -> None:
    page = story.open("/console#/deliveries/dlv_1").page
    replan(story, 360)
    replan(story, 240, revision=3)

    last = page.get_by_role("list", name="Planned and real").get_by_role("listitem").last
    expect(last).to_contain_text("p1 2 min earlier.")


def test_a_customer_sees_the_plan_without_what_the_drone_reported(story: StagedPage) -> None:
    story.answers["/v1/sessions/current"] = {"subject_id": "books", "role": "customer"}
    steps = [
        {"kind": "FLY", "from": "a", "to": "far-hill", "start_s": 0, "end_s": 300},
        {"kind": "DELIVER", "station_id": "far-hill", "package_ids": ["p1"], "end_s": 330},
    ]
    plan = {"steps": steps, "delivery_time_s": 330}
    shown: Any = story.answers[PATH]
    story.answers[PATH] = shown | {"missions": [MISSION | {"plan": plan, "revision": 1}]}
    page = story.open("/console#/deliveries/dlv_1").page
    rows = page.get_by_role("list", name="Planned and real").get_by_role("listitem")
    expect(rows).to_have_count(2)
    expect(rows.last).to_contain_text("handed over by 11:55")

    data = {"mission_id": "msn_1", "package_id": "p1"}
    handed_over = {"event_id": "evt_1", "type": "package.delivered", "data": data}
    story.send(EVENTS, "package.delivered", handed_over | {"occurred_at": moment(0)})
    expect(rows.last).to_contain_text("12:00, 5 min late")
    assert not any("/v1/missions" in each for each in story.asked)


@pytest.mark.long
def test_the_sections_of_a_delivery_fold_on_a_phone(story: StagedPage) -> None:
    story.page.set_viewport_size({"width": 360, "height": 740})
    page = story.open("/console#/deliveries/dlv_1").page
    expect(page.get_by_role("list", name="Planned and real")).to_be_visible()
    expect(page.get_by_role("list", name="What happened")).to_have_count(0)

    page.get_by_role("heading", name="What happened").click()
    expect(page.get_by_role("list", name="What happened")).to_be_attached()
    wider = page.evaluate("document.querySelector('main').scrollWidth - innerWidth")
    assert wider <= 0
    assert serious_problems(page) == []


@pytest.mark.long
def test_the_webhooks_of_a_delivery_are_read_when_they_are_opened(story: StagedPage) -> None:
    webhooks = {"items": [{"webhook_id": "whk_1", "url": "https://shop.example/hook"}]}
    sent = {"event_type": "delivery.replanned", "outcome": "FAILED", "status": 500}
    attempts = [
        sent | {"attempt_id": each, "event_id": f"evt_{each}", "wall_at": moment(7)}
        for each in (2, 9)
    ]
    story.answers |= {
        "/v1/webhooks": webhooks | {"next_cursor": None},
        "/v1/webhooks/whk_1/attempts": {"items": attempts},
    }
    page = story.open("/console#/deliveries/dlv_1").page
    replan(story, 360)
    expect(page.get_by_role("list", name="What happened").get_by_role("listitem")).to_have_count(1)
    assert not any("/v1/webhooks" in each for each in story.asked)

    page.get_by_role("heading", name="Webhooks").click()
    listed = page.get_by_role("list", name="Webhooks").get_by_role("listitem")
    expect(listed).to_have_count(1)
    expect(listed).to_contain_text("https://shop.example/hook: Failed (500)")


def test_a_name_on_the_way_that_would_cover_another_one_is_hidden(story: StagedPage) -> None:
    ways = [stop("a", -97.9), stop("beside-a", -97.8999), stop("far-hill", -97.5)]
    story.answers[f"{PATH}/track"] = {"type": "FeatureCollection", "features": ways}

    page = story.open("/console#/deliveries/dlv_1").page

    names = page.locator(".way-stop span")
    expect(names).to_have_count(3)
    expect(names.nth(1)).to_be_hidden()
    expect(names.nth(0)).to_be_visible()
    expect(names.nth(2)).to_be_visible()
