"""Proofs of hand-overs: typed, signed, typed at the drone's box, or said by the customer."""

import asyncio
from datetime import timedelta
from typing import Any

import httpx
import pytest

from skyway.delivery.payment_terms import PaymentTerms, WaitingTerms
from tests.gateway.deliveries.proving.proofs import WAIT, asking, proof_of, recipient_of
from tests.gateway.whole_gateway import Gateway

PIN = {"method": "PIN", "pin": "4711"}
SIGNED = {"method": "SIGNATURE"}
NAME = {"name": "Ada <Lovelace>"}


async def test_a_pin_of_six_digits_is_made_for_who_gives_none(gateway: Gateway) -> None:
    recipient = await recipient_of(gateway, {"method": "PIN"})

    shown = (await recipient.package())["dropoff_proof"]

    assert len(shown["pin"]) == 6
    assert shown["pin"].isdigit()
    assert await proof_of(gateway, recipient.delivery_id) == shown


@pytest.mark.parametrize(
    ("verification", "at_fault"),
    [
        ({"method": "PIN", "pin": "123"}, "pin"),
        ({"method": "PIN", "pin": "123456789"}, "pin"),
        ({"method": "PIN", "pin": "12a4"}, "pin"),
        ({"method": "PIN", "pin": "１２３４"}, "pin"),
        ({"method": "PHOTO", "pin": "1234"}, "pin"),
        ({"method": "PIN", "wait_s": 901}, "wait_s"),
        ({"method": "SECRET"}, "method"),
    ],
)
async def test_a_proof_that_breaks_a_limit_is_refused(
    gateway: Gateway, verification: dict[str, object], at_fault: str
) -> None:
    answer = await gateway.post(asking(verification))

    assert answer.status_code == 422
    assert f"dropoff_verification.{at_fault}" in answer.text or at_fault in answer.json()["detail"]


async def test_composition_is_notified_of_the_right_pin_once(gateway_on_both: Gateway) -> None:
    recipient = await recipient_of(gateway_on_both, PIN)
    assert await recipient.gives(pin="4711") == 409  # the drone is not there
    await recipient.drone_waits()

    statuses = [await recipient.gives(pin="4711") for _ in range(2)]

    assert statuses == [204, 204]
    assert await recipient.messages() == ['{"package_id":"p1"}']
    proof = await proof_of(gateway_on_both, recipient.delivery_id)
    assert (proof["given_by"], proof["pin"]) == ("RECIPIENT", None)


async def test_five_wrong_pins_lock_the_proof_also_when_they_come_together(
    gateway_on_both: Gateway,
) -> None:
    recipient = await recipient_of(gateway_on_both, PIN)
    await recipient.drone_waits()

    guesses = await asyncio.gather(*(recipient.gives(pin=f"{each}") for each in range(12)))

    assert sorted(guesses) == [409] * 7 + [422] * 5
    assert await recipient.gives(pin="4711") == 409
    assert (await recipient.package())["dropoff_proof"]["wrong_pins"] == 5
    assert await recipient.messages() == []


async def test_the_customer_vouches_for_a_recipient_who_is_locked_out(gateway: Gateway) -> None:
    recipient = await recipient_of(gateway, PIN)
    await recipient.drone_waits()
    for guess in range(5):
        await recipient.gives(pin=f"{guess}")
    path = f"/v1/deliveries/{recipient.delivery_id}/packages/p1/proof"

    answers = [
        await gateway.http.post(path, headers=who)
        for who in (gateway.other, gateway.provider, gateway.customer)
    ]

    assert [answer.status_code for answer in answers] == [404, 403, 200]
    assert answers[2].json()["given_by"] == "CUSTOMER"
    assert await recipient.messages() == ['{"package_id":"p1"}']


