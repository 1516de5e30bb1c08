"""Changing what was said about a delivery, until the hand-over; and erasing it at any time."""

import asyncio
from typing import Any, Final

import httpx
import pytest

from tests.gateway.whole_gateway import Gateway, make_request

ANA: Final = {"name": "Ana Ruiz", "phone": "+15125550100", "email": "ana@example.org"}


async def change(gateway: Gateway, delivery_id: str, **body: object) -> httpx.Response:
    path = f"/v1/deliveries/{delivery_id}"
    return await gateway.http.patch(path, json=body, headers=gateway.customer)


async def erase(gateway: Gateway, delivery_id: str) -> httpx.Response:
    path = f"/v1/deliveries/{delivery_id}/personal-data"
    return await gateway.http.delete(path, headers=gateway.customer)


async def reported(gateway: Gateway, delivery_id: str, *kinds: str, first: int = 1) -> None:
    for seq, kind in enumerate(kinds, start=first):
        assert (await gateway.report(delivery_id, kind, seq=seq)).status_code == 204


async def changes_of(gateway: Gateway, delivery_id: str) -> list[Any]:
    """The data of its events `delivery.changed`."""
    events = await gateway.events(delivery_id)
    return [each["data"] for each in events if each["type"] == "delivery.changed"]


async def test_a_change_is_shown_and_its_event_names_it(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.accepted(packages=2, reference="order 1", recipient=ANA)

    answer = await change(
        gateway,
        delivery_id,
        reference="order 2",
        instructions="Ring twice.",
        packages=[{"package_id": "p2", "recipient": {"name": "Ben"}}],
    )

    assert answer.status_code == 200, answer.text
    shown = answer.json()
    assert await gateway.get(delivery_id) == shown
    assert (shown["reference"], shown["instructions"]) == ("order 2", "Ring twice.")
    assert (shown["recipient"], shown["packages"][1]["recipient"]["name"]) == (ANA, "Ben")
    assert shown["request"]["reference"] == "order 1", "the request is what was first asked for"
    changed = ["instructions", "packages.p2.recipient", "reference"]
    assert await changes_of(gateway, delivery_id) == [
        {"changed": changed, "reference": "order 2", "request": None}
    ]


async def test_a_contact_keeps_what_the_change_leaves_out(gateway: Gateway) -> None:
    of_p1 = {"package_id": "p1", "recipient": {"name": "Ben", "phone": "+15125550101"}}
    body = make_request(recipient=ANA, sender=ANA)
    body["packages"][0] |= of_p1
    delivery_id = (await gateway.post(body)).json()["delivery_id"]

    await change(gateway, delivery_id, recipient={"phone": None}, sender=None)
    of_p1 = {"package_id": "p1", "recipient": {"name": "Bea"}}
    shown = (await change(gateway, delivery_id, packages=[of_p1])).json()

    assert shown["recipient"] == {**ANA, "phone": None}
    assert shown["sender"] is None
    own = {"name": "Bea", "phone": "+15125550101", "email": None}
    assert shown["packages"][0]["recipient"] == own


async def test_metadata_changes_member_by_member(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted(metadata={"order": "1", "shop": "north"})

    shown = (await change(gateway, delivery_id, metadata={"order": "", "slot": "am"})).json()

    assert shown["metadata"] == {"shop": "north", "slot": "am"}


async def test_a_change_may_not_add_more_than_50_members(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted(metadata={f"k{number}": "v" for number in range(30)})

    answer = await change(
        gateway, delivery_id, metadata={f"m{number}": "v" for number in range(21)}
    )

    assert answer.status_code == 422
    [error] = answer.json()["errors"]
    assert error["field"] == "metadata"
    assert error["detail"].endswith("must have at most 50 members; it would have 51")


@pytest.mark.parametrize("body", [{}, {"instructions": "Ring."}, {"reference": None}])
async def test_what_is_already_so_causes_no_event(gateway: Gateway, body: dict[str, Any]) -> None:
    delivery_id = await gateway.accepted(instructions="Ring.")

    answer = await change(gateway, delivery_id, **body)

    assert answer.status_code == 200
    assert await changes_of(gateway, delivery_id) == []


async def test_a_dry_run_shows_the_change_and_makes_none(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted(recipient=ANA)

    answer = await change(gateway, delivery_id, recipient=None, reference="new", dry_run=True)

    assert (answer.json()["recipient"], answer.json()["reference"]) == (None, "new")
    delivery = await gateway.get(delivery_id)
    assert (delivery["recipient"], delivery["reference"]) == (ANA, None)
    assert await changes_of(gateway, delivery_id) == []


async def test_two_changes_at_the_same_time_both_apply(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.accepted()

    answers = await asyncio.gather(
        *(change(gateway, delivery_id, metadata={f"k{n}": str(n)}) for n in range(6))
    )

    assert {answer.status_code for answer in answers} == {200}
    delivery = await gateway.get(delivery_id)
    assert delivery["metadata"] == {f"k{n}": str(n) for n in range(6)}
    assert len(await changes_of(gateway, delivery_id)) == 6


async def test_a_change_in_the_moment_of_loading_loses_neither(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.planned()
    await reported(gateway, delivery_id, "ACCEPTED")

    answer, report = await asyncio.gather(
        change(gateway, delivery_id, instructions="Ring."),
        gateway.report(delivery_id, "LOADING", seq=2),
    )

    assert (answer.status_code, report.status_code) == (200, 204)
    delivery = await gateway.get(delivery_id)
    assert (delivery["instructions"], delivery["state"]) == ("Ring.", "LOADING")


async def test_a_package_that_is_handed_over_is_not_changed(gateway: Gateway) -> None:
    delivery_id = await gateway.planned(packages=2)
    await reported(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1"])

    late = await change(
        gateway, delivery_id, packages=[{"package_id": "p1", "instructions": "Ring."}]
    )
    other = await change(
        gateway, delivery_id, packages=[{"package_id": "p2", "instructions": "Ring."}]
    )

    assert (late.status_code, late.json()["code"]) == (409, "TOO_LATE")
    assert late.json()["detail"] == "package p1 cannot be changed: it is DELIVERED"
    assert other.status_code == 200


async def test_a_delivery_that_is_over_is_not_changed(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted()
    await gateway.http.post(f"/v1/deliveries/{delivery_id}/cancel", headers=gateway.customer)

    answer = await change(gateway, delivery_id, reference="new")

    assert (answer.status_code, answer.json()["code"]) == (409, "TOO_LATE")
    assert "the delivery is CANCELLED" in answer.json()["detail"]


@pytest.mark.parametrize(
    ("body", "field", "detail"),
    [
        ({"recipient": {"phone": "+15125550100"}}, "recipient.name", "is missing"),
        ({"packages": [{"package_id": "p9"}]}, "packages.0.package_id", "is not a package"),
        ({"metadata": None}, "metadata", "may be left out, but not null"),
        ({"recipient": {"name": None}}, "recipient.name", "may be left out, but not null"),
        ({"provider_id": "prv_1"}, "provider_id", "is not a known field"),
        (
            {"pickup": {"station_id": "bulverde"}},
            "body",
            "cannot change pickup: cancel the delivery, and request another one",
        ),
    ],
)
async def test_a_wrong_change_is_named(
    gateway: Gateway, body: dict[str, Any], field: str, detail: str
) -> None:
    answer = await change(gateway, await gateway.accepted(), **body)

    assert answer.status_code == 422
    [error] = answer.json()["errors"]
    assert error["field"] == field
    assert detail in error["detail"]


async def test_what_is_erased_is_named_and_gone(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.accepted(recipient=ANA, metadata={"order": "1"})

    first = (await erase(gateway, delivery_id)).json()
    again = (await erase(gateway, delivery_id)).json()

    assert first["fields"] == ["metadata", "recipient"]
    assert again == {**first, "fields": []}
    delivery = await gateway.get(delivery_id)
    assert (delivery["recipient"], delivery["metadata"]) == (None, {})
    assert delivery["personal_data_erased_at"] == first["erased_at"] == "2026-03-01T12:00:00Z"


async def test_a_delivery_without_personal_data_has_none_to_erase(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted()

    erased = (await erase(gateway, delivery_id)).json()

    assert erased == {"delivery_id": delivery_id, "erased_at": None, "fields": []}


async def test_a_change_after_an_erasure_is_kept(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted(recipient=ANA)
    await erase(gateway, delivery_id)

    shown = (await change(gateway, delivery_id, instructions="Ring.")).json()

    assert (shown["instructions"], shown["recipient"]) == ("Ring.", None)
    assert shown["personal_data_erased_at"] is None
    assert await gateway.get(delivery_id) == shown


async def test_only_its_customer_and_operators_change_and_erase(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted(recipient=ANA)
    path = f"/v1/deliveries/{delivery_id}"

    async def statuses(headers: dict[str, str]) -> tuple[int, int]:
        changed = await gateway.http.patch(path, json={"reference": "x"}, headers=headers)
        erased = await gateway.http.delete(f"{path}/personal-data", headers=headers)
        return changed.status_code, erased.status_code

    assert await statuses(gateway.other) == (404, 404)
    assert await statuses(gateway.provider) == (403, 403)
    assert (await gateway.get(delivery_id))["recipient"] == ANA
    assert await statuses(gateway.operator) == (200, 200)
