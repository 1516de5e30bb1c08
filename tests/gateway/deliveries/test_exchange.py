"""A delivery that another provider flies: it is paid, it sees the recipient, the price stays."""

from typing import Any, Final

from skyway_gateway.tables import ledger
from skyway_verifier.gateway.rules import RULES
from sqlalchemy import select

from skyway.ids import DroneId, ProviderId
from tests.broken_rules import broken_rules
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


async def exchanged(gateway: Gateway, delivery_id: str) -> dict[str, Any]:
    """Report that a drone of the provider prv_2 flies the booked delivery; returns what to send."""
    mission = gateway.composition.booked[delivery_id, 1]
    other = {"provider_id": ProviderId("prv_2"), "drone_id": DroneId("drn_of_2")}
    of_other: dict[str, Any] = {
        **other,
        "mission": mission.model_copy(update={**other, "state": "QUEUED"}),
    }
    why: dict[str, Any] = {
        "code": "PROVIDER_CHANGED",
        "detail": "a drone of another provider flies it",
    }
    answer = await gateway.report(
        delivery_id, "REPLANNED", seq=1, mission_state="QUEUED", **of_other, **why
    )
    assert answer.status_code == 204, answer.text
    return other


async def test_the_provider_that_flies_is_paid_the_agreed_price(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = str(await gateway.accepted())
    await gateway.book_next()
    before = await gateway.get(delivery_id)

    other = await exchanged(gateway, delivery_id)
    after = await gateway.get(delivery_id)
    for seq, kind in enumerate(("ACCEPTED", "LOADING", "LOADED"), start=2):
        await gateway.report(delivery_id, kind, seq=seq, **other)
    await gateway.report(delivery_id, "DELIVERED", seq=5, package_ids=["p1"], **other)
    await gateway.report(delivery_id, "ENDED", seq=6, **other)

    assert (after["provider_id"], after["missions"][0]["drone_id"]) == ("prv_2", "drn_of_2")
    for name in ("price", "packages", "state"):
        assert after[name] == before[name]
    assert after["missions"][0]["payment_terms"] == before["missions"][0]["payment_terms"]
    [event] = [
        each for each in await gateway.events(delivery_id) if each["type"] == "delivery.replanned"
    ]
    assert (event["data"]["code"], event["data"]["provider_id"]) == ("PROVIDER_CHANGED", "prv_2")
    async with gateway.parts.db.read() as connection:
        lines = (await connection.execute(select(ledger))).all()
    assert {each.provider_id for each in lines} == {"prv_2"}
    assert sum(each.amount for each in lines) == before["price"]["amount"]
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
    other = await exchanged(gateway, delivery_id)

    await gateway.report(
        delivery_id, "RELEASED", seq=2, package_ids=["p1"], code="CANCELLED", **other
    )

    delivery = await gateway.get(delivery_id)
    assert (delivery["state"], delivery["provider_id"]) == ("CANCELLED", "prv_2")
    assert delivery["price"]["amount"] == 0
    assert await broken_rules(gateway.parts.db, RULES, wall_at=gateway.clock.wall_now()) == []
