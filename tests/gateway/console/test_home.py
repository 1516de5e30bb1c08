"""The first page answers how it is going, for each role."""

from datetime import UTC, datetime
from typing import Any

import pytest
from playwright.sync_api import Browser, expect

from tests.end_to_end.browser import needs_browser
from tests.gateway.console.hostile_names import ANSWERS
from tests.gateway.console.staged_page import LIVE, StagedPage
from tests.gateway.console.test_every_view import staged

pytestmark = [pytest.mark.integration, needs_browser]


def minutes_later(minutes: float) -> str:
    """A moment after noon, when the clock of a staged gateway begins."""
    return datetime.fromtimestamp(1772366400 + 60 * minutes, UTC).isoformat()


def running(eta_min: float, *, due_min: float, **members: Any) -> dict[str, Any]:
    """A delivery of the live picture whose package arrives so many minutes after noon."""
    package = {
        "state": "IN_TRANSIT",
        "destination": {"station_id": "b"},
        "eta_at": minutes_later(eta_min),
        "due_at": minutes_later(due_min),
    }
    return {
        "state": "IN_PROGRESS",
        "is_waiting": False,
        "created_at": minutes_later(-30),
        "pickup": {"station_id": "a"},
        "mission_ids": [],
        "packages": {"p1": package},
        **members,
    }


def test_an_operator_sees_what_needs_somebody(browser: Browser) -> None:
    stage = staged(browser, "operator")
    page = stage.open("/console").page
    drones = {
        f"drn_{number}": {"state": state, "soc": 0.5, "position": [0, 0]}
        for number, state in enumerate(("AVAILABLE", "ON_MISSION", "ON_MISSION"))
    }
    picture = {"drones": drones, "deliveries": {"dlv_1": running(10, due_min=20)}}
    stage.send(LIVE, "snapshot", picture)
    main = page.locator("main")
    expect(main.get_by_role("heading", level=1)).to_have_text("All is well")
    expect(main).to_contain_text("1 delivery is under way, and none is late.")
    expect(main.get_by_label("Drones by state")).to_contain_text("2 on mission")
    expect(main.get_by_label("Deliveries of today by state")).to_contain_text("2 delivered")
    expect(main.get_by_role("table", name="Pads in use by hour")).to_contain_text("1.0 pads")
    pads = [each for each in stage.asked if "/v1/stats/pads" in each]
    assert len(pads) == 13

    late = running(40, due_min=20, mission_ids=["msn_1"], reference="Order 7")
    waiting = running(10, due_min=20, is_waiting=True, packages={})
    change = {
        "deliveries": {"dlv_2": late, "dlv_3": waiting},
        "missions": {"msn_1": {"drone_id": "drn_1"}},
    }
    stage.send(LIVE, "change", change)
    expect(main.get_by_role("heading", level=1)).to_have_text("2 things need you")
    expect(main.get_by_label("Waiting requests by age")).to_contain_text("1 up to 60 min")
    link = page.get_by_role("link", name="is late with Order 7")
    expect(link).to_have_attribute("href", "#/map/drone/drn_1")
    assert stage.errors == []
    stage.close()


@pytest.mark.long
def test_a_provider_sees_its_earnings_and_the_next_maintenance(browser: Browser) -> None:
    stage = staged(browser, "provider")
    page = stage.open("/console").page
    stage.send(LIVE, "snapshot", {"drones": {"drn_1": {"state": "OFFLINE", "soc": 0.5}}})

    expect(page.get_by_role("heading", level=1)).to_have_text("Your fleet needs you")
    expect(page.locator(".tile", has_text="Earned today")).to_contain_text("US$9.00")
    expect(page.locator(".tile", has_text="Next maintenance")).to_contain_text(
        "5 flight hours left"
    )
    assert stage.errors == []
    stage.close()


def test_a_customer_sees_when_its_packages_come(browser: Browser) -> None:
    stage = StagedPage(
        browser,
        ANSWERS | {"/v1/sessions/current": {"subject_id": "river-books", "role": "customer"}},
    )
    stage.install_clock()
    page = stage.open("/console").page
    stage.send(LIVE, "snapshot", {})
    expect(page.get_by_role("heading", level=1)).to_have_text("Good afternoon, River Books")
    expect(page.locator("main")).to_contain_text("Nothing is on its way.")
    steps = {
        str(number): {"kind": kind, "status": status, "position": place}
        for number, (kind, status, place) in enumerate(
            [
                ("FLY", "ENDED", [5, 5]),
                ("PICK_UP", "ENDED", [0, 0]),
                ("FLY", "PLANNED", [1, 0]),
                ("DELIVER", "PLANNED", [1, 0]),
            ]
        )
    }
    stage.send(
        LIVE,
        "change",
        {
            "deliveries": {
                "dlv_1": running(10, due_min=5, reference="order 7", mission_ids=["msn_1"]),
                "dlv_2": running(90, due_min=90),
            },
            "missions": {"msn_1": {"state": "ACTIVE", "steps": steps}},
            "drones": {"drn_1": {"mission_id": "msn_1", "position": [0.5, 0], "heading_deg": 90}},
        },
    )
    first, second = page.get_by_label("Running deliveries").get_by_role("listitem").all()
    expect(first).to_contain_text("order 7")
    expect(first).to_contain_text("5 min later than promised")
    expect(first.get_by_role("img", name="The way from")).to_be_visible()
    expect(first.locator(".way circle")).to_have_count(2)
    expect(second).to_contain_text("1 h 30 min")
    before = first.locator(".figure").text_content()
    page.clock.run_for(2_000)

    expect(first.locator(".figure")).not_to_have_text(before or "")
    page.get_by_role("link", name="New delivery").last.click()
    expect(page.get_by_role("heading", name="Where shall it go?")).to_be_visible()
    assert stage.errors == []
    stage.close()
