"""Personal data is erased so long after the delivery's end as was promised, and never before."""

from datetime import timedelta
from pathlib import Path

import pytest
from skyway_gateway.personal_data.store import BATCH
from skyway_gateway.retention.pruning import DeliveryPruning, ExpiredPruning, PersonalDataPruning

from tests.gateway.whole_gateway import Gateway, make_request, opened_gateway

KEPT = timedelta(days=30)
ANA = {"name": "Ana Ruiz"}


async def over(gateway: Gateway) -> str:
    """A delivery with a recipient that is over."""
    delivery_id = await gateway.accepted(recipient=ANA)
    await gateway.http.post(f"/v1/deliveries/{delivery_id}/cancel", headers=gateway.customer)
    return delivery_id


async def step(gateway: Gateway) -> bool:
    return await PersonalDataPruning(gateway.parts.db, gateway.clock).step()


async def test_personal_data_is_erased_when_its_time_is_over(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await over(gateway)
    gateway.clock.advance(KEPT - timedelta(seconds=1))

    await step(gateway)
    assert (await gateway.get(delivery_id))["recipient"]["name"] == "Ana Ruiz"

    gateway.clock.advance(timedelta(seconds=1))
    await step(gateway)
    delivery = await gateway.get(delivery_id)
    assert delivery["recipient"] is None
    assert delivery["personal_data_erased_at"] == "2026-03-31T12:00:00Z"


async def test_the_time_counts_from_the_end_of_the_delivery(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    pickup_at = "2026-03-20T12:00:00Z"
    delivery_id = await gateway.accepted(recipient=ANA, earliest_pickup_at=pickup_at)
    gateway.clock.advance(timedelta(days=10))
    await gateway.http.post(f"/v1/deliveries/{delivery_id}/cancel", headers=gateway.customer)

    gateway.clock.advance(KEPT - timedelta(seconds=1))
    await step(gateway)
    assert (await gateway.get(delivery_id))["recipient"]["name"] == "Ana Ruiz"

    gateway.clock.advance(timedelta(seconds=1))
    await step(gateway)
    assert (await gateway.get(delivery_id))["recipient"] is None


async def test_personal_data_of_a_delivery_that_goes_on_stays(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.accepted(recipient=ANA)
    gateway.clock.advance(2 * KEPT)

    await step(gateway)

    assert (await gateway.get(delivery_id))["recipient"]["name"] == "Ana Ruiz"
    gateway.is_damaged = True  # nobody has looked at it for two months


async def test_the_setting_says_how_long_it_is_kept(sqlite_url: str, tmp_path: Path) -> None:
    async with opened_gateway(sqlite_url, tmp_path, personal_data_days=2.0) as gateway:
        delivery_id = await over(gateway)
        gateway.clock.advance(timedelta(days=2))

        await step(gateway)

        assert (await gateway.get(delivery_id))["recipient"] is None


async def test_a_step_erases_some_and_says_that_there_may_be_more(gateway: Gateway) -> None:
    for _ in range(BATCH + 1):
        await gateway.post(make_request(recipient=ANA))
    await gateway.execute("UPDATE deliveries SET state = 'CANCELLED'")
    gateway.is_damaged = True
    gateway.clock.advance(KEPT)

    assert [await step(gateway), await step(gateway)] == [True, False]


async def test_a_delivery_is_deleted_with_its_personal_data(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    await over(gateway)
    await gateway.execute("DELETE FROM outbox")
    gateway.clock.advance(timedelta(days=3))
    parts = gateway.parts
    await ExpiredPruning(parts.db, gateway.clock).step()

    kept = timedelta(days=2)
    await DeliveryPruning(
        parts.db, parts.composition, gateway.clock, "one", kept, parts.photos
    ).step()

    async with parts.db.read() as connection:
        left = await connection.exec_driver_sql("SELECT count(*) FROM personal_data")
        assert left.scalar_one() == 0


@pytest.mark.parametrize("state", ["REQUESTED", "PLANNED"])
async def test_a_delivery_under_way_may_be_erased_and_goes_on(gateway: Gateway, state: str) -> None:
    delivery_id = await gateway.accepted(recipient=ANA)
    if state == "PLANNED":
        await gateway.book_next()
    path = f"/v1/deliveries/{delivery_id}/personal-data"

    await gateway.http.delete(path, headers=gateway.customer)

    delivery = await gateway.get(delivery_id)
    assert (delivery["state"], delivery["recipient"]) == (state, None)
