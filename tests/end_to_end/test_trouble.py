"""A drone that is offline, and a customer who asks for another customer's delivery."""

from typing import Any

import pytest

pytestmark = [pytest.mark.end_to_end, pytest.mark.long]


@pytest.mark.storage_pair("embedded")
def test_an_online_drone_is_preferred_to_an_offline_drone(system: Any) -> None:
    system.publish_corridor("away")
    away = system.start_fleet(["away-s1"], name="Away Air")
    system.fleets[-1].kill()
    system.fleets[-1].wait()
    there = system.start_fleet(["away-s2"], name="There Air")

    delivery_id = system.request_delivery(["away-s3"], pickup="away-s1")

    delivery = system.until_state(delivery_id, "COMPLETED")
    assert delivery["missions"][-1]["provider_id"] == there["provider_id"]
    assert away["provider_id"] != there["provider_id"]


@pytest.mark.storage_pair("postgresql-mosquitto")
def test_a_customer_cannot_see_the_delivery_of_another(system: Any) -> None:
    system.publish_corridor("private")
    system.start_fleet(["private-s1"])
    delivery_id = system.request_delivery(["private-s2"], pickup="private-s1")
    made = system.operate("POST", "/v1/keys", {"role": "customer", "subject_id": "other"})

    answer = system.call("GET", f"/v1/deliveries/{delivery_id}", key=made["key"])

    assert answer.status_code == 404
    assert answer.json()["type"] == "urn:skyway:problem:not-found"
