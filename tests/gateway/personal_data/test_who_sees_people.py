"""Personal data is seen by those whom decision 0051 names, and stored in one table alone."""

import json
from collections.abc import Mapping
from typing import Any, Final

import pytest
from skyway_gateway.tables import metadata

from tests.gateway.whole_gateway import Gateway, make_request

RECIPIENT: Final = {"name": "Ana Ruiz", "phone": "+15125550100", "email": "ana@example.org"}
SENDER: Final = {"name": "River Books", "phone": "+15125550199", "email": "shop@example.org"}
PEOPLE: Final[Mapping[str, Any]] = {
    "recipient": RECIPIENT,
    "sender": SENDER,
    "instructions": "The key is below the blue pot.",
    "metadata": {"order": "for Ana Ruiz"},
}
#: What must not be found elsewhere.
TRACES: Final = ("Ana", "+1512", "example.org", "River", "blue pot", "Ben Low")


def with_people() -> dict[str, Any]:
    """A request for two packages, of which the second has its own recipient."""
    body = make_request(packages=2, **PEOPLE)
    body["packages"][1] |= {"recipient": {"name": "Ben Low"}}
    return body


async def requested(gateway: Gateway) -> str:
    answer = await gateway.post(with_people(), **{"Idempotency-Key": "once"})
    assert answer.status_code == 202, answer.text
    return str(answer.json()["delivery_id"])


async def flown(gateway: Gateway, delivery_id: str) -> None:
    """Fly the delivery to its end."""
    while await gateway.book_next():
        pass
    for seq, kind in enumerate(("ACCEPTED", "LOADING", "LOADED"), start=1):
        await gateway.report(delivery_id, kind, seq=seq)
    await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1", "p2"])
    await gateway.report(delivery_id, "ENDED", seq=5)


async def seen_by_provider(gateway: Gateway) -> dict[str, Any]:
    path = "/v1/providers/prv_1/deliveries"
    answer = await gateway.http.get(path, headers=gateway.provider)
    [seen] = answer.json()["items"]
    found: dict[str, Any] = seen
    return found


async def test_the_customer_reads_what_it_wrote(gateway: Gateway) -> None:
    delivery = await gateway.get(await requested(gateway))

    assert {name: delivery[name] for name in PEOPLE} == PEOPLE
    first, second = delivery["packages"]
    assert (first["recipient"], second["recipient"]["name"]) == (None, "Ben Low")
    assert delivery["personal_data_erased_at"] is None


async def test_an_accepted_offer_takes_the_same_details(gateway: Gateway) -> None:
    body = make_request(packages=2)
    quote = (await gateway.http.post("/v1/quotes", json=body, headers=gateway.customer)).json()
    choice = {"quote_id": quote["quote_id"], "offer_id": quote["offers"][0]["offer_id"], **PEOPLE}
    unknown = await gateway.post({**choice, "packages": [{"package_id": "p9"}]})
    of_p2 = [{"package_id": "p2", "instructions": "Ring."}]

    accepted = await gateway.post({**choice, "packages": of_p2})

    assert unknown.json()["errors"][0]["field"] == "packages.0.package_id"
    delivery = await gateway.get(accepted.json()["delivery_id"])
    assert delivery["recipient"] == RECIPIENT
    assert delivery["packages"][1]["instructions"] == "Ring."


async def test_a_quote_takes_no_personal_data(gateway: Gateway) -> None:
    answer = await gateway.http.post("/v1/quotes", json=with_people(), headers=gateway.customer)

    assert answer.status_code == 422
    assert {each["detail"] for each in answer.json()["errors"]} == {"is not a known field"}


async def test_a_provider_sees_people_while_it_flies_for_them(gateway: Gateway) -> None:
    delivery_id = await requested(gateway)
    while await gateway.book_next():
        pass

    seen = await seen_by_provider(gateway)

    assert seen["sender"] == {**SENDER, "email": None}
    assert seen["packages"][0]["recipient"] == {**RECIPIENT, "email": None}
    assert seen["packages"][1]["recipient"]["name"] == "Ben Low"
    assert {each["instructions"] for each in seen["packages"]} == {PEOPLE["instructions"]}
    assert "metadata" not in seen
    await flown(gateway, delivery_id)
    over = json.dumps(await seen_by_provider(gateway))
    assert not [each for each in TRACES if each in over]


async def test_a_provider_sees_nobody_of_a_package_that_it_has_handed_over(
    gateway: Gateway,
) -> None:
    delivery_id = await requested(gateway)
    while await gateway.book_next():
        pass
    for seq, kind in enumerate(("ACCEPTED", "LOADING", "LOADED"), start=1):
        await gateway.report(delivery_id, kind, seq=seq)

    await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1"])

    first, second = (await seen_by_provider(gateway))["packages"]
    assert (first["recipient"], first["instructions"]) == (None, None)
    assert second["recipient"]["name"] == "Ben Low"


async def test_no_other_table_and_no_message_has_any_of_it(gateway_on_both: Gateway) -> None:
    """Not the events, the outbox, what composition is asked, nor the audit log."""
    gateway = gateway_on_both
    delivery_id = await requested(gateway)
    path = f"/v1/deliveries/{delivery_id}"
    change = {"instructions": "Not below the blue pot.", "recipent": {"name": "Ana"}}
    await gateway.http.patch(path, json=change, headers=gateway.operator)
    del change["recipent"]
    await gateway.http.patch(path, json=change, headers=gateway.operator)
    await gateway.http.post("/v1/deliveries", json=with_people(), headers=gateway.operator)
    await flown(gateway, delivery_id)

    found = []
    async with gateway.parts.db.read() as connection:
        for table in metadata.sorted_tables:
            if table.name != "personal_data":
                rows = (await connection.execute(table.select())).all()
                found += [table.name for row in rows for each in TRACES if each in str(row)]
    asked = " ".join(each.model_dump_json() for each in gateway.composition.asked)
    assert found == []
    assert not [each for each in TRACES if each in asked]


async def test_the_audit_log_keeps_what_is_not_personal(gateway: Gateway) -> None:
    await gateway.http.post("/v1/deliveries", json=with_people(), headers=gateway.operator)
    cut = make_request(instructions="x" * 5000)
    await gateway.http.post("/v1/deliveries", json=cut, headers=gateway.operator)

    log = await gateway.http.get("/v1/audit", headers=gateway.operator)

    too_long, whole = (each["body"] for each in log.json()["items"])
    assert too_long == "***"
    whole = json.loads(whole)
    assert whole["packages"][1] == {**with_people()["packages"][1], "recipient": "***"}
    assert whole["instructions"] == whole["metadata"] == "***"


@pytest.mark.parametrize("path", ["/v1/deliveries", "/v1/deliveries/{}/plan"])
async def test_lists_and_answers_that_are_stored_leave_it_out(gateway: Gateway, path: str) -> None:
    delivery_id = await requested(gateway)
    again = await gateway.post(with_people(), **{"Idempotency-Key": "once"})

    listed = await gateway.http.get(path.format(delivery_id), headers=gateway.customer)

    for answer in (again, listed):
        assert answer.is_success
        assert not [each for each in TRACES if each in answer.text]


async def test_a_tracking_page_shows_nobody(gateway: Gateway) -> None:
    answer = await gateway.post(with_people())
    path = answer.json()["tracking_url"].removeprefix("http://gateway")

    shown = await gateway.http.get(f"{path}/state")

    assert shown.is_success
    assert not [each for each in TRACES if each in shown.text]
