"""Customers in a market of providers: offers, a split delivery, cancelling, proof."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

pytestmark = pytest.mark.end_to_end


@pytest.mark.storage_pair("embedded")
def test_the_accepted_offer_is_flown(system: Any) -> None:
    system.publish_corridor("offers")
    near = system.start_fleet(
        ["offers-s1"], name="Near Air", tariff={"currency": "USD", "base": 5_000, "per_km": 50}
    )
    cheap = system.start_fleet(
        ["offers-s2"], name="Cheap Air", tariff={"currency": "USD", "base": 100, "per_km": 1}
    )
    none = system.operate(
        "POST", "/v1/providers", {"name": "No Air", "tariff": {"currency": "USD", "base": 1}}
    )

    fastest = _quote(system, {"objective": "FASTEST"})
    cheapest = _quote(system, {"objective": "CHEAPEST"})
    pinned = _quote(system, {"providers": {"pinned": none["provider_id"]}})
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    raised = {"tariff": {"currency": "USD", "base": 90_000, "per_km": 900}}
    system.operate("PATCH", f"/v1/providers/{cheap['provider_id']}", raised)
    acceptance = {"quote_id": cheapest["quote_id"], "offer_id": cheapest["offers"][0]["offer_id"]}
    accepted = system.call("POST", "/v1/deliveries", key=key, body=acceptance)
    again = system.call("POST", "/v1/deliveries", key=key, body=acceptance)
    delivery = system.until_ended(accepted.json()["delivery_id"])
    proof = system.call("GET", f"/v1/deliveries/{delivery['delivery_id']}/proof", key=key).json()

    assert fastest["offers"][0]["provider_id"] == near["provider_id"]
    assert cheapest["offers"][0]["provider_id"] == cheap["provider_id"]
    assert pinned["offers"] == []
    assert {reason["provider_id"]: reason["code"] for reason in pinned["infeasible"]}[
        none["provider_id"]
    ] == "NO_DRONES"
    assert again.status_code == 409
    assert delivery["state"] == "COMPLETED", delivery
    assert delivery["provider_id"] == cheap["provider_id"]
    assert delivery["price"] == cheapest["offers"][0]["price"]
    [package] = proof["packages"]
    assert package["station_id"] == "offers-s3"
    assert package["load_before_kg"] - package["load_after_kg"] == pytest.approx(0.5)


@pytest.mark.storage_pair("postgresql-mosquitto")
@pytest.mark.long
def test_drones_of_another_network_at_the_same_place_are_no_candidates(system: Any) -> None:
    system.publish_corridor("here")
    system.publish_corridor("there")
    provider = system.start_fleet(["there-s1"] * 5 + ["here-s2"])
    pinned = {"providers": {"pinned": provider["provider_id"]}}

    # The registry needs a moment to learn which drones belong to which network.
    offers = system.eventually(lambda: _quote(system, pinned, network="here")["offers"], "an offer")

    assert [offer["provider_id"] for offer in offers] == [provider["provider_id"]]


@pytest.mark.storage_pair("embedded")
def test_a_request_too_heavy_for_one_drone_is_flown_in_two_trips(system: Any) -> None:
    system.publish_corridor("heavy")
    system.start_fleet(["heavy-s1"] * 2, model_id="paper-matrice-300")
    body = {
        "pickup": {"station_id": "heavy-s1"},
        "packages": [
            {"package_id": f"p{n}", "mass_kg": 10.0, "destination": {"station_id": "heavy-s2"}}
            for n in (1, 2)
        ],
    }

    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    accepted = system.call("POST", "/v1/deliveries", key=key, body=body)
    delivery = system.until_ended(accepted.json()["delivery_id"])

    assert delivery["state"] == "COMPLETED", delivery
    assert len({mission["drone_id"] for mission in delivery["missions"]}) == 2
    assert {package["state"] for package in delivery["packages"]} == {"DELIVERED"}


# PostgreSQL lets many write at the same time; the embedded database has one writer.
@pytest.mark.long
@pytest.mark.storage_pair("postgresql-mosquitto")
def test_many_simultaneous_requests_for_few_pads_all_end_without_double_booking(
    system: Any,
) -> None:
    system.publish_corridor("crowd")
    system.start_fleet(["crowd-s1", "crowd-s2", "crowd-s3"] * 3)
    key = system.keys["SKYWAY_CUSTOMER_KEY"]

    with ThreadPoolExecutor(16) as customers:
        ids = list(
            customers.map(
                lambda n: system.request_delivery([f"crowd-s{2 + n % 3}"], pickup="crowd-s1"),
                range(24),
            )
        )
    some = ids[::5]
    for delivery_id in some:
        system.call("POST", f"/v1/deliveries/{delivery_id}/cancel", key=key, body={})
    ended = [system.until_ended(delivery_id) for delivery_id in ids]

    # No delivery fails: all drones are healthy, and cancelled packages come back or stay.
    assert [delivery["packages"] for delivery in ended if delivery["state"] == "FAILED"] == []
    assert any(delivery["state"] == "COMPLETED" for delivery in ended)
    assert system.broken_rules() == []


def _quote(system: Any, qos: dict[str, Any], *, network: str = "offers") -> dict[str, Any]:
    body = {
        "pickup": {"station_id": f"{network}-s1"},
        "packages": [
            {"package_id": "p1", "mass_kg": 0.5, "destination": {"station_id": f"{network}-s3"}}
        ],
        "qos": qos,
    }
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    answer = system.call("POST", "/v1/quotes", key=key, body=body)
    assert answer.is_success, answer.text
    quote: dict[str, Any] = answer.json()
    return quote
