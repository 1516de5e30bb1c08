"""Deliveries that were flown and paid, and what the API says of them."""

from datetime import timedelta
from typing import Any

from skyway_gateway.ledger.close_months import MonthClosing

from skyway.delivery.line_items import LineItem
from skyway.delivery.offer import Price
from skyway.delivery.payment_terms import CancellationTerms, LateStep, PaymentTerms
from tests.counting_mint import CountingMint
from tests.gateway.whole_gateway import Gateway

MONTH = "2026-03"

#: A price of 12.34, and terms that give something back.
PRICE = Price(
    amount=1234,
    currency="USD",
    line_items=(LineItem(kind="BASE", amount=500), LineItem(kind="DISTANCE", amount=734)),
)
TERMS = PaymentTerms(
    cancellation=CancellationTerms(until_loaded=0.25, in_flight=0.8),
    late=(LateStep(after_min=10, share=0.1), LateStep(after_min=60, share=0.5)),
)


async def booked(gateway: Gateway, *, packages: int = 1) -> str:
    """A planned delivery with this price and these terms."""
    gateway.composition.priced = {"price": PRICE, "payment_terms": TERMS}
    return await gateway.planned(packages=packages)


async def flown(gateway: Gateway, delivery_id: str, *kinds: str, first: int = 1) -> None:
    """Reports of the delivery's mission, in order."""
    for seq, kind in enumerate(kinds, start=first):
        answer = await gateway.report(delivery_id, kind, seq=seq)
        assert answer.status_code == 204, answer.text


async def delivered(gateway: Gateway, *, later: timedelta = timedelta(0)) -> str:
    """A delivery of one package that was handed over so much after its due moment."""
    delivery_id = await booked(gateway)
    await flown(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    await handed_over(gateway, delivery_id, later=later)
    await gateway.report(delivery_id, "ENDED", seq=5)
    return delivery_id


async def handed_over(
    gateway: Gateway, delivery_id: str, *, later: timedelta = timedelta(0)
) -> None:
    """The fourth report of a mission: its first package comes so much after its due moment."""
    due_at = gateway.composition.trips_of(delivery_id, 1)[0].packages[0].eta_at
    gateway.clock.advance(due_at + later - gateway.clock.now())
    await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1"])


async def asked(
    gateway: Gateway, path: str = "", *, who: dict[str, str] | None = None, **query: str
) -> list[dict[str, Any]]:
    """The items of a list below /v1/statements, as an operator sees them."""
    params = {"month": MONTH, **query}
    headers = who or gateway.operator
    answer = await gateway.http.get(f"/v1/statements{path}", params=params, headers=headers)
    assert answer.status_code == 200, answer.text
    found: list[dict[str, Any]] = answer.json()["items"]
    return found


def closing_of(gateway: Gateway) -> MonthClosing:
    """The loop that closes months."""
    parts = gateway.parts
    return MonthClosing(parts.db, gateway.clock, CountingMint(), parts.sender.wake)
