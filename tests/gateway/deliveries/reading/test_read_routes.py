"""Reading deliveries: the caller's own, in pages, and as a stream of events."""

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from tests.gateway.whole_gateway import Gateway


async def test_a_delivery_of_another_customer_is_not_found(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    for path in ("", "/plan", "/events"):
        url = f"/v1/deliveries/{delivery_id}{path}"
        answer = await gateway.http.get(url, headers=gateway.other)
        assert answer.status_code == 404, path
        assert answer.json()["type"] == "urn:skyway:problem:not-found"
        assert (await gateway.http.get(url)).status_code == 401
        assert (await gateway.http.get(url, headers=gateway.provider)).status_code == 403
    empty = await gateway.http.get("/v1/deliveries", headers=gateway.other)
    assert empty.json()["items"] == []


async def test_an_operator_sees_the_deliveries_of_all_customers(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    listed = await gateway.http.get("/v1/deliveries", headers=gateway.operator)
    assert [one["delivery_id"] for one in listed.json()["items"]] == [delivery_id]


async def test_a_list_is_paged_and_filtered(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    made = [await gateway.accepted(reference=f"order {number}") for number in range(5)]
    found, cursor = [], ""
    while cursor is not None:
        query = f"?limit=2{f'&cursor={cursor}' if cursor else ''}"
        page = await gateway.http.get(f"/v1/deliveries{query}", headers=gateway.customer)
        found += [one["delivery_id"] for one in page.json()["items"]]
        cursor = page.json()["next_cursor"]
    assert sorted(found) == sorted(made)
    assert found == sorted(found, reverse=True)

    async def listed(query: str) -> list[str]:
        answer = await gateway.http.get(f"/v1/deliveries?{query}", headers=gateway.customer)
        return [one["delivery_id"] for one in answer.json()["items"]]

    assert await listed("reference=order 3") == [made[3]]
    assert len(await listed("state=REQUESTED")) == 5
    assert await listed("state=PLANNED") == []


@pytest.mark.parametrize("query", ["limit=0", "limit=201", "cursor=!", "state=LOST", "colour=1"])
async def test_a_bad_query_is_a_problem(gateway: Gateway, query: str) -> None:
    answer = await gateway.http.get(f"/v1/deliveries?{query}", headers=gateway.customer)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == query.partition("=")[0]


async def test_the_plan_shows_when_each_mission_starts(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted()
    path = f"/v1/deliveries/{delivery_id}/plan"
    assert (await gateway.http.get(path, headers=gateway.customer)).json()["missions"] == []
    await gateway.book_next()
    plan = (await gateway.http.get(path, headers=gateway.customer)).json()
    assert plan["state"] == "PLANNED"
    [mission] = plan["missions"]
    assert mission["start_at"] == "2026-03-01T12:01:00Z"
    assert mission["plan"]["delivery_time_s"] == 600


async def test_a_provider_sees_deliveries_of_its_drones_without_the_customer(
    gateway: Gateway,
) -> None:
    delivery_id = await gateway.planned()
    path = "/v1/providers/prv_1/deliveries"
    [seen] = (await gateway.http.get(path, headers=gateway.provider)).json()["items"]
    assert seen["delivery_id"] == delivery_id
    assert seen["missions"][0]["provider_id"] == "prv_1"
    assert "customer_id" not in seen
    assert "reference" not in seen
    other = "/v1/providers/prv_2/deliveries"
    assert (await gateway.http.get(other, headers=gateway.provider)).status_code == 404
    assert (await gateway.http.get(other, headers=gateway.operator)).json()["items"] == []


async def _split(gateway: Gateway, candidate: Callable[..., Any]) -> str:
    """A delivery whose first package a drone of prv_1 carries, and whose second one of prv_2."""
    gateway.composition.packages_per_trip = 1
    gateway.registry.candidates_now = [
        candidate("drn_1"),
        candidate("drn_2", provider_id="prv_2"),
    ]
    delivery_id = str(await gateway.accepted(packages=2))
    while await gateway.book_next():
        pass
    return delivery_id


async def test_providers_of_a_split_delivery_see_their_own_packages_only(
    gateway_on_both: Gateway, candidate: Callable[..., Any]
) -> None:
    gateway = gateway_on_both
    delivery_id = await _split(gateway, candidate)
    for seq, kind in enumerate(("ACCEPTED", "LOADING", "LOADED"), start=1):
        await gateway.report(delivery_id, kind, seq=seq)
    await gateway.report(delivery_id, "ACTIVITY", seq=4, activity="FLYING")
    await gateway.report(delivery_id, "DELIVERED", seq=5, package_ids=["p1"])

    async def seen_by(provider_id: str) -> Any:
        path = f"/v1/providers/{provider_id}/deliveries"
        [seen] = (await gateway.http.get(path, headers=gateway.operator)).json()["items"]
        return seen

    first, second = await seen_by("prv_1"), await seen_by("prv_2")

    assert [one["package_id"] for one in first["packages"]] == ["p1"]
    assert first["packages"][0]["proof"]["provider_id"] == "prv_1"
    assert [one["package_id"] for one in second["packages"]] == ["p2"]
    assert "prv_1" not in str(second)
    assert "drn_1" not in str(second)
    assert (first["activity"], second["activity"]) == (None, None)


async def _stream(gateway: Gateway, delivery_id: str, last_event_id: str | None = None) -> Any:
    headers = {**gateway.customer}
    if last_event_id is not None:
        headers["Last-Event-ID"] = last_event_id
    return await gateway.http.get(f"/v1/deliveries/{delivery_id}/events", headers=headers)


async def _end(gateway: Gateway, delivery_id: str) -> None:
    for seq, kind in enumerate(("ACCEPTED", "LOADING", "LOADED"), start=1):
        await gateway.report(delivery_id, kind, seq=seq)
    await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1"])


async def test_a_stream_sends_all_events_and_ends_with_the_final_one(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.planned()
    listening = asyncio.create_task(_stream(gateway, delivery_id))
    await _end(gateway, delivery_id)
    answer = await listening
    assert answer.headers["content-type"].startswith("text/event-stream")
    frames = [frame.split("\n") for frame in answer.text.strip().split("\n\n")]
    assert [frame[0] for frame in frames] == [f"id: {number}" for number in range(1, 8)]
    assert frames[-1][1] == "event: delivery.completed"
    assert frames[-1][2].startswith('data: {"')
    assert gateway.parts.listeners.listener_count == 0


async def test_a_stream_continues_after_the_last_event_id(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    await _end(gateway, delivery_id)
    answer = await _stream(gateway, delivery_id, "5")
    assert [line for line in answer.text.split("\n") if line.startswith("id")] == [
        "id: 6",
        "id: 7",
    ]
    assert (await _stream(gateway, delivery_id, "7")).status_code == 204


@pytest.mark.parametrize("last_event_id", ["x", "-1", "99999999999"])
async def test_an_impossible_last_event_id_is_refused(gateway: Gateway, last_event_id: str) -> None:
    delivery_id = await gateway.planned()
    answer = await _stream(gateway, delivery_id, last_event_id)
    assert answer.status_code == 422
