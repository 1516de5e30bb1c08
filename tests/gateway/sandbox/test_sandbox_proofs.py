"""Proofs of hand-overs in the sandbox: the recipient gives them, or the packages come back."""

from datetime import timedelta
from typing import Any

from skyway_gateway.sandbox.sandbox_composition import PROOF_WAIT

from tests.gateway.sandbox.played import (
    accepted,
    played,
    sandbox_caller,
    sandbox_request,
    shown,
    step,
)
from tests.gateway.whole_gateway import Gateway


def pin_request(**changes: Any) -> dict[str, Any]:
    body = sandbox_request(**changes)
    body["packages"][0]["dropoff_verification"] = {"method": "PIN", "pin": "4711"}
    return body


async def awaited(gateway: Gateway, headers: dict[str, str], body: dict[str, Any]) -> str:
    """The id of a delivery whose drone waits for the proof."""
    delivery_id = await accepted(gateway, headers, body)
    for _ in range(30):
        if "proof_wait" in (await shown(gateway, headers, delivery_id))["packages"][0]:
            return delivery_id
        await step(gateway)
    raise AssertionError("no drone waits for a proof")


async def vouch(gateway: Gateway, headers: dict[str, str], delivery_id: str) -> int:
    path = f"/v1/deliveries/{delivery_id}/packages/p1/proof"
    return (await gateway.http.post(path, headers=headers)).status_code


async def test_a_package_with_its_proof_is_delivered(gateway: Gateway) -> None:
    headers = await sandbox_caller(gateway)
    delivery_id = await awaited(gateway, headers, pin_request())

    assert await vouch(gateway, headers, delivery_id) < 300

    delivery = await played(gateway, headers, delivery_id)
    assert delivery["state"] == "COMPLETED"
    assert gateway.composition.booking_count == 0


async def test_a_drone_waits_a_minute_for_a_proof(gateway: Gateway) -> None:
    headers = await sandbox_caller(gateway)
    delivery_id = await awaited(gateway, headers, pin_request())

    gateway.clock.advance(PROOF_WAIT - timedelta(seconds=2))
    await step(gateway)
    waiting = await shown(gateway, headers, delivery_id)
    gateway.clock.advance(timedelta(seconds=2))
    delivery = await played(gateway, headers, delivery_id)

    assert waiting["packages"][0]["state"] == "IN_TRANSIT"
    assert (delivery["state"], delivery["packages"][0]["code"]) == ("FAILED", "RECIPIENT_ABSENT")


async def test_after_five_wrong_pins_the_package_comes_back(gateway: Gateway) -> None:
    headers = await sandbox_caller(gateway)
    delivery_id = await awaited(gateway, headers, pin_request(reference="test_wrong_pin"))

    delivery = await played(gateway, headers, delivery_id)

    assert delivery["packages"][0]["dropoff_proof"]["wrong_pins"] == 5
    assert delivery["state"] == "FAILED"
