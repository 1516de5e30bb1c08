"""A delivery that another provider flies: it is paid, it sees the recipient, the price stays."""

from datetime import timedelta
from typing import Any, Final

from skyway_gateway.tables import ledger
from skyway_verifier.gateway.rules import RULES
from sqlalchemy import select

from skyway.ids import DroneId, ProviderId
from tests.broken_rules import broken_rules
from tests.gateway.deliveries.proving.proofs import booked_for, make_photo
from tests.gateway.deliveries.proving.test_photos import address_of, picture, upload
from tests.gateway.deliveries.requests.test_change import change
from tests.gateway.deliveries.requests.test_change_request import ELSEWHERE, accepted_offer
from tests.gateway.ledger.paid_world import booked, flown
from tests.gateway.ledger.test_charges import cancelled
from tests.gateway.retention.test_prune_deliveries import days_pass, left, pruning
from tests.gateway.sandbox.played import accepted, played, sandbox_caller, sandbox_request
from tests.gateway.whole_gateway import Gateway, make_request

_PEOPLE: Final[dict[str, Any]] = {"recipient": {"name": "Ana Ruiz", "phone": "+15125550100"}}


async def listed(gateway: Gateway, provider_id: str, key: dict[str, str]) -> list[dict[str, Any]]:
    """What a provider sees of the deliveries that it flies."""
    path = f"/v1/providers/{provider_id}/deliveries"
    answer = await gateway.http.get(path, headers=key)
    assert answer.status_code == 200, answer.text
    found: list[dict[str, Any]] = answer.json()["items"]
    return found


async def key_of_other(gateway: Gateway) -> dict[str, str]:
    """A key of the provider prv_2."""
    body = {"role": "provider", "subject_id": "prv_2"}
    made = await gateway.http.post("/v1/keys", json=body, headers=gateway.operator)
    assert made.status_code == 201, made.text
    return {"Authorization": f"Bearer {made.json()['key']}"}


async def exchanged(gateway: Gateway, delivery_id: str) -> None:
    """Report that a drone of the provider prv_2 flies the booked delivery; it flies it from now."""
    booked = gateway.composition.booked
    other = {"provider_id": ProviderId("prv_2"), "drone_id": DroneId("drn_of_2")}
    mission = booked[delivery_id, 1].model_copy(update=other)
    booked[delivery_id, 1] = mission
    report: dict[str, Any] = {
        "mission": mission.model_copy(update={"state": "QUEUED"}),
        "code": "PROVIDER_CHANGED",
        "detail": "a drone of another provider flies it",
    }
    answer = await gateway.report(delivery_id, "REPLANNED", seq=1, mission_state="QUEUED", **report)
    assert answer.status_code == 204, answer.text


async def exchanges(
    gateway: Gateway, provider_id: str, key: dict[str, str]
) -> list[tuple[str, str]]:
    """The deliveries that came to a provider or left it, the last one first."""
    answer = await gateway.http.get(f"/v1/providers/{provider_id}/exchanges", headers=key)
    assert answer.status_code == 200, answer.text
    return [(each["delivery_id"], each["direction"]) for each in answer.json()["items"]]


async def lines_of(gateway: Gateway) -> dict[str, int]:
    """The sum of each kind of lines of the ledger; all are the provider prv_2's."""
    async with gateway.parts.db.read() as connection:
        lines = (await connection.execute(select(ledger))).all()
    assert {each.provider_id for each in lines} == {"prv_2"}
    return {each.kind: each.amount for each in lines}


