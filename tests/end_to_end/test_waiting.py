"""Requests that no drone can fly yet: they wait in order, and far pickups are only scheduled."""

import json
from datetime import datetime, timedelta
from typing import Any

import pytest

pytestmark = [pytest.mark.end_to_end, pytest.mark.storage_pair("embedded"), pytest.mark.long]


def test_waiting_requests_are_booked_by_class_when_their_drone_comes_online(system: Any) -> None:
    system.publish_corridor("queue")
    provider = _registered(system)
    standard = _request(system, provider)
    urgent = _request(system, provider, priority="PRIORITY")
    later = _request(system, provider, hours_ahead=72)
    waiting = [
        system.eventually(lambda each=each: system.delivery(each)["waiting"], "a place")
        for each in (standard, urgent)
    ]
    assert [each["place"] for each in waiting] == [1, 1]
    assert system.delivery(later)["state"] == "SCHEDULED"

    system.run_fleet(provider["file"])
    first, second = system.until_ended(urgent), system.until_ended(standard)
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    cancelled = system.call("POST", f"/v1/deliveries/{later}/cancel", key=key)

    assert (first["state"], second["state"]) == ("COMPLETED", "COMPLETED")
    # A drone that gets its first mission too late refuses it; then it flies the other one first.
    assert _first_mission(system, urgent) < _first_mission(system, standard)
    assert (first["price"]["amount"], second["price"]["amount"]) == (200, 100)
    assert first["waiting"] is None
    assert cancelled.json()["state"] == "CANCELLED", cancelled.text


def _registered(system: Any) -> dict[str, Any]:
    """A provider with a drone that is not running yet."""
    tariff = {"currency": "USD", "base": 100, "priority_factor": 2}
    body = {"name": "Late Air", "tariff": tariff}
    provider: dict[str, Any] = system.operate("POST", "/v1/providers", body)
    path = f"/v1/providers/{provider['provider_id']}/drones"
    drones = [{"model_id": "paper-scenario", "home_station_id": "queue-s1"}]
    file = system.folder.path / "late-air.json"
    file.write_text(json.dumps(system.operate("POST", path, drones)))
    return {**provider, "file": file}


def _first_mission(system: Any, delivery_id: str) -> str:
    """The id of the first mission that was booked for a delivery; ids grow with time."""
    found = system.operate("GET", f"/v1/missions?delivery_id={delivery_id}")
    return str(min(each["mission_id"] for each in found["items"]))


def _request(
    system: Any, provider: dict[str, Any], *, priority: str = "STANDARD", hours_ahead: int = 0
) -> str:
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    package = {"package_id": "p1", "mass_kg": 0.5, "destination": {"station_id": "queue-s2"}}
    body: dict[str, Any] = {
        "pickup": {"station_id": "queue-s1"},
        "packages": [package],
        "qos": {"priority": priority, "providers": {"pinned": provider["provider_id"]}},
    }
    if hours_ahead:
        now = datetime.fromisoformat(system.call("GET", "/v1/clock", key=key).json()["now"])
        body["earliest_pickup_at"] = (now + timedelta(hours=hours_ahead)).isoformat()
    answer = system.call("POST", "/v1/deliveries", key=key, body=body)
    assert answer.status_code == 202, answer.text
    return str(answer.json()["delivery_id"])
