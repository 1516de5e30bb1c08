"""The schedule names packages, marks promises, explains its bars, and is a list on a phone."""

from typing import Any, Final

import pytest
from playwright.sync_api import expect

from tests.end_to_end.browser import needs_browser, serious_problems
from tests.gateway.console.staged_page import LIVE, StagedPage

pytestmark = [pytest.mark.integration, needs_browser]


def moment(minute: int) -> str:
    return f"2026-03-01T12:{minute:02}:00Z"


def page_of(*items: Any) -> dict[str, Any]:
    return {"items": list(items), "next_cursor": None}


PICTURE: Final[dict[str, Any]] = {
    "drones": {"drn_1": {"name": "Heron", "soc": 0.8}},
    "missions": {
        "msn_1": {
            "delivery_id": "dlv_1",
            "drone_id": "drn_1",
            "state": "ACTIVE",
            "revision": 2,
            "packages": {"p1": moment(20), "p2": moment(48)},
            "promises": {"p1": moment(20), "p2": moment(40)},
            "steps": {},
        }
    },
}


def deliver(number: int, package_id: str, minute: int) -> dict[str, Any]:
    return {
        "step_id": number,
        "kind": "DELIVER",
        "package_ids": [package_id],
        "planned_end_at": moment(minute),
    }


def sent(revision: int, at: str, first: int, *steps: Any) -> dict[str, Any]:
    return {
        "mission_id": "msn_1",
        "mission_revision": revision,
        "sent_at": at,
        "is_accepted": True,
        "first_step": first,
        "steps": list(steps),
    }


@pytest.fixture
def booked(stage: StagedPage) -> StagedPage:
    """A drone with a mission whose second plan brings p2 eight minutes later."""
    service = {
        "start_at": moment(0),
        "served_at": moment(48),
        "from_station_id": "a",
        "to_station_id": "far-hill",
    }
    entry = {"mission_id": "msn_1", "delivery_id": "dlv_1", "state": "ACTIVE", "service": service}
    steps = [{"kind": "FLY", "start_s": 0, "end_s": 1_800, "soc_end": 0.4}]
    plan = {"steps": steps, "delivery_time_s": 2_880}
    stage.answers |= {
        "/v1/providers": page_of({"provider_id": "prv_1"}),
        "/v1/providers/prv_1/schedule": page_of(
            {"drone_id": "drn_1", "entries": [{**entry, "standby": {"until_at": moment(59)}}]}
        ),
        "/v1/missions": page_of({"mission_id": "msn_1", "start_at": moment(0), "plan": plan}),
        "/v1/drones/drn_1/plans": {
            "plans": [
                sent(1, "2026-03-01T10:30:00Z", 1, deliver(1, "p1", 20), deliver(2, "p2", 40)),
                sent(2, "2026-03-01T11:58:00Z", 2, deliver(2, "p2", 48)),
            ]
        },
    }
    return stage


def test_bars_name_packages_mark_promises_and_explain_themselves(booked: StagedPage) -> None:
    page = booked.open("/console#/schedule").page
    booked.send(LIVE, "snapshot", PICTURE)
    bar = page.get_by_role("link", name="p1, p2 → Far Hill")
    expect(bar).to_be_attached()
    expect(page.locator(".gantt .promise")).to_have_count(2)
    expect(page.locator(".gantt .promise.missed")).to_have_count(1)
    expect(page.locator(".gantt polyline.charge")).to_have_count(1)
    assert serious_problems(page) == []

    bar.focus()
    tip = page.get_by_role("tooltip")
    expect(tip).to_contain_text("A to Far Hill")
    expect(tip).to_contain_text("12:00 to 12:48. Active.")
    expect(tip).to_contain_text("p2 promised by 12:40, comes too late")
    page.keyboard.press("Escape")
    expect(tip).to_have_count(0)
    bar.press("Enter")
    page.wait_for_function("() => location.hash === '#/deliveries/dlv_1'")


def test_new_plans_of_the_last_hour_say_what_they_changed(booked: StagedPage) -> None:
    page = booked.open("/console#/schedule").page
    booked.send(LIVE, "snapshot", PICTURE)

    changes = page.get_by_role("list", name="New plans of the last hour").get_by_role("listitem")
    expect(changes).to_have_count(1)
    expect(changes).to_contain_text("11:58")
    expect(changes).to_contain_text("Heron, plan 2")
    expect(changes).to_contain_text("p1 as before; p2 8 min later")


@pytest.mark.long
def test_buttons_change_the_span(booked: StagedPage) -> None:
    page = booked.open("/console#/schedule").page
    booked.send(LIVE, "snapshot", PICTURE)
    first = page.locator(".gantt svg text").first
    for button, shown in (("See less", "12:15"), ("Earlier", "11:45"), ("Now", "11:30")):
        page.get_by_role("button", name=button).click()
        expect(first).to_have_text(shown)


@pytest.mark.long
def test_a_phone_shows_the_next_trips_of_each_drone(booked: StagedPage) -> None:
    booked.page.set_viewport_size({"width": 360, "height": 740})
    page = booked.open("/console#/schedule").page
    booked.send(LIVE, "snapshot", PICTURE)

    card = page.get_by_role("list", name="Next trips").get_by_role("listitem").first
    expect(card).to_contain_text("Heron")
    expect(card).to_contain_text("p1, p2 → Far Hill")
    expect(card).to_contain_text("Comes later than promised")
    expect(page.locator(".gantt")).to_have_count(0)
    assert page.evaluate("document.querySelector('main').scrollWidth - innerWidth") <= 0
    assert serious_problems(page) == []
