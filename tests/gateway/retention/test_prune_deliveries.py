"""Deliveries that ended long ago are deleted at composition and then here, whole or not at all."""

import asyncio
from datetime import timedelta

import pytest
from skyway_gateway.delivery_tables import IS_OVER
from skyway_gateway.retention.pruning import DeliveryPruning, ExpiredPruning
from skyway_gateway.retention.store import delete_leaving

from skyway.ids import DeliveryId
from skyway.runtime.errors import ServiceUnavailable
from tests.gateway.whole_gateway import Gateway, make_request

KEPT = timedelta(days=2)

#: The tables that have rows of deliveries.
TABLES = ("deliveries", "packages", "custody", "missions", "events", "notifications")


def pruning(gateway: Gateway, claimant: str = "one") -> DeliveryPruning:
    parts = gateway.parts
    return DeliveryPruning(parts.db, parts.composition, gateway.clock, claimant, KEPT, parts.photos)


async def flown(gateway: Gateway) -> str:
    """A delivery that is over."""
    delivery_id = await gateway.planned()
    for seq, kind in enumerate(("ACCEPTED", "LOADING", "LOADED"), start=1):
        await gateway.report(delivery_id, kind, seq=seq)
    await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1"])
    await gateway.report(delivery_id, "ENDED", seq=5)
    assert (await gateway.get(delivery_id))["state"] == "COMPLETED"
    return delivery_id


async def days_pass(gateway: Gateway, days: float = 3) -> None:
    """Time passes; what is sent arrives, and what has expired is swept."""
    await gateway.execute("DELETE FROM outbox")
    gateway.clock.advance(timedelta(days=days))
    await ExpiredPruning(gateway.parts.db, gateway.clock).step()


async def rows(gateway: Gateway) -> dict[str, int]:
    """How many rows the tables of deliveries have."""
    async with gateway.parts.db.read() as connection:
        return {
            name: (await connection.exec_driver_sql(f"SELECT count(*) FROM {name}")).scalar_one()
            for name in TABLES
        }


async def left(gateway: Gateway) -> set[str]:
    """The ids of the deliveries that are stored."""
    async with gateway.parts.db.read() as connection:
        found = await connection.exec_driver_sql("SELECT delivery_id FROM deliveries")
        return set(found.scalars())


async def with_webhook(gateway: Gateway, *, notified: bool) -> None:
    """Make a webhook for the customer, and call all its notifications so far delivered."""
    body = {"url": "http://127.0.0.1:9/"}
    await gateway.http.post("/v1/webhooks", json=body, headers=gateway.customer)
    gateway.clock.advance(timedelta(seconds=1))
    await flown(gateway)
    if notified:
        await gateway.execute("UPDATE notifications SET state = 'GIVEN_UP'")


