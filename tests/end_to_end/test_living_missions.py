"""The world changes while drones fly: missions are replanned and deliveries complete."""

from typing import Any

import pytest

from tests.end_to_end.ladder_network import QUICK_CHARGE, ladders

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.long,
    pytest.mark.fleet_rate(60.0),
    pytest.mark.storage_pair("postgresql-mosquitto"),
]

#: Charges for so long that its pad can fail meanwhile, on a slow machine too.
_SLOW_CHARGE = QUICK_CHARGE | {
    "model_id": "slow-charge",
    "charge_curve": [[0.0, 0.0], [3600.0, 1.0]],
}


def test_deliveries_complete_though_stations_close_pads_fail_and_zones_appear(system: Any) -> None:
    names = ("closed", "failed", "zoned", "slow")
    system.operate("PUT", "/v1/networks/living", ladders(*names))
    system.operate("PUT", "/v1/drone-models/quick-charge", QUICK_CHARGE)
    system.operate("PUT", "/v1/drone-models/slow-charge", _SLOW_CHARGE)
    system.start_fleet(["closed-s1", "zoned-s1"], model_id="quick-charge")
    system.start_fleet(["failed-s1"], model_id="slow-charge")
    system.start_fleet(
        ["slow-s1"], model_id="quick-charge", options=("--flight-time-factor", "1.4")
    )
    deliveries = {
        name: system.request_delivery([f"{name}-s5"], pickup=f"{name}-s1") for name in names
    }

    closed = _when(system, deliveries["closed"], "FLY")
    lost = _next_recharge(closed)
    system.operate("POST", f"/v1/stations/{lost}/closures", {"reason": "roof works"})
    zoned = _when(system, deliveries["zoned"], "FLY")
    system.operate("POST", "/v1/zones", _zone_around("zoned-s4", ladders(*names)))
    failed = _when(system, deliveries["failed"], "RECHARGE")
    pad = _under_way(failed)
    assert pad is not None
    system.operate(
        "POST", f"/v1/stations/{pad['station_id']}/pads/{pad['pad']}/outages", {"reason": "short"}
    )
    ended = {
        name: system.until_state(delivery_id, "COMPLETED")
        for name, delivery_id in deliveries.items()
    }

    assert _mission_of(system, ended["closed"])["mission"]["revision"] > 1
    assert not [
        step
        for step in _mission_of(system, ended["closed"])["steps"]
        if step["step"]["kind"] == "RECHARGE" and step["step"]["station_id"] == lost
    ]
    assert "delivery.replanned" in _event_types(system, deliveries["closed"])
    assert _mission_of(system, ended["failed"])["mission"]["revision"] > 1
    assert _mission_of(system, ended["zoned"])["mission"]["revision"] > 1
    assert zoned["mission"]["mission_id"] == ended["zoned"]["missions"][0]["mission_id"]
    assert "delivery.delayed" in _event_types(system, deliveries["slow"])


def _when(system: Any, delivery_id: str, kind: str) -> dict[str, Any]:
    """The delivery's mission, when its drone has the packages and is at a step of this kind."""

    def seen() -> dict[str, Any] | None:
        delivery = system.delivery(delivery_id)
        if delivery["state"] != "IN_PROGRESS":
            return None
        mission = _mission_of(system, delivery)
        step = _under_way(mission)
        return mission if step and step["kind"] == kind else None

    found: dict[str, Any] = system.eventually(seen, f"{delivery_id} at {kind}")
    return found


def _mission_of(system: Any, delivery: dict[str, Any]) -> dict[str, Any]:
    mission_id = delivery["missions"][0]["mission_id"]
    found: dict[str, Any] = system.operate("GET", f"/v1/missions/{mission_id}")
    return found


def _under_way(mission: dict[str, Any]) -> dict[str, Any] | None:
    state = mission["drone_state"]
    steps = [each["step"] for each in mission["steps"]]
    return next((step for step in steps if step["step_id"] == state["step_id"]), None)


def _next_recharge(mission: dict[str, Any]) -> str:
    """The station of the drone's next recharge: two rungs from the start, 17 s of wall time."""
    at = mission["drone_state"]["step_id"]
    stations: list[str] = [
        each["step"]["station_id"]
        for each in mission["steps"]
        if each["step"]["kind"] == "RECHARGE" and each["step"]["step_id"] > at
    ]
    return stations[0]


def _zone_around(station_id: str, network: dict[str, Any]) -> dict[str, Any]:
    [place] = [
        feature["geometry"]["coordinates"]
        for feature in network["features"]
        if feature["properties"].get("station_id") == station_id
    ]
    west, east = place[0] - 0.01, place[0] + 0.01
    south, north = place[1] - 0.01, place[1] + 0.01
    ring = [[west, south], [east, south], [east, north], [west, north], [west, south]]
    return {
        "network_id": "living",
        "area": {"type": "Polygon", "coordinates": [ring]},
        "reason": "fire brigade",
    }


def _event_types(system: Any, delivery_id: str) -> list[str]:
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    text = system.call("GET", f"/v1/deliveries/{delivery_id}/events", key=key).text
    return [line.removeprefix("event: ") for line in text.splitlines() if "event: " in line]