async def test_the_provider_that_flies_is_paid_the_agreed_price(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = str(await gateway.accepted())
    await gateway.book_next()
    before = await gateway.get(delivery_id)

    await exchanged(gateway, delivery_id)
    after = await gateway.get(delivery_id)
    await flown(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED", first=2)
    await gateway.report(delivery_id, "DELIVERED", seq=5, package_ids=["p1"])
    await gateway.report(delivery_id, "ENDED", seq=6)

    assert (after["provider_id"], after["missions"][0]["drone_id"]) == ("prv_2", "drn_of_2")
    for name in ("price", "packages", "state"):
        assert after[name] == before[name]
    assert after["missions"][0]["payment_terms"] == before["missions"][0]["payment_terms"]
    [event] = [
        each for each in await gateway.events(delivery_id) if each["type"] == "delivery.replanned"
    ]
    assert (event["data"]["code"], event["data"]["provider_id"]) == ("PROVIDER_CHANGED", "prv_2")
    assert sum((await lines_of(gateway)).values()) == before["price"]["amount"]
    assert await broken_rules(gateway.parts.db, RULES, wall_at=gateway.clock.wall_now()) == []


async def test_the_recipient_is_shown_to_the_provider_that_flies_alone(gateway: Gateway) -> None:
    answer = await gateway.post(make_request(**_PEOPLE))
    delivery_id = answer.json()["delivery_id"]
    await gateway.book_next()
    other = await key_of_other(gateway)
    [seen] = await listed(gateway, "prv_1", gateway.provider)
    assert await listed(gateway, "prv_2", other) == []

    await exchanged(gateway, delivery_id)

    assert await listed(gateway, "prv_1", gateway.provider) == []
    [shown] = await listed(gateway, "prv_2", other)
    assert shown["packages"][0]["recipient"] == seen["packages"][0]["recipient"]
    assert shown["packages"][0]["recipient"]["name"] == "Ana Ruiz"


async def test_a_delivery_whose_provider_has_changed_is_cancelled_on_the_agreed_terms(
    gateway: Gateway,
) -> None:
    delivery_id = str(await gateway.accepted())
    await gateway.book_next()
    await exchanged(gateway, delivery_id)

    await gateway.report(delivery_id, "RELEASED", seq=2, package_ids=["p1"], code="CANCELLED")

    delivery = await gateway.get(delivery_id)
    assert (delivery["state"], delivery["provider_id"]) == ("CANCELLED", "prv_2")
    assert delivery["price"]["amount"] == 0
    assert await broken_rules(gateway.parts.db, RULES, wall_at=gateway.clock.wall_now()) == []


async def test_both_providers_see_what_came_and_what_left_and_nobody_else_does(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    other = await key_of_other(gateway)
    moved, kept = [await gateway.planned() for _ in range(2)]

    await exchanged(gateway, moved)

    assert await exchanges(gateway, "prv_1", gateway.provider) == [(moved, "LEFT")]
    assert await exchanges(gateway, "prv_2", other) == [(moved, "CAME")]
    assert await exchanges(gateway, "prv_2", gateway.operator) == [(moved, "CAME")]
    path = "/v1/providers/prv_{}/exchanges"
    shown = await gateway.http.get(path.format(1), headers=gateway.provider)
    assert "prv_2" not in shown.text
    assert "drn_of_2" not in shown.text
    refused = [
        (await gateway.http.get(path.format(number), headers=who)).status_code
        for number, who in ((1, other), (2, gateway.provider), (1, gateway.customer))
    ]
    assert refused == [404, 404, 403]
    assert kept not in shown.text


async def test_a_delivery_is_deleted_with_its_exchanges(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.planned()
    await exchanged(gateway, delivery_id)
    await flown(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED", first=2)
    await gateway.report(delivery_id, "DELIVERED", seq=5, package_ids=["p1"])
    await days_pass(gateway)

    await pruning(gateway).step()

    assert await left(gateway) == set()
    assert await exchanges(gateway, "prv_1", gateway.operator) == []


async def test_a_pin_and_a_photo_are_given_to_the_drone_of_the_new_provider(
    gateway: Gateway,
) -> None:
    recipient = await booked_for(gateway, {"method": "PIN", "pin": "4711"}, {"method": "PHOTO"})
    other = await key_of_other(gateway)
    await exchanged(gateway, recipient.delivery_id)
    recipient.reports = 1
    for kind in ("ACCEPTED", "LOADING", "LOADED"):
        await recipient.report(kind)

    await recipient.drone_waits("p1", "p2")
    given = await recipient.gives(pin="4711")
    photo = await upload(gateway, address_of(gateway, recipient), make_photo())
    await recipient.report("DELIVERED", package_ids=["p1"])
    [_, second] = (await gateway.get(recipient.delivery_id))["packages"]
    place = second["destination"]["station_id"]
    await gateway.report(
        recipient.delivery_id, "DELIVERED", seq=7, package_ids=["p2"], station_id=place
    )

    assert (given, photo) == (204, 204)
    assert {*await recipient.messages()} == {'{"package_id":"p1"}', '{"package_id":"p2"}'}
    assert (await gateway.get(recipient.delivery_id))["state"] == "COMPLETED"
    seen = [
        await picture(gateway, recipient, who, package_id="p2")
        for who in (gateway.customer, other, gateway.provider)
    ]
    assert seen == [200, 200, 404]
    assert await gateway.broken() == []


async def test_the_new_provider_pays_for_its_lateness_on_the_agreed_terms(
    gateway: Gateway,
) -> None:
    delivery_id = await booked(gateway)
    await exchanged(gateway, delivery_id)
    await flown(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED", first=2)
    due_at = gateway.composition.booked[delivery_id, 1].packages[0].eta_at

    gateway.clock.advance(due_at + timedelta(minutes=15) - gateway.clock.now())
    await gateway.report(delivery_id, "DELIVERED", seq=5, package_ids=["p1"])

    assert await lines_of(gateway) == {"BASE": 500, "DISTANCE": 734, "LATENESS": -123}
    assert await gateway.broken() == []


async def test_a_delivery_that_is_cancelled_in_flight_pays_the_new_provider_its_share(
    gateway: Gateway,
) -> None:
    delivery_id = await booked(gateway)
    await exchanged(gateway, delivery_id)
    await flown(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED", first=2)

    gateway.composition.loaded = {"p1"}
    await cancelled(gateway, delivery_id)
    back: dict[str, Any] = {"package_ids": ["p1"], "code": "CANCELLED"}
    await gateway.report(delivery_id, "RETURNING", seq=5, **back)
    await gateway.report(delivery_id, "RETURNED", seq=6, station_id="san-marcos", **back)

    assert (await gateway.get(delivery_id))["state"] == "CANCELLED"
    assert sum((await lines_of(gateway)).values()) == 1234 - 247
    assert await gateway.broken() == []


async def test_a_changed_request_is_booked_anew_with_the_accepted_provider(
    gateway: Gateway,
) -> None:
    """What was exchanged was the old mission: the change withdraws it."""
    delivery_id = await accepted_offer(gateway, qos={"may_change_provider": True})
    await gateway.book_next()
    await exchanged(gateway, delivery_id)
    assert (await gateway.get(delivery_id))["provider_id"] == "prv_2"
    assert await gateway.broken() == []

    answer = await change(gateway, delivery_id, packages=[ELSEWHERE])
    while await gateway.book_next():
        pass

    assert answer.status_code == 200, answer.text
    delivery = await gateway.get(delivery_id)
    assert (delivery["state"], delivery["attempt"]) == ("PLANNED", 2)
    assert delivery["provider_id"] == "prv_1"
    [asked] = [each for each in gateway.composition.asked if each.attempt == 2]
    assert asked.offer is not None
    assert {each.provider_id for each in asked.shortlist.candidates} == {"prv_1"}
    assert await exchanges(gateway, "prv_1", gateway.provider) == [(delivery_id, "LEFT")]
    assert await gateway.broken() == []


async def test_a_test_delivery_is_never_exchanged(gateway: Gateway) -> None:
    """No composition knows it, so no dispatcher finds it, although its customer allows it."""
    headers = await sandbox_caller(gateway)
    gateway.peers.seen.clear()

    asked = sandbox_request() | {"qos": {"may_change_provider": True}}
    delivery = await played(gateway, headers, await accepted(gateway, headers, asked))

    assert delivery["state"] == "COMPLETED"
    assert (gateway.peers.seen, gateway.composition.asked) == ([], [])
    flown_by = {each["provider_id"] for each in delivery["missions"]}
    assert not flown_by & {"prv_1", "prv_2"}
    for provider_id in ("prv_1", "prv_2", *flown_by):
        assert await exchanges(gateway, provider_id, gateway.operator) == []


async def test_another_customer_neither_allows_an_exchange_nor_sees_one(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    await exchanged(gateway, delivery_id)
    path = f"/v1/deliveries/{delivery_id}"

    allowed = await gateway.http.patch(
        path, json={"qos": {"may_change_provider": True}}, headers=gateway.other
    )
    seen = [
        (await gateway.http.get(f"{path}{each}", headers=gateway.other)).status_code
        for each in ("", "/events", "/plan", "/track")
    ]

    assert allowed.status_code == 404
    assert seen == [404, 404, 404, 404]
    assert (await gateway.get(delivery_id))["request"]["qos"]["may_change_provider"] is False