async def test_a_delivery_is_deleted_with_its_parts(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    await with_webhook(gateway, notified=True)
    [delivery_id] = await left(gateway)
    links = f"/v1/deliveries/{delivery_id}/tracking-link"
    assert (await gateway.http.post(links, headers=gateway.customer)).is_success
    await days_pass(gateway)

    await pruning(gateway).step()

    assert gateway.composition.forgotten == [delivery_id]
    assert await rows(gateway) == dict.fromkeys(TABLES, 0)
    answer = await gateway.http.get(f"/v1/deliveries/{delivery_id}", headers=gateway.customer)
    assert answer.status_code == 404


async def test_a_delivery_stays_as_long_as_the_setting_says(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await flown(gateway)
    await days_pass(gateway, 1.9)

    await pruning(gateway).step()

    assert await left(gateway) == {delivery_id}


async def test_a_delivery_that_goes_on_stays(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.planned()
    await days_pass(gateway)

    await pruning(gateway).step()

    assert await left(gateway) == {delivery_id}
    gateway.is_damaged = True  # nobody has looked at it for three days


async def test_fast_fleet_time_does_not_shorten_the_day_of_an_idempotency_key(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    delivery_id = await flown(gateway)
    await days_pass(gateway)
    # As if three days of fleet time had taken 24 hours of wall time.
    await gateway.execute("UPDATE events SET recorded_wall_ms = recorded_wall_ms + 2 * 86400000")
    gateway.is_damaged = True

    await pruning(gateway).step()

    assert await left(gateway) == {delivery_id}


async def test_a_stored_answer_that_was_not_swept_keeps_deliveries(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    delivery_id = await flown(gateway)
    await gateway.post(make_request(), **{"Idempotency-Key": "once"})
    await gateway.execute("DELETE FROM outbox")
    gateway.clock.advance(timedelta(days=3))

    await pruning(gateway).step()

    assert delivery_id in await left(gateway)
    gateway.is_damaged = True


async def test_a_pending_notification_keeps_its_delivery(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    await with_webhook(gateway, notified=False)
    await days_pass(gateway)

    await pruning(gateway).step()

    assert len(await left(gateway)) == 1
    assert gateway.composition.forgotten == []


async def test_a_delivery_that_does_not_leave_any_more_stays(gateway_on_both: Gateway) -> None:
    """Another replica had claimed it, and composition needs it."""
    gateway = gateway_on_both
    delivery_id = DeliveryId(await flown(gateway))
    async with gateway.parts.db.write() as tx:
        deleted = await delete_leaving(tx, [delivery_id])

    assert (deleted, await left(gateway)) == (0, {delivery_id})


async def test_a_message_in_the_outbox_keeps_its_delivery(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await flown(gateway)
    gateway.clock.advance(timedelta(days=3))
    await ExpiredPruning(gateway.parts.db, gateway.clock).step()

    await pruning(gateway).step()

    assert await left(gateway) == {delivery_id}


async def test_composition_may_keep_a_delivery_for_another_hour(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    needed, other = await flown(gateway), await flown(gateway)
    gateway.composition.needed = {needed}
    await days_pass(gateway)

    await pruning(gateway).step()
    assert await left(gateway) == {needed}
    assert await gateway.broken() == []

    gateway.composition.needed = set()
    await pruning(gateway).step()
    assert await left(gateway) == {needed}
    gateway.clock.advance(timedelta(hours=1))
    await pruning(gateway).step()
    assert await left(gateway) == set()
    assert gateway.composition.forgotten == [other, needed]


@pytest.mark.parametrize("killed_after", ["mark", "forget"])
async def test_a_kill_in_between_only_delays_the_deletion(
    gateway_on_both: Gateway, killed_after: str
) -> None:
    gateway = gateway_on_both
    await flown(gateway)
    await days_pass(gateway)
    killed = pruning(gateway, "killed")
    leaving = await killed.mark()
    if killed_after == "forget":
        await killed.forget(leaving)
    assert await gateway.broken() == []

    await pruning(gateway).step()
    assert await left(gateway) == set(leaving), "the claim of the killed process still counts"
    gateway.clock.advance(timedelta(minutes=2))
    await pruning(gateway).step()

    assert await left(gateway) == set()


async def test_nothing_is_deleted_here_while_composition_is_away(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    delivery_id = await flown(gateway)
    await days_pass(gateway)
    gateway.composition.is_away = True

    with pytest.raises(ServiceUnavailable):
        await pruning(gateway).step()

    assert await left(gateway) == {delivery_id}
    assert await gateway.broken() == []


async def test_two_replicas_delete_each_delivery_once(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    flown_ids = {await flown(gateway) for _ in range(3)}
    await days_pass(gateway)

    await asyncio.gather(*(pruning(gateway, name).step() for name in ("one", "other")))

    assert sorted(gateway.composition.forgotten) == sorted(flown_ids)
    assert await left(gateway) == set()


async def test_events_that_are_sent_again_leave_before_their_delivery(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    await with_webhook(gateway, notified=True)
    await days_pass(gateway)
    prune = pruning(gateway)
    forgotten = await prune.forget(await prune.mark())
    await gateway.execute("UPDATE notifications SET state = 'PENDING', is_replay = TRUE")

    assert await prune.delete(forgotten) == 0
    assert len(await left(gateway)) == 1


async def test_old_deliveries_are_found_without_reading_all_that_are_over(
    gateway: Gateway,
) -> None:
    async with gateway.parts.db.read() as connection:
        found = await connection.exec_driver_sql(
            "EXPLAIN QUERY PLAN SELECT delivery_id FROM deliveries"
            f" WHERE {IS_OVER} AND updated_ms < 5 AND next_try_wall_ms <= 5"
            " ORDER BY updated_ms, delivery_id LIMIT 200"
        )
        plan = " ".join(row.detail for row in found)

    assert "deliveries_over" in plan