async def test_nobody_gives_proof_to_a_drone_that_has_left(gateway: Gateway) -> None:
    recipient = await recipient_of(gateway, PIN)
    await recipient.drone_waits()
    path = f"/v1/deliveries/{recipient.delivery_id}/packages/p1/proof"

    gateway.clock.advance(WAIT + timedelta(seconds=1))

    assert await recipient.gives(pin="4711") == 409
    assert (await gateway.http.post(path, headers=gateway.customer)).status_code == 409
    assert (await recipient.package())["proof_until_at"] is None


async def test_a_pin_typed_at_the_box_counts_like_one_on_the_page(
    gateway_on_both: Gateway,
) -> None:
    recipient = await recipient_of(gateway_on_both, PIN, {"method": "PIN", "pin": "0815"})
    await recipient.drone_waits("p1", "p2")

    await recipient.report("PIN_ENTERED", package_ids=["p1", "p2"], pin="9999")
    await recipient.report("PIN_ENTERED", package_ids=["p1", "p2"], pin="0815")

    first, second = [(await recipient.package(number))["dropoff_proof"] for number in (0, 1)]
    assert (first["given_by"], first["wrong_pins"]) == (None, 1)
    assert (second["given_by"], second["wrong_pins"]) == ("KEYPAD", 1)
    assert await recipient.messages() == ['{"package_id":"p2"}']


async def test_composition_is_notified_of_a_proof_again_when_a_drone_waits_again(
    gateway: Gateway,
) -> None:
    recipient = await recipient_of(gateway, PIN)
    await recipient.drone_waits()
    await recipient.gives(pin="4711")

    await recipient.drone_waits()

    assert await recipient.messages() == ['{"package_id":"p1"}'] * 2


async def test_a_signature_is_kept_as_a_picture_without_the_markup_of_its_name(
    gateway: Gateway,
) -> None:
    recipient = await recipient_of(gateway, SIGNED)
    await recipient.drone_waits()

    assert await recipient.gives(pin="4711") == 422
    assert await recipient.gives(signature=NAME) == 204

    picture = await gateway.http.get(f"{recipient.path}/packages/p1/picture")
    assert picture.headers["content-type"] == "image/svg+xml"
    assert "sandbox" in picture.headers["content-security-policy"]
    assert picture.headers["x-content-type-options"] == "nosniff"
    assert "Ada &lt;Lovelace&gt;" in picture.text


async def test_a_signature_of_a_million_points_is_refused(gateway: Gateway) -> None:
    recipient = await recipient_of(gateway, SIGNED)
    await recipient.drone_waits()

    statuses = [
        await recipient.gives(signature={"strokes": [[[1, 2]] * points]})
        for points in (2_001, 10**5)
    ]

    assert statuses == [422, 413]


async def test_the_event_and_lists_name_the_method_and_no_pin(gateway: Gateway) -> None:
    recipient = await recipient_of(gateway, PIN)
    await recipient.drone_waits()

    [event] = [
        each
        for each in await gateway.events(recipient.delivery_id)
        if each["type"] == "delivery.proof_awaited"
    ]

    assert event["data"]["packages"] == [{"package_id": "p1", "method": "PIN"}]
    listed = await gateway.http.get("/v1/deliveries", headers=gateway.customer)
    everything = f"{await gateway.events(recipient.delivery_id)} {listed.text}"
    assert "4711" not in everything
    assert "4711" not in str(gateway.composition.booked)


async def test_the_provider_sees_the_proof_without_its_pin(gateway: Gateway) -> None:
    recipient = await recipient_of(gateway, PIN)
    path = f"/v1/deliveries/{recipient.delivery_id}/packages/p1/proof"

    answers = [
        (await gateway.http.get(path, headers=who)).json()
        for who in (gateway.customer, gateway.provider)
    ]

    assert [answer["pin"] for answer in answers] == ["4711", None]
    hidden = await gateway.http.get(path, headers=gateway.other)
    assert hidden.status_code == 404


