"""`skyway drone` by hand, killed again and again: the delivery completes, nothing is done twice."""

import json
from collections import Counter
from typing import Any

import pytest
from ladders import QUICK_CHARGE, ladders
from lone_drone import register, run, until

pytestmark = [pytest.mark.end_to_end, pytest.mark.fleet_rate(60.0)]

#: Hand-overs take long enough to be killed in.
_SETTINGS = {"currency": "USD", "loading_s": 30, "dropoff_s": 240}


def test_a_drone_killed_in_flight_at_a_hand_over_and_on_a_pad_does_each_thing_once(
    system: Any,
) -> None:
    system.operate("PUT", "/v1/networks/alone", ladders("alone") | {"settings": _SETTINGS})
    system.operate("PUT", "/v1/drone-models/quick-charge", QUICK_CHARGE)
    drone = register(system, "alone-s1", model_id="quick-charge")
    process = run(system, token=drone["enrolment_token"])
    until(system, drone, "AVAILABLE")
    delivery_id = system.request_delivery(["alone-s3", "alone-s4"], pickup="alone-s1")

    written: set[tuple[int | None, str, str]] = set()
    for activity in ("FLYING", "DELIVERING", "RECHARGING"):
        system.eventually(
            lambda activity=activity: _activity(system, delivery_id) == activity,
            activity,
            told=lambda: system.delivery(delivery_id),
        )
        process.kill()
        process.wait()
        written |= _events(system, drone)
        process = run(system)
    delivery = system.until_state(delivery_id, "COMPLETED", "FAILED")

    written |= _events(system, drone)
    steps = Counter(step_id for step_id, _, kind in written if kind.startswith("STEP_"))
    assert delivery["state"] == "COMPLETED", delivery
    assert set(steps.values()) == {1}
    assert _handed_over(system, delivery_id) == {"p1": 1, "p2": 1}
    assert {package["custodian"]["kind"] for package in delivery["packages"]} == {"RECIPIENT"}
    assert len(delivery["missions"]) == 1


def _activity(system: Any, delivery_id: str) -> str | None:
    missions = system.delivery(delivery_id)["missions"]
    if not missions:
        return None
    state = system.operate("GET", f"/v1/missions/{missions[0]['mission_id']}")["drone_state"]
    activity: str | None = state and state["activity"]
    return activity


def _events(system: Any, drone: dict[str, Any]) -> set[tuple[int | None, str, str]]:
    """Step, id and kind of the events that the drone's journal holds now."""
    path = system.folder.journals / f"{drone['drone_id']}.jsonl"
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    kept = [*lines[0]["events"], *(line["event"] for line in lines[1:] if line["kind"] == "EVENT")]
    return {(event["step_id"], event["message_id"], event["event"]) for event in kept}


def _handed_over(system: Any, delivery_id: str) -> dict[str, int]:
    """How often the customer was told that each package is delivered."""
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    text = system.call("GET", f"/v1/deliveries/{delivery_id}/events", key=key).text
    told = [
        json.loads(line.removeprefix("data: "))
        for line in text.splitlines()
        if line.startswith("data: ")
    ]
    return dict(
        Counter(
            event["data"]["package_id"] for event in told if event["type"] == "package.delivered"
        )
    )
