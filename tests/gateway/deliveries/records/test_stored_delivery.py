"""Writes from the cache: a write that came in between is noticed, also from another replica."""

import asyncio
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from skyway_gateway.deliveries.booking.queue_store import try_later
from skyway_gateway.deliveries.records.delivery_rows import DeliveryCache, StoredDelivery
from skyway_gateway.deliveries.requests.cancel import CancelRequest

from skyway.contracts.mission_reports import TracedReport
from skyway.ids import DeliveryId
from skyway.runtime.errors import Conflict
from skyway.runtime.http.identity import Caller
from skyway.runtime.tracing import trace_id_of
from tests.gateway.whole_gateway import Gateway
from tests.row_locks import until_a_lock_is_waited_for


@pytest.fixture
def replica(gateway_on_both: Gateway) -> Any:
    """The same gateway in another process on the same database, with an empty cache."""
    parts = gateway_on_both.parts
    writer = replace(parts.writer, cache=DeliveryCache())
    return replace(gateway_on_both, parts=replace(parts, writer=writer))


async def _apply(gateway: Gateway, delivery_id: str, kind: str, *, seq: int, **fields: Any) -> None:
    """Apply a report in this replica only."""
    report = gateway.mission_report(delivery_id, kind, seq=seq, **fields)
    await gateway.parts.applier.apply(report)


async def test_a_delivery_that_was_just_written_is_not_read_again(
    gateway: Gateway, statements: Any
) -> None:
    # The deliveries of a customer are counted when the first one is accepted.
    await gateway.planned()
    with statements() as seen:
        delivery_id = await gateway.accepted()
        await gateway.book_next()
        await _apply(gateway, delivery_id, "ACCEPTED", seq=1)
    asked = [one for one in seen if one.startswith("SELECT")]
    assert not [one for one in asked if "api_keys" not in one and "webhooks" not in one]
    assert not [one for one in seen if one.startswith("UPDATE missions") and "body" in one]
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "DISPATCHED"
    assert delivery["missions"][0]["state"] == "ACCEPTED"


async def test_a_delivery_that_another_replica_accepted_is_booked_here(
    gateway_on_both: Gateway, replica: Gateway
) -> None:
    delivery_id = await gateway_on_both.accepted(packages=2)
    assert await replica.book_next()
    await _apply(gateway_on_both, delivery_id, "ACCEPTED", seq=1)
    await _apply(replica, delivery_id, "LOADING", seq=2)
    assert (await replica.get(delivery_id))["state"] == "LOADING"


async def test_a_plan_respects_a_cancellation_after_the_claim(
    gateway_on_both: Gateway, replica: Gateway
) -> None:
    """A package that either replica cancels is not planned, and is cancelled in composition."""
    for canceller in (gateway_on_both, replica):
        delivery_id = await gateway_on_both.accepted(packages=2)
        [queued] = await gateway_on_both.parts.booker.claim(limit=1)
        answer = await _cancel(canceller, delivery_id, ["p1"])
        assert answer.packages[0].state == "CANCELLED"

        await gateway_on_both.parts.booker.book(queued)
        delivery = await gateway_on_both.get(delivery_id)
        assert delivery["state"] == "PLANNED"
        assert [one["state"] for one in delivery["packages"]] == ["CANCELLED", "CREATED"]
        assert [one["mission_id"] is None for one in delivery["packages"]] == [True, False]
        assert await gateway_on_both.event_types(delivery_id) == [
            "delivery.requested",
            "package.cancelled",
            "delivery.planned",
        ]


async def test_a_plan_of_an_older_attempt_is_not_written(
    gateway_on_both: Gateway, replica: Gateway, candidate: Callable[..., Any]
) -> None:
    """Another replica has planned it meanwhile, and its drone has refused."""
    gateway = gateway_on_both
    gateway.registry.candidates_now = [candidate("drn_1"), candidate("drn_2")]
    delivery_id = await gateway.accepted()
    [queued] = await gateway.parts.booker.claim(limit=1)
    await replica.parts.booker.book(queued)
    await _apply(replica, delivery_id, "REFUSED", seq=1, code="EXPIRED")

    await gateway.parts.booker.book(queued)
    delivery = await gateway.get(delivery_id)
    assert (delivery["state"], delivery["attempt"]) == ("REQUESTED", 2)
    assert await gateway.event_types(delivery_id) == ["delivery.requested", "delivery.planned"]


async def test_a_report_about_a_delivery_of_another_replica_is_applied_without_a_lock(
    gateway_on_both: Gateway, replica: Gateway, statements: Any
) -> None:
    delivery_id = await gateway_on_both.planned()
    with statements() as seen:
        await _apply(replica, delivery_id, "ACCEPTED", seq=1)
    assert not [one for one in seen if "FOR UPDATE" in one or "SELECT missions.report_seq" in one]
    assert (await replica.get(delivery_id))["state"] == "DISPATCHED"


async def test_reports_to_two_replicas_are_applied_once_each(
    gateway_on_both: Gateway, replica: Gateway
) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.planned()
    steps = [("ACCEPTED", {}), ("LOADING", {}), ("LOADED", {"package_ids": ["p1"]})]
    for seq, (kind, fields) in enumerate(steps, start=1):
        # Each replica has cached the delivery as it wrote it two reports ago.
        for one in (gateway, replica) if seq % 2 else (replica, gateway):
            await _apply(one, delivery_id, kind, seq=seq, **fields)
    await asyncio.gather(
        *(
            _apply(one, delivery_id, "DELIVERED", seq=4, package_ids=["p1"])
            for one in (gateway, replica)
        )
    )
    assert (await gateway.get(delivery_id))["state"] == "COMPLETED"
    assert await gateway.event_types(delivery_id) == [
        "delivery.requested",
        "delivery.planned",
        "delivery.dispatched",
        "delivery.loaded",
        "delivery.started",
        "package.delivered",
        "delivery.completed",
    ]


