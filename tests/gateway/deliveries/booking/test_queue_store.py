"""A round that ends late does not change a delivery that another replica has planned meanwhile."""

from collections.abc import Callable
from datetime import timedelta
from typing import Any

from skyway_gateway.deliveries.booking.queue_store import note_reasons, try_later

from tests.gateway.whole_gateway import Gateway


async def test_a_planned_delivery_is_not_postponed(
    gateway: Gateway, reason: Callable[..., Any]
) -> None:
    delivery_id = await gateway.planned()
    planned = await gateway.get(delivery_id)

    async with gateway.parts.db.write() as tx:
        next_try_at = gateway.clock.wall_now() + timedelta(seconds=1)
        busy = [reason("BUSY", is_temporary=True)]
        await try_later(tx, delivery_id, next_try_at=next_try_at, reasons=busy)

    assert await gateway.get(delivery_id) == planned


async def test_a_planned_delivery_gets_no_reasons_for_giving_it_up(
    gateway: Gateway, reason: Callable[..., Any]
) -> None:
    delivery_id = await gateway.planned()
    planned = await gateway.get(delivery_id)

    async with gateway.parts.db.write() as tx:
        overweight = [reason("OVERWEIGHT", is_temporary=False)]
        await note_reasons(tx, delivery_id, overweight)

    assert await gateway.get(delivery_id) == planned
