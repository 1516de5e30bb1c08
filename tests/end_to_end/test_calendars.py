"""Two drones, six equal requests: each is planned immediately with an arrival time, and flown."""

import json
from typing import Any

import pytest

pytestmark = pytest.mark.end_to_end


@pytest.mark.storage_pair("embedded")
def test_six_requests_for_two_drones_are_planned_immediately_and_all_completed(
    system: Any,
) -> None:
    system.publish_corridor("chain")
    provider = system.start_fleet(["chain-s1"] * 2)["provider_id"]

    ids = [system.request_delivery(["chain-s2"], pickup="chain-s1") for _ in range(6)]
    planned = [system.until_state(each, *_PLANNED) for each in ids]
    schedule = system.operate("GET", f"/v1/providers/{provider}/schedule")
    drawn = system.command("schedule", "--provider", provider)
    ended = [system.until_ended(each) for each in ids]

    etas = [package["eta_at"] for delivery in planned for package in delivery["packages"]]
    assert len(etas) == 6
    assert all(etas)
    states = [entry["state"] for drone in schedule["items"] for entry in drone["entries"]]
    assert len(schedule["items"]) == 2
    assert "QUEUED" in states
    assert drawn.returncode == 0, drawn.stderr
    assert all(drone["drone_id"] in drawn.stdout for drone in schedule["items"])
    assert [delivery["state"] for delivery in ended] == ["COMPLETED"] * 6
    # Each customer's first event after the request is the plan with its arrival times.
    assert [_events(system, each)[:2] for each in ids] == [_FIRST_EVENTS] * 6
    assert system.broken_rules() == []


#: States of a delivery that is planned and not over.
_PLANNED = ("PLANNED", "DISPATCHED", "LOADING", "IN_PROGRESS")

_FIRST_EVENTS = ["delivery.requested", "delivery.planned"]


def _events(system: Any, delivery_id: str) -> list[str]:
    """The types of all events of a delivery that has ended."""
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    text = system.call("GET", f"/v1/deliveries/{delivery_id}/events", key=key).text
    lines = [line.removeprefix("data: ") for line in text.splitlines() if line[:6] == "data: "]
    return [json.loads(line)["type"] for line in lines]
