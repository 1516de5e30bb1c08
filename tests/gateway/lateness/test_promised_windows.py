"""A delivery with a window is promised whole, wherever its promise is read."""

from datetime import datetime, timedelta

import pytest
from skyway_gateway.delivery_tables import packages
from sqlalchemy import update

from tests.gateway.whole_gateway import Gateway, make_request

pytestmark = pytest.mark.databases("sqlite")

_LENGTH = timedelta(minutes=30)


def _window(gateway: Gateway) -> dict[str, str]:
    """A window for the hand-over."""
    begins_at = gateway.clock.now() + timedelta(hours=2)
    return {
        "not_before_at": begins_at.isoformat(),
        "latest_at": (begins_at + _LENGTH).isoformat(),
    }


async def _booked(gateway: Gateway) -> str:
    delivery_id = await gateway.accepted(window=_window(gateway))
    while await gateway.book_next():
        pass
    return delivery_id


async def test_a_window_is_promised_in_offers_deliveries_and_events(gateway: Gateway) -> None:
    body = make_request(window=_window(gateway))
    quote = await gateway.http.post("/v1/quotes", json=body, headers=gateway.customer)
    delivery_id = await _booked(gateway)

    [offered] = quote.json()["offers"][0]["packages"]
    [promised] = (await gateway.get(delivery_id))["packages"]
    [planned] = [
        each for each in await gateway.events(delivery_id) if each["type"] == "delivery.planned"
    ]
    [notified] = planned["data"]["packages"]
    due_at = [datetime.fromisoformat(each["due_at"]) for each in (offered, promised, notified)]
    assert due_at == [datetime.fromisoformat(body["packages"][0]["latest_at"])] * 3
    assert await gateway.verified() == []


@pytest.mark.parametrize("moved_ms", [-1_000, 1_000])
async def test_verify_finds_a_window_that_is_due_at_another_moment(
    gateway: Gateway, moved_ms: int
) -> None:
    gateway.is_damaged = True
    delivery_id = await _booked(gateway)
    async with gateway.parts.db.write() as tx:
        this = packages.c.delivery_id == delivery_id
        await tx.execute(update(packages).where(this).values(due_ms=packages.c.due_ms + moved_ms))

    assert "a package is due at the moment that was promised" in await gateway.verified()
