"""A delivery changes its provider: its customer and both providers agree, and its price stays."""

import json
import subprocess
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from tests.end_to_end.corridor_network import corridor
from tests.end_to_end.local_system import SKYWAY

# Slow enough that the dispatcher looks several times while missions wait for their drone.
pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.long,
    pytest.mark.storage_pair("embedded"),
    pytest.mark.fleet_rate(120.0),
]


def test_the_provider_that_flies_a_delivery_is_paid_the_price_that_was_agreed(
    system: Any,
) -> None:
    network = _joint_network(system, "exchange")
    first = system.start_fleet(["exchange-s1"], name="First Air", exchanges_deliveries=True)
    second = system.start_fleet(["exchange-s2"], name="Second Air", exchanges_deliveries=True)
    own = f"/v1/providers/{second['provider_id']}"
    # While the second provider is suspended, the drone of the first one gets all deliveries.
    system.operate("PATCH", own, {"state": "SUSPENDED"})
    pages = dict(
        _requested(system, network, pin="4711", may_change_provider=each != 1) for each in range(3)
    )
    asked = [*pages]
    booked = {
        each: system.until_state(each, "PLANNED", "DISPATCHED", "LOADING", "IN_PROGRESS")
        for each in asked
    }
    system.operate("PATCH", own, {"state": "ACTIVE"})

    def moved() -> list[str]:
        now = {each: system.delivery(each)["provider_id"] for each in asked}
        return [each for each in asked if now[each] == second["provider_id"]]

    assert {each["provider_id"] for each in booked.values()} == {first["provider_id"]}
    system.eventually(moved, "a delivery has changed its provider")

    with _recipients(system, pages.values()):
        for each in moved():
            _check_moved(system, booked[each], system.until_state(each, "COMPLETED"))
    assert asked[1] not in moved()
    assert system.broken_rules() == []


def test_a_drone_that_returns_from_maintenance_flies_what_waits_for_another_one(
    system: Any,
) -> None:
    network = _joint_network(system, "beside")
    provider = system.start_fleet(["beside-s1", "beside-s1"], name="Beside Air")
    first, second = (each["drone_id"] for each in provider["drones"])
    own = f"/v1/providers/{provider['provider_id']}/drones/{second}"
    system.operate("PATCH", own, {"state": "MAINTENANCE"})
    asked = [_requested(system, network)[0] for _ in range(3)]
    booked = {
        each: system.until_state(each, "PLANNED", "DISPATCHED", "LOADING", "IN_PROGRESS")
        for each in asked
    }
    assert {one["drone_id"] for each in booked.values() for one in each["missions"]} == {first}

    system.operate("PATCH", own, {"state": "AVAILABLE"})

    flown = [system.until_state(each, "COMPLETED") for each in asked]
    assert {one["drone_id"] for each in flown for one in each["missions"]} == {first, second}
    for after in flown:
        before = booked[after["delivery_id"]]
        assert after["price"] == before["price"]
        assert after["packages"][0]["promised_at"] == before["packages"][0]["promised_at"]
    assert system.broken_rules() == []


def _check_moved(system: Any, before: dict[str, Any], after: dict[str, Any]) -> None:
    """Check what the customer sees, who is paid, and who sees the delivery."""
    old, new = before["provider_id"], after["provider_id"]
    delivery_id = after["delivery_id"]
    assert after["price"]["amount"] <= before["price"]["amount"]
    [mission], [promised] = after["missions"], after["packages"]
    assert mission["provider_id"] == new
    assert mission["price"] == before["missions"][0]["price"]
    assert mission["payment_terms"] == before["missions"][0]["payment_terms"]
    assert promised["promised_at"] == before["packages"][0]["promised_at"]
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    stream = system.call("GET", f"/v1/deliveries/{delivery_id}/events", key=key).text
    lines = [each for each in stream.splitlines() if each.startswith("data: ")]
    events = [json.loads(each.removeprefix("data: ")) for each in lines]
    changes = [each["data"] for each in events if each["type"] == "delivery.replanned"]
    assert [each["provider_id"] for each in changes if each["code"] == "PROVIDER_CHANGED"] == [new]
    paid = system.operate("GET", f"/v1/statements/lines?delivery_id={delivery_id}")["items"]
    assert {each["provider_id"] for each in paid} == {new}
    assert sum(each["amount"] for each in paid) == after["price"]["amount"]
    for provider_id, is_shown in ((old, False), (new, True)):
        listed = system.operate("GET", f"/v1/providers/{provider_id}/deliveries")["items"]
        assert (delivery_id in {each["delivery_id"] for each in listed}) == is_shown
        changes = system.operate("GET", f"/v1/providers/{provider_id}/exchanges")["items"]
        directions = {each["direction"] for each in changes if each["delivery_id"] == delivery_id}
        assert directions == {"CAME" if is_shown else "LEFT"}


@contextmanager
def _recipients(system: Any, pages: Iterable[str]) -> Iterator[None]:
    """People who type the PIN when a drone waits for it."""
    command = [*SKYWAY, "recipient", *pages, "--every-s", "0.3"]
    with subprocess.Popen(command, env=system.environment, stdout=subprocess.DEVNULL) as people:
        try:
            yield
        finally:
            people.terminate()


def _joint_network(system: Any, name: str) -> str:
    """Publish a corridor in which providers may exchange deliveries; returns its name."""
    document = corridor(name)
    document["settings"]["joint_dispatch"] = True
    system.operate("PUT", f"/v1/networks/{name}", document)
    return name


def _requested(system: Any, network: str, *, pin: str | None = None, **qos: Any) -> tuple[str, str]:
    """Ask for a delivery with this QoS and PIN; its id, and its tracking page."""
    package = {"package_id": "p1", "mass_kg": 0.5, "destination": {"station_id": f"{network}-s2"}}
    if pin is not None:
        package["dropoff_verification"] = {"method": "PIN", "pin": pin, "wait_s": 900}
    body = {"pickup": {"station_id": f"{network}-s1"}, "packages": [package], "qos": qos}
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    answer = system.call("POST", "/v1/deliveries", key=key, body=body)
    assert answer.status_code == 202, answer.text
    accepted = answer.json()
    return str(accepted["delivery_id"]), str(accepted["tracking_url"])
