"""A drone is killed again and again; its delivery completes and nothing is done twice."""

import json
from collections import Counter
from collections.abc import Collection, Iterable
from typing import Any

import pytest

from skyway.contracts.drone_report import DroneEvent
from tests.end_to_end.drone_by_hand import register, run, until
from tests.end_to_end.drone_journal import events_of, logbook_of
from tests.end_to_end.ladder_network import QUICK_CHARGE, ladders

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.long,
    pytest.mark.fleet_rate(60.0),
    pytest.mark.storage_pair("embedded"),
    pytest.mark.system_name("trouble"),
]

#: Hand-overs take long enough to kill the drone during one.
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

    written: dict[str, DroneEvent] = {}
    killed_in: set[str] = set()
    while left := {"FLY", "DELIVER", "RECHARGE"} - killed_in:
        killed_in.add(_until_at(system, drone["drone_id"], left))
        process.kill()
        process.wait()
        written |= events_of(system, drone["drone_id"])
        process = run(system)
    delivery = system.until_state(delivery_id, "COMPLETED", "FAILED")

    written |= events_of(system, drone["drone_id"])
    ends = [event for event in written.values() if event.event in ("STEP_ENDED", "STEP_FAILED")]
    done = [event for event in ends if event.event == "STEP_ENDED" and event.code != "CUT"]
    assert delivery["state"] == "COMPLETED", delivery
    # A late drone can lose its pad or be sent a longer charge. Then another revision replaces the
    # step that was not done.
    assert _highest_count(event.step_id for event in done) == 1, ends
    assert _highest_count((event.mission_revision, event.step_id) for event in ends) == 1, ends
    assert _handed_over(system, delivery_id) == {"p1": 1, "p2": 1}
    assert {package["custodian"]["kind"] for package in delivery["packages"]} == {"RECIPIENT"}
    assert len(delivery["missions"]) == 1


def _until_at(system: Any, drone_id: str, kinds: Collection[str]) -> str:
    """The kind of the drone's present step, when it is one of these kinds.

    Read from the drone's journal, because a hand-over can be over before the cloud knows of it.
    """

    def at() -> str | None:
        mission = logbook_of(system, drone_id).mission
        step = mission.step_under_way if mission else None
        return step.kind if step and step.kind in kinds else None

    found: str = system.eventually(
        at, f"at one of {kinds}", instead=lambda: logbook_of(system, drone_id).mission
    )
    return found


def _highest_count(things: Iterable[object]) -> int:
    """How often the most frequent thing occurs."""
    return max(Counter(things).values(), default=0)


def _handed_over(system: Any, delivery_id: str) -> dict[str, int]:
    """How many `package.delivered` events the customer got for each package."""
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    text = system.call("GET", f"/v1/deliveries/{delivery_id}/events", key=key).text
    events = [
        json.loads(line.removeprefix("data: "))
        for line in text.splitlines()
        if line.startswith("data: ")
    ]
    return dict(
        Counter(
            event["data"]["package_id"] for event in events if event["type"] == "package.delivered"
        )
    )