async def _follow_all(gateway: Gateway, kind: str, reports: dict[str, int]) -> None:
    """Apply reports of one request in this replica: numbers of reports by delivery."""
    traced = [
        TracedReport(
            traceparent=f"00-{number:032x}-{1:016x}-01",
            report=gateway.mission_report(delivery_id, kind, seq=seq),
        )
        for number, (delivery_id, seq) in enumerate(reports.items(), start=1)
    ]
    await gateway.parts.applier.apply_all(traced)


async def test_reports_in_one_request_are_applied_without_reading(
    gateway: Gateway, statements: Any
) -> None:
    planned = [await gateway.planned() for _ in range(3)]
    with statements() as seen:
        await _follow_all(gateway, "ACCEPTED", dict.fromkeys(planned, 1))
    assert not [one for one in seen if one.startswith("SELECT")]
    for delivery_id in planned:
        assert (await gateway.get(delivery_id))["state"] == "DISPATCHED"
        requested, *_, dispatched = await gateway.events(delivery_id)
        assert trace_id_of(dispatched["traceparent"]) == trace_id_of(requested["traceparent"])


async def test_reports_in_one_request_are_applied_after_a_write_of_another_replica(
    gateway_on_both: Gateway, replica: Gateway
) -> None:
    gateway = gateway_on_both
    first, second, third = [await gateway.planned() for _ in range(3)]
    await _apply(replica, second, "ACCEPTED", seq=1)
    await _follow_all(gateway, "ACCEPTED", {first: 1, second: 1, third: 1})
    await asyncio.gather(
        _follow_all(gateway, "LOADING", {first: 2, second: 2, third: 2}),
        _follow_all(replica, "LOADING", {third: 2, second: 2, first: 2}),
    )
    for delivery_id in (first, second, third):
        assert (await gateway.get(delivery_id))["state"] == "LOADING"
        assert (await gateway.event_types(delivery_id))[2:] == ["delivery.dispatched"]


async def test_a_report_that_comes_too_early_refuses_those_after_it(gateway: Gateway) -> None:
    first, second = [await gateway.planned() for _ in range(2)]
    with pytest.raises(Conflict, match="NOT_YET"):
        await _follow_all(gateway, "LOADING", {first: 1, second: 2})
    assert (await gateway.get(first))["state"] == "LOADING"
    assert (await gateway.get(second))["state"] == "PLANNED"


async def test_a_report_sees_a_cancellation_by_another_replica(
    gateway_on_both: Gateway, replica: Gateway
) -> None:
    """The drone loads the other package: p1 stays at the pickup, although the cache differs."""
    gateway = gateway_on_both
    delivery_id = await gateway.planned(packages=2)
    await _apply(gateway, delivery_id, "ACCEPTED", seq=1)
    await _cancel(replica, delivery_id, ["p1"])
    await _apply(gateway, delivery_id, "LOADED", seq=2, package_ids=["p2"])
    delivery = await gateway.get(delivery_id)
    assert [one["state"] for one in delivery["packages"]] == ["CANCELLED", "LOADED"]


@pytest.mark.integration
@pytest.mark.parametrize("migrated_url", ["postgresql"], indirect=True)
async def test_a_cancellation_waits_for_a_write_that_is_under_way(
    gateway_on_both: Gateway, reason: Callable[..., Any]
) -> None:
    gateway, db = gateway_on_both, gateway_on_both.parts.db
    delivery_id = await gateway.accepted(packages=2)
    next_try_at = gateway.clock.wall_now()

    async with db.write() as tx:
        await try_later(
            tx, delivery_id, next_try_at=next_try_at, reasons=[reason("BUSY", is_temporary=True)]
        )
        cancelling = asyncio.create_task(_cancel(gateway, delivery_id, ["p1"]))
        await until_a_lock_is_waited_for(db)
    cancelled = await cancelling

    assert [one.state for one in cancelled.packages] == ["CANCELLED", "CREATED"]
    assert [one.code for one in cancelled.reasons] == ["BUSY"]


async def _cancel(gateway: Gateway, delivery_id: DeliveryId, package_ids: list[str]) -> Any:
    asked = CancelRequest(package_ids=tuple(package_ids))
    caller = Caller(role="customer", subject_id="alice")
    return await gateway.parts.canceller.cancel(caller, delivery_id, asked)


async def test_only_the_latest_deliveries_are_cached(gateway: Gateway) -> None:
    await gateway.accepted()
    [queued] = await gateway.parts.booker.claim(limit=1)
    cache = DeliveryCache()
    for number in range(501):
        other = queued.delivery.model_copy(update={"delivery_id": f"dlv_{number}"})
        cache.remember(StoredDelivery(other, version=1, last_sequence=1))
    assert cache.pop(DeliveryId("dlv_0")) is None
    assert cache.pop(DeliveryId("dlv_1")) is not None
    assert cache.pop(DeliveryId("dlv_1")) is None, "remembered although it was about to be written"
    cache.remember(StoredDelivery(queued.delivery, version=3, last_sequence=3))
    cache.remember(StoredDelivery(queued.delivery, version=2, last_sequence=2))
    newest = cache.pop(queued.delivery.delivery_id)
    assert newest is not None
    assert newest.version == 3
