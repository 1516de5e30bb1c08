"""Idle drones stand by where their provider or their own setting sends them."""

from typing import Any

import pytest

from tests.end_to_end.corridor_network import corridor

pytestmark = [pytest.mark.end_to_end, pytest.mark.storage_pair("embedded"), pytest.mark.long]


def flown_steps(system: Any, delivery_id: str) -> list[dict[str, Any]]:
    """The steps of the delivery's only mission, in order."""
    [mission] = system.delivery(delivery_id)["missions"]
    progress = system.operate("GET", f"/v1/missions/{mission['mission_id']}")
    return [each["step"] for each in progress["steps"]]


def test_a_drone_that_stays_is_booked_again_from_where_it_stands(system: Any) -> None:
    network = corridor("standby")
    network["features"][1]["properties"]["parking"] = True
    system.operate("PUT", "/v1/networks/standby", network)
    provider = system.start_fleet(["standby-s1"], standby="STAY")
    fleet = f"/v1/providers/{provider['provider_id']}/drones"
    drone_id = provider["drones"][0]["drone_id"]

    first = system.request_delivery(["standby-s3"], pickup="standby-s1")
    system.until_state(first, "COMPLETED")
    changed = system.operate("PATCH", f"{fleet}/{drone_id}", {"standby": "PARKING"})
    second = system.request_delivery(["standby-s4"], pickup="standby-s3")
    system.until_state(second, "COMPLETED")
    system.eventually(
        lambda: system.operate("GET", f"{fleet}/{drone_id}")["state"] == "AVAILABLE",
        "the drone available at its parking station",
    )

    stayed = flown_steps(system, first)[-1]
    begun, *_, parked = flown_steps(system, second)
    assert (provider["standby"], changed["standby"]) == ("STAY", "PARKING")
    assert (stayed["kind"], stayed["station_id"]) == ("RECHARGE", "standby-s3")
    assert (begun["kind"], begun["station_id"]) == ("PICK_UP", "standby-s3")
    assert (parked["kind"], parked["station_id"]) == ("RECHARGE", "standby-s2")
    assert system.operate("GET", f"{fleet}/{drone_id}")["station_id"] == "standby-s2"
