"""A held offer is flown at the offered times, and nobody else gets its drone meanwhile."""

from datetime import datetime, timedelta
from typing import Any

import pytest

pytestmark = [pytest.mark.end_to_end, pytest.mark.storage_pair("postgresql-mosquitto")]


def test_a_held_offer_is_flown_at_the_offered_times_while_others_wait(system: Any) -> None:
    system.publish_corridor("hold")
    provider = system.start_fleet(["hold-s1"])
    body = _body(provider)
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    quote = system.eventually(lambda: _held_quote(system, body), "a held quote")
    [offer] = quote["offers"]

    others = system.call("POST", "/v1/quotes", key=key, body=body).json()
    waiting = system.call("POST", "/v1/deliveries", key=key, body=body).json()["delivery_id"]
    system.eventually(lambda: system.delivery(waiting)["waiting"], "a place")
    choice = {"quote_id": quote["quote_id"], "offer_id": offer["offer_id"]}
    accepted = system.call(
        "POST", "/v1/deliveries", key=key, body=choice, **{"Idempotency-Key": "held"}
    )
    again = system.call(
        "POST", "/v1/deliveries", key=key, body=choice, **{"Idempotency-Key": "held"}
    )
    held = system.until_ended(accepted.json()["delivery_id"])
    waited = system.until_ended(waiting)

    assert others["offers"] == []
    reasons = {each["provider_id"]: each["code"] for each in others["infeasible"]}
    assert reasons[provider["provider_id"]] == "BUSY"
    assert again.content == accepted.content
    assert (held["state"], waited["state"]) == ("COMPLETED", "COMPLETED")
    [package], [eta] = held["packages"], offer["packages"]
    assert _moment(package["promised_at"]) == pytest.approx(
        _moment(eta["eta_at"]), abs=timedelta(milliseconds=1)
    )
    assert held["missions"][0]["drone_id"] == offer["drone_id"]
    assert held["missions"][0]["price"] == offer["price"]
    assert waited["missions"][0]["start_at"] > held["missions"][0]["start_at"]


def _body(provider: dict[str, Any]) -> dict[str, Any]:
    return {
        "pickup": {"station_id": "hold-s1"},
        "packages": [
            {"package_id": "p1", "mass_kg": 0.5, "destination": {"station_id": "hold-s2"}}
        ],
        "qos": {"providers": {"pinned": provider["provider_id"]}},
    }


def _held_quote(system: Any, body: dict[str, Any]) -> dict[str, Any] | None:
    """A quote whose offer is held; None until the drone is known to stand ready."""
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    answer = system.call("POST", "/v1/quotes", key=key, body={**body, "hold": True})
    assert answer.status_code == 201, answer.text
    quote: dict[str, Any] = answer.json()
    is_held = bool(quote["offers"]) and quote["offers"][0]["is_held"]
    return quote if is_held else None


def _moment(text: str) -> datetime:
    return datetime.fromisoformat(text)
