"""The replay begins where an address says, and jumps from event to event."""

from typing import Any

import pytest
from playwright.sync_api import expect

from tests.end_to_end.browser import needs_browser, serious_problems
from tests.gateway.console.staged_page import StagedPage

pytestmark = [pytest.mark.integration, needs_browser, pytest.mark.long]


def page_of(*items: Any) -> dict[str, Any]:
    return {"items": list(items), "next_cursor": None}


@pytest.fixture
def past(stage: StagedPage) -> StagedPage:
    """An hour in which a drone lands, a station is closed for some time, and a plan is sent."""
    places = {10: 0.0, 11: 0.1, 12: 0.2, 13: 0.2, 14: 0.2}
    samples = [
        {"at": f"2026-03-01T10:{minute}:00Z", "position": [east, 0], "soc": 0.5}
        for minute, east in places.items()
    ]
    closure = {"closure_id": "cls_1", "kind": "STATION", "station_id": "moor"}
    plan = {"mission_id": "msn_1", "mission_revision": 2, "first_step": 1, "is_accepted": True}
    stage.answers |= {
        "/v1/drones": page_of({"drone_id": "drn_1", "provider_id": "prv_1", "name": "Heron"}),
        "/v1/providers/prv_1/drones/drn_1/telemetry": {"items": samples},
        "/v1/alarms": page_of({"alarm_id": "alm_1", "code": "GUST", "at": "2026-03-01T10:30:00Z"}),
        "/v1/closures": page_of(
            closure | {"from_at": "2026-03-01T10:20:00Z", "until": "2026-03-01T10:40:00Z"}
        ),
        "/v1/drones/drn_1/plans": {
            "plans": [plan | {"sent_at": "2026-03-01T10:05:00Z", "steps": []}]
        },
    }
    return stage


def test_keys_jump_from_event_to_event(past: StagedPage) -> None:
    page = past.open("/console#/replay/2026-03-01T10%3A00%3A00Z/drn_1").page
    listed = page.get_by_role("list", name="What happened in this hour").get_by_role("listitem")
    expect(listed).to_have_count(5)
    expect(page.locator(".marks path")).to_have_count(5)
    assert serious_problems(page) == []
    head = page.locator(".player output")
    page.locator(".replay-view").focus()
    for shown in ("10:05:00", "10:12:00", "10:20:00", "10:30:00", "10:40:00"):
        page.keyboard.press("n")
        expect(head).to_contain_text(shown)
    page.keyboard.press("p")
    expect(head).to_contain_text("10:30:00")
    page.keyboard.press("ArrowLeft")
    expect(head).to_contain_text("10:29:50")
    expect(listed.nth(1)).to_contain_text("lands")

    page.keyboard.press(" ")
    expect(page.get_by_role("button", name="Pause")).to_be_visible()
    page.keyboard.press(" ")
    expect(page.get_by_role("button", name="Play", exact=True)).to_be_visible()


def test_a_wrong_moment_in_the_address_shows_the_last_hour(past: StagedPage) -> None:
    page = past.open("/console#/replay/yesterday").page

    expect(page.locator(".ends")).to_have_text("11:0012:00")