async def test_a_link_gets_no_more_tries_than_its_budget(
    gateway: Gateway,
) -> None:
    recipient = await recipient_of(gateway, SIGNED)

    statuses = [await recipient.gives(signature=NAME) for _ in range(22)]

    assert set(statuses) == {409, 429}
    assert statuses[:20] == [409] * 20


async def test_a_pin_leaves_when_its_package_comes_back(gateway: Gateway) -> None:
    recipient = await recipient_of(gateway, PIN)
    await recipient.drone_waits()
    await recipient.report("RETURNING", package_ids=["p1"], code="RECIPIENT_ABSENT")

    await gateway.parts.photos.erase_due()

    assert (await recipient.package())["dropoff_proof"]["pin"] is None


@pytest.mark.parametrize(
    ("waited_s", "paid"), [(0, 0), (60, 0), (61, 50), (119, 50), (120, 50), (500, 50)]
)
async def test_a_drone_that_waits_is_paid_after_the_free_minute_and_up_to_the_wait(
    gateway: Gateway, waited_s: int, paid: int
) -> None:
    terms = PaymentTerms(waiting=WaitingTerms(free_min=1, per_min=50))
    gateway.composition.priced = {"payment_terms": terms}
    recipient = await recipient_of(gateway, PIN)
    await recipient.drone_waits()
    await recipient.gives(pin="4711")
    gateway.clock.advance(timedelta(seconds=waited_s))

    await recipient.report("DELIVERED", package_ids=["p1"])

    price = (await gateway.get(recipient.delivery_id))["price"]
    assert price["amount"] == 1234 + paid
    assert price["line_items"][1:] == ([{"kind": "WAITING", "amount": paid}] if paid else [])


async def test_another_pin_is_a_change_of_the_customer_until_the_proof_is_given(
    gateway: Gateway,
) -> None:
    recipient = await recipient_of(gateway, PIN)
    await recipient.drone_waits()
    await recipient.gives(pin="1111")
    path = f"/v1/deliveries/{recipient.delivery_id}"

    async def patch(change: object) -> httpx.Response:
        body = {"packages": [{"package_id": "p1", "dropoff_verification": change}]}
        return await gateway.http.patch(path, json=body, headers=gateway.customer)

    refused = [(await patch(each)).status_code for each in (None, {"method": "SIGNATURE"})]
    assert refused == [409, 409]
    changed = await patch({"pin": "9999"})

    assert changed.status_code == 200, changed.text
    proof = changed.json()["packages"][0]["dropoff_proof"]
    assert (proof["pin"], proof["wrong_pins"]) == ("9999", 0)
    [event] = [
        each
        for each in await gateway.events(recipient.delivery_id)
        if each["type"] == "delivery.changed"
    ]
    assert event["data"]["changed"] == ["packages.p1.dropoff_verification.pin"]
    assert await recipient.gives(pin="4711") == 422
    assert await recipient.gives(pin="9999") == 204
    assert (await patch({"pin": "1234"})).status_code == 409


async def test_a_scheduled_delivery_gets_another_proof_or_none(gateway: Gateway) -> None:
    later = (gateway.clock.now() + timedelta(days=3)).isoformat()
    answer = await gateway.post({**asking(PIN), "earliest_pickup_at": later})
    path = f"/v1/deliveries/{answer.json()['delivery_id']}"

    async def patch(change: object) -> Any:
        body = {"packages": [{"package_id": "p1", "dropoff_verification": change}]}
        answer = await gateway.http.patch(path, json=body, headers=gateway.customer)
        assert answer.status_code == 200, answer.text
        return answer.json()["packages"][0]["dropoff_proof"]

    longer = await patch({"wait_s": 300})
    signed = await patch({"method": "SIGNATURE"})

    assert [each["pin"] for each in (longer, signed)] == ["4711", None]
    assert signed["method"] == "SIGNATURE"
    assert await patch(None) is None
