"""Commands say what they do, show it on the map, and can be undone."""

from typing import Any, Final

import pytest
from playwright.sync_api import expect

from tests.end_to_end.browser import needs_browser, serious_problems
from tests.gateway.console.staged_page import LIVE, StagedPage

pytestmark = [pytest.mark.integration, needs_browser]

COMMANDS: Final = "/v1/missions/msn_1/commands"
PICTURE: Final[dict[str, Any]] = {
    "drones": {
        "drn_1": {
            "name": "Heron",
            "provider_id": "prv_1",
            "position": [0.5, 0],
            "state": "ON_MISSION",
            "mission_id": "msn_1",
        }
    },
    "missions": {
        "msn_1": {"delivery_id": "dlv_1", "drone_id": "drn_1", "state": "ACTIVE", "steps": {}}
    },
    "stations": {"b": {"position": [1, 0], "pads": 2}},
}
#: The kinds of the places that the map shows before a command.
SHOWN: Final = """() => document.querySelector(".map").fleetMap.map.getSource("preview")
  ?.serialize().data.features.map(({properties}) => properties.kind ?? "line").sort().join()"""


@pytest.fixture
def watched(stage: StagedPage) -> StagedPage:
    """A console with a drone on a mission."""
    landing = {"station_id": "b", "at": "2026-03-01T12:05:00Z"}
    outlook: dict[str, Any] = {"plan": "NOT_NEEDED", "next_landing": landing, "packages": []}
    stage.answers |= {COMMANDS: {"outlook": outlook}, "/v1/stations/b/schedule": {"pads": []}}
    return stage


def test_a_hold_is_shown_on_the_map_and_undone(watched: StagedPage) -> None:
    page = watched.open("/console#/map/drone/drn_1").page
    watched.send(LIVE, "snapshot", PICTURE)
    page.get_by_role("button", name="Hold").click()
    question = page.get_by_role("dialog", name="Hold: drone Heron")
    expect(question).to_contain_text("lands at the next station of its plan and waits there")
    expect(question).to_contain_text("lands next at B")
    page.wait_for_function(f"() => ({SHOWN})() === 'drone,landing,line'")
    assert serious_problems(page) == []

    question.get_by_label("Reason").fill("crowd")
    question.get_by_role("button", name="Hold").click()
    page.wait_for_function(f"() => ({SHOWN})() === ''")
    with page.expect_request(lambda request: request.url.endswith(COMMANDS)) as undone:
        page.get_by_role("button", name="Undo").click()
    body: Any = undone.value.post_data_json
    assert body["command"] == "RESUME"
    expect(page.get_by_text("The drone goes on by a new plan.")).to_be_visible()
    expect(page.get_by_role("button", name="Undo")).to_have_count(0)


@pytest.mark.long
def test_a_closed_station_is_opened_again_by_undo(watched: StagedPage) -> None:
    path = "/v1/stations/b/closures"
    affected = {"mission_id": "msn_1", "drone_id": "drn_1", "at": "2026-03-01T12:05:00Z"}
    closure = {"kind": "STATION", "station_id": "b", "from_id": None, "to_id": None}
    watched.answers[path] = closure | {
        "closure_id": "cls_1",
        "affected_missions": [affected | {"delay": None}],
    }
    page = watched.open("/console#/map/station/b").page
    watched.send(LIVE, "snapshot", PICTURE)
    page.get_by_role("button", name="Close the station").click()
    question = page.get_by_role("dialog")
    expect(question).to_contain_text("Heron, in 5 min")
    page.wait_for_function(f"() => ({SHOWN})() === 'closed,drone'")
    question.get_by_label("Reason").fill("crane")
    question.get_by_role("button", name="Close it").click()

    watched.answers[f"{path}/cls_1"] = {}
    with page.expect_request(lambda request: request.method == "DELETE") as opened:
        page.get_by_role("button", name="Undo").click()
    assert opened.value.url.endswith(f"{path}/cls_1")


def test_an_alarm_is_acknowledged_after_a_question(watched: StagedPage) -> None:
    path = "/v1/alarms/alm_1/acknowledgements"
    page = watched.open("/console#/alarms").page
    alarm = {"code": "BATTERY_COLD", "level": "URGENT", "at": "2026-03-01T11:55:00Z"}
    watched.send(LIVE, "snapshot", {"alarms": {"alm_1": alarm}})
    page.get_by_role("button", name="Acknowledge").click()
    question = page.get_by_role("dialog", name="Acknowledge: Battery cold")
    expect(question).to_contain_text("Its cause stays as it is")
    assert not any(each.startswith("POST") for each in watched.asked)

    watched.answers[path] = {}
    question.get_by_role("button", name="Acknowledge").click()
    expect(question).to_have_count(0)
    assert f"POST {path}?" in watched.asked


@pytest.mark.long
def test_a_drone_in_maintenance_is_put_back_by_undo(watched: StagedPage) -> None:
    drones = "/v1/providers/prv_1/drones"
    drone = {"drone_id": "drn_1", "provider_id": "prv_1", "name": "Heron", "state": "AVAILABLE"}
    watched.answers |= {
        "/v1/providers": {"items": [{"provider_id": "prv_1"}], "next_cursor": None},
        "/v1/drone-models": {"items": [], "next_cursor": None},
        drones: {
            "items": [drone | {"soc": 0.5, "model_id": "m", "home_station_id": "a"}],
            "next_cursor": None,
        },
        f"{drones}/drn_1": {},
    }
    page = watched.open("/console#/fleet").page
    page.get_by_role("button", name="What to do with Heron").click()
    page.get_by_role("button", name="Take Heron into maintenance").click()
    question = page.get_by_role("dialog", name="Into maintenance: drone Heron")
    expect(question).to_contain_text("gets no missions until somebody puts it back")
    with page.expect_request(lambda request: request.method == "PATCH") as taken:
        question.get_by_role("button", name="Into maintenance").click()
    assert taken.value.post_data_json == {"state": "MAINTENANCE"}

    with page.expect_request(lambda request: request.method == "PATCH") as undone:
        page.get_by_role("button", name="Undo").click()
    assert undone.value.post_data_json == {"state": "AVAILABLE"}


def test_a_provider_agrees_to_exchanges_and_sees_what_came_and_left(watched: StagedPage) -> None:
    at, own = "2026-03-01T10:00:00Z", "/v1/providers/prv_1"
    rows = [
        {"delivery_id": f"dlv_{number}", "at": moment, "direction": direction, "reason": "sooner"}
        for number, (moment, direction) in enumerate(
            [(at, "LEFT"), (at, "CAME"), (at, "CAME"), ("2026-02-28T10:00:00Z", "LEFT")]
        )
    ]
    watched.answers |= {
        "/v1/clock": {"now": "2026-03-01T12:00:00Z", "rate": 1.0},
        "/v1/providers": {"items": [{"provider_id": "prv_1"}], "next_cursor": None},
        own: {"provider_id": "prv_1", "exchanges_deliveries": False},
        f"{own}/exchanges": {"items": rows, "next_cursor": None},
    }
    page = watched.open("/console#/fleet/exchanges").page
    expect(page.get_by_text("2 came and 1 left today (UTC).")).to_be_visible()
    expect(
        page.get_by_role("table", name="Exchanges of deliveries").get_by_role("row")
    ).to_have_count(5)

    with page.expect_request(lambda request: request.method == "PATCH") as agreed:
        page.get_by_role("checkbox", name="Other providers may fly").click()
    assert agreed.value.post_data_json == {"exchanges_deliveries": True}
    expect(page.get_by_text("Deliveries are exchanged from now on")).to_be_visible()
