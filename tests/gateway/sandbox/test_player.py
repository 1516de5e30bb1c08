"""The player: late packages, cancellations, kills, and two replicas."""

import asyncio
from dataclasses import replace
from datetime import timedelta

import pytest
from skyway_gateway.retention.pruning import DeliveryPruning
from skyway_gateway.retention.store import OF_TEST_ACCOUNTS
from skyway_gateway.sandbox.outcomes import OUTCOMES, Outcome

from skyway.contracts.mission_reports import MissionReport
from tests.gateway.sandbox.played import (
    accepted,
    played,
    request_for,
    sandbox_caller,
    sandbox_request,
    shown,
    step,
)
from tests.gateway.whole_gateway import Gateway
from tests.long_cases import sampled


@pytest.mark.parametrize("outcome", sampled(OUTCOMES, every=4), ids=lambda each: each.name)
async def test_a_station_forces_its_outcome_too(gateway: Gateway, outcome: Outcome) -> None:
    headers = await sandbox_caller(gateway)
    now = gateway.clock.now() + timedelta(minutes=20)
    qos = {"deadline_at": now.isoformat()} if outcome.name == "busy" else {}
    body = request_for(outcome, destination=outcome.station_id, qos=qos)
    delivery_id = await accepted(gateway, headers, body)
    if outcome.name == "busy":
        await step(gateway)
        assert (await shown(gateway, headers, delivery_id))["state"] == "REQUESTED"
        gateway.clock.advance(timedelta(minutes=21))

    assert (await played(gateway, headers, delivery_id))["state"] == outcome.ends_as


async def test_a_late_package_is_refunded_in_the_statement(gateway: Gateway) -> None:
    headers = await sandbox_caller(gateway)
    delivery_id = await accepted(gateway, headers, sandbox_request(reference="test_late"))
    await played(gateway, headers, delivery_id)

    answer = await gateway.http.get("/v1/statements/lines", headers=headers)

    amounts = {each["kind"]: each["amount"] for each in answer.json()["items"]}
    assert amounts["LATENESS"] < 0
    assert "delivery.delayed" in await gateway.event_types(delivery_id)


async def test_a_refused_mission_is_flown_by_another_drone(gateway: Gateway) -> None:
    headers = await sandbox_caller(gateway)
    delivery_id = await accepted(gateway, headers, sandbox_request(reference="test_refused"))

    found = await played(gateway, headers, delivery_id)

    [refusal] = found["refusals"]
    assert refusal["drone_id"] != found["missions"][0]["drone_id"]


async def test_a_reference_of_no_outcome_is_refused(gateway: Gateway) -> None:
    headers = await sandbox_caller(gateway)
    body = sandbox_request(reference="test_lat")

    answers = [
        await gateway.http.post(path, json=body, headers=headers)
        for path in ("/v1/quotes", "/v1/deliveries")
    ]

    assert {each.status_code for each in answers} == {422}
    assert "test_late" in answers[0].text


@pytest.mark.parametrize("steps", sampled(range(10), every=3))
async def test_a_cancellation_at_any_moment_settles_the_package(
    gateway: Gateway, steps: int
) -> None:
    headers = await sandbox_caller(gateway)
    delivery_id = await accepted(gateway, headers, sandbox_request())
    for _ in range(steps):
        await step(gateway)

    answer = await gateway.http.post(f"/v1/deliveries/{delivery_id}/cancel", headers=headers)
    found = await played(gateway, headers, delivery_id)

    ends = {200: "CANCELLED", 409: "COMPLETED"}
    assert found["state"] == ends[answer.status_code]


@pytest.mark.parametrize(("steps", "status"), [(1, 200), (4, 409)])
async def test_a_booked_delivery_goes_elsewhere_until_a_drone_has_it(
    gateway: Gateway, steps: int, status: int
) -> None:
    headers = await sandbox_caller(gateway)
    delivery_id = await accepted(gateway, headers, sandbox_request())
    for _ in range(steps):
        await step(gateway)

    change = {"packages": [{"package_id": "p1", "destination": {"station_id": "clinic"}}]}
    answer = await gateway.http.patch(f"/v1/deliveries/{delivery_id}", json=change, headers=headers)
    found = await played(gateway, headers, delivery_id)

    assert answer.status_code == status, answer.text
    ends = {200: "clinic", 409: "library"}
    assert found["packages"][0]["custodian"] == {"kind": "RECIPIENT", "id": ends[status]}


async def test_one_of_two_packages_is_cancelled_and_the_other_delivered(gateway: Gateway) -> None:
    headers = await sandbox_caller(gateway)
    body = sandbox_request()
    body["packages"].append(
        {"package_id": "p2", "mass_kg": 1.0, "destination": {"station_id": "clinic"}}
    )
    delivery_id = await accepted(gateway, headers, body)
    for _ in range(6):
        await step(gateway)

    await gateway.http.post(
        f"/v1/deliveries/{delivery_id}/cancel", json={"package_ids": ["p1"]}, headers=headers
    )
    for _ in range(10):
        await step(gateway)
    found = await shown(gateway, headers, delivery_id)

    assert [each["state"] for each in found["packages"]] == ["RETURNED", "DELIVERED"]


async def test_a_kill_before_a_report_is_applied_loses_nothing(gateway: Gateway) -> None:
    headers = await sandbox_caller(gateway)
    delivery_id = await accepted(gateway, headers, sandbox_request())
    while await gateway.book_next():
        pass

    async def killed(_report: MissionReport) -> None:
        raise asyncio.CancelledError

    gateway.clock.advance(timedelta(seconds=1))
    for _ in range(3):
        gateway.clock.advance(timedelta(seconds=0.5))
        with pytest.raises(asyncio.CancelledError):
            await replace(gateway.parts.player, apply=killed).step()

    assert (await played(gateway, headers, delivery_id))["state"] == "COMPLETED"


async def test_two_replicas_play_each_report_once(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    headers = await sandbox_caller(gateway)
    delivery_id = await accepted(gateway, headers, sandbox_request())
    while await gateway.book_next():
        pass

    for _ in range(14):
        gateway.clock.advance(timedelta(seconds=0.5))
        await asyncio.gather(gateway.parts.player.step(), gateway.parts.player.step())

    types = await gateway.event_types(delivery_id)
    assert len(types) == len(set(types))
    assert types[-1] == "delivery.completed"


async def test_test_deliveries_are_deleted_after_a_week(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    headers = await sandbox_caller(gateway)
    delivery_id = await accepted(gateway, headers, sandbox_request())
    await played(gateway, headers, delivery_id)
    live_id = await gateway.planned()
    gateway.clock.advance(timedelta(days=8))
    parts = gateway.parts
    pruning = DeliveryPruning(
        parts.db,
        parts.flown_by,
        gateway.clock,
        "one",
        kept=timedelta(days=7),
        photos=parts.photos,
        which=OF_TEST_ACCOUNTS,
    )

    await pruning.step()

    answer = await gateway.http.get(f"/v1/deliveries/{delivery_id}", headers=headers)
    assert answer.status_code == 404
    assert (await gateway.get(live_id))["state"] == "PLANNED"
