"""Two customers share a trip: each sees only its own packages, and both pay the pooled price."""

from typing import Any

import pytest

# Slow enough that the second customer asks while the first one's mission waits for others.
pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.long,
    pytest.mark.storage_pair("embedded"),
    pytest.mark.fleet_rate(120.0),
]


def test_two_customers_share_a_trip_and_see_only_their_own_packages(system: Any) -> None:
    system.publish_corridor("pool")
    tariff = {"currency": "USD", "base": 1_000, "pooled_factor": 0.6}
    provider = system.start_fleet(["pool-s1"], name="Pool Air", tariff=tariff)
    made = system.operate("POST", "/v1/keys", {"role": "customer", "subject_id": "river-books"})
    keys = [system.keys["SKYWAY_CUSTOMER_KEY"], made["key"]]

    quote = system.call("POST", "/v1/quotes", key=keys[0], body=_body(provider, "pool-s2")).json()
    first = _asked(system, keys[0], _body(provider, "pool-s2"))
    _until(system, keys[0], first, "PLANNED")
    second = _asked(system, keys[1], _body(provider, "pool-s2"))
    _until(system, keys[1], second, "COMPLETED")
    _until(system, keys[0], first, "COMPLETED")

    [offer] = quote["offers"]
    assert (offer["price"]["amount"], offer["pooled_price"]["amount"]) == (1_000, 600)
    seen = [_read(system, keys[0], first), _read(system, keys[1], second)]
    for delivery in seen:
        assert delivery["price"]["amount"] == 600
        [mission] = delivery["missions"]
        assert mission["is_pooled"]
        assert [each["package_id"] for each in mission["packages"]] == ["p1"]
        assert [each["package_ids"] for each in mission["plan"]["steps"] if "package_ids" in each]
    assert seen[0]["missions"][0]["drone_id"] == seen[1]["missions"][0]["drone_id"]
    assert seen[0]["missions"][0]["mission_id"] != seen[1]["missions"][0]["mission_id"]
    for key, other in zip(keys, (second, first), strict=True):
        assert system.call("GET", f"/v1/deliveries/{other}", key=key).status_code == 404
    for key, own in zip(keys, (first, second), strict=True):
        track = system.call("GET", f"/v1/deliveries/{own}/track", key=key)
        proof = system.call("GET", f"/v1/deliveries/{own}/proof", key=key).json()
        assert track.status_code == 200
        assert [each["package_id"] for each in proof["packages"]] == ["p1"]
        assert proof["packages"][0]["mass_kg"] == pytest.approx(0.5)
        assert proof["packages"][0]["load_before_kg"] is None
        # Nothing that a customer reads names the other delivery, or its mission.
        other_id = second if own == first else first
        assert other_id not in track.text
    listed = system.operate("GET", f"/v1/missions?delivery_id={second}")["items"]
    assert [each["guests"] for each in listed] == [[second]]
    assert system.broken_rules() == []


def _body(provider: dict[str, Any], destination: str) -> dict[str, Any]:
    return {
        "pickup": {"station_id": "pool-s1"},
        "packages": [
            {"package_id": "p1", "mass_kg": 0.5, "destination": {"station_id": destination}}
        ],
        "qos": {
            "objective": "CHEAPEST",
            "pooling": True,
            "pooling_wait_s": 3_600,
            "providers": {"pinned": provider["provider_id"]},
        },
    }


def _asked(system: Any, key: str, body: dict[str, Any]) -> str:
    answer = system.call("POST", "/v1/deliveries", key=key, body=body)
    assert answer.status_code == 202, answer.text
    return str(answer.json()["delivery_id"])


def _read(system: Any, key: str, delivery_id: str) -> dict[str, Any]:
    delivery: dict[str, Any] = system.call("GET", f"/v1/deliveries/{delivery_id}", key=key).json()
    return delivery


def _until(system: Any, key: str, delivery_id: str, state: str) -> None:
    system.eventually(lambda: _read(system, key, delivery_id)["state"] == state, state)
