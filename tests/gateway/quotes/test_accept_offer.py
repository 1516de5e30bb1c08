"""Accepting an offer: once, before it expires, by its customer."""

import asyncio
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from skyway_gateway.quotes import store
from skyway_gateway.quotes.accept_offer import AcceptedOffer, accept_offer

from skyway.ids import DeliveryId
from skyway.runtime.errors import Conflict, NotFound
from skyway.runtime.http.identity import Caller
from tests.gateway.whole_gateway import Gateway

ALICE = Caller("customer", "alice")


@pytest.fixture
async def quote(gateway_on_both: Gateway, request_body: Callable[..., Any]) -> Any:
    """A quote of the customer alice."""
    answer = await gateway_on_both.http.post(
        "/v1/quotes", json=request_body(packages=2), headers=gateway_on_both.customer
    )
    return answer.json()


async def accept_first(
    gateway: Gateway, quote: Any, *, caller: Caller = ALICE, delivery_id: str = "dlv_1"
) -> AcceptedOffer:
    gateway.is_damaged = True  # the delivery is never written
    async with gateway.parts.db.write() as tx:
        return await accept_offer(
            tx,
            caller,
            quote["quote_id"],
            quote["offers"][0]["offer_id"],
            delivery_id=DeliveryId(delivery_id),
            wall_now=gateway.clock.wall_now(),
        )


async def test_an_accepted_offer_gives_the_request_and_the_promise(
    gateway_on_both: Gateway, quote: Any
) -> None:
    taken = await accept_first(gateway_on_both, quote)

    assert [package.package_id for package in taken.request.packages] == ["p1", "p2"]
    assert taken.limits.provider_id == "prv_1"
    assert taken.limits.price.amount == 500
    assert taken.limits.within_s == 1200.0
    path = f"/v1/quotes/{quote['quote_id']}"
    shown = (await gateway_on_both.http.get(path, headers=gateway_on_both.customer)).json()
    assert shown["taken_offer_id"] == quote["offers"][0]["offer_id"]
    assert shown["delivery_id"] == "dlv_1"


async def test_an_offer_can_be_accepted_up_to_its_last_millisecond(
    gateway_on_both: Gateway, quote: Any
) -> None:
    gateway_on_both.clock.advance(timedelta(seconds=120) - timedelta(milliseconds=1))
    await accept_first(gateway_on_both, quote)


async def test_an_expired_offer_is_refused(gateway_on_both: Gateway, quote: Any) -> None:
    gateway_on_both.clock.advance(timedelta(seconds=120))
    with pytest.raises(Conflict) as refused:
        await accept_first(gateway_on_both, quote)
    assert refused.value.code == "QUOTE_EXPIRED"


async def test_a_second_acceptance_is_refused_even_after_the_expiry(
    gateway_on_both: Gateway, quote: Any
) -> None:
    await accept_first(gateway_on_both, quote)
    gateway_on_both.clock.advance(timedelta(seconds=500))
    with pytest.raises(Conflict) as refused:
        await accept_first(gateway_on_both, quote, delivery_id="dlv_2")
    assert refused.value.code == "QUOTE_TAKEN"


async def test_one_of_many_simultaneous_acceptances_succeeds(
    gateway_on_both: Gateway, quote: Any
) -> None:
    outcomes = await asyncio.gather(
        *(accept_first(gateway_on_both, quote, delivery_id=f"dlv_{n}") for n in range(8)),
        return_exceptions=True,
    )
    taken = [one for one in outcomes if isinstance(one, AcceptedOffer)]
    refused = [one.code for one in outcomes if isinstance(one, Conflict)]
    assert (len(taken), refused) == (1, ["QUOTE_TAKEN"] * 7)


async def test_an_offer_of_another_customer_cannot_be_accepted(
    gateway_on_both: Gateway, quote: Any
) -> None:
    for caller in (Caller("customer", "bob"), Caller("provider", "alice")):
        with pytest.raises(NotFound):
            await accept_first(gateway_on_both, quote, caller=caller)
    unknown = {**quote, "offers": [{"offer_id": "off_other"}]}
    with pytest.raises(NotFound):
        await accept_first(gateway_on_both, unknown)


async def test_an_acceptance_that_is_rolled_back_does_not_count(
    gateway_on_both: Gateway, quote: Any
) -> None:
    async def accept_and_break() -> None:
        async with gateway_on_both.parts.db.write() as tx:
            await store.mark_accepted(
                tx,
                quote["quote_id"],
                quote["offers"][0]["offer_id"],
                delivery_id=DeliveryId("dlv_1"),
            )
            raise NotFound("delivery", "dlv_1")

    with pytest.raises(NotFound):
        await accept_and_break()
    await accept_first(gateway_on_both, quote)
