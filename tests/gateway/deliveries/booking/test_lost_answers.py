"""Composition may book what it has not answered: such deliveries come before new requests."""

import asyncio
from datetime import timedelta
from typing import Any

from skyway_gateway.deliveries.booking.booking_round import booking_request, candidate_query
from skyway_gateway.deliveries.booking.run_bookings import BookingLoop

from skyway.ids import DeliveryId
from skyway.runtime.loops import Wake
from tests.gateway.whole_gateway import Gateway


async def _claimed(gateway: Gateway) -> Any:
    return await gateway.parts.booker.claim(limit=9)


async def _ask(gateway: Gateway, queued: Any) -> Any:
    """Book a delivery in composition and stop before anything is written here."""
    found = await gateway.registry.candidates(candidate_query(queued))
    asked = booking_request(queued.delivery, found.shortlist)
    return await gateway.composition.book(queued.delivery.delivery_id, asked)


async def _lost(gateway: Gateway, *, is_booked: bool) -> DeliveryId:
    """A delivery whose first question to composition was not answered."""
    delivery_id = await gateway.accepted()
    if is_booked:
        [queued] = await _claimed(gateway)
        await _ask(gateway, queued)
        gateway.clock.advance(timedelta(seconds=30))  # the claim runs out
    gateway.composition.is_away = True
    await gateway.book_next()
    gateway.composition.is_away = False
    return delivery_id


async def test_a_lost_answer_is_asked_for_before_new_requests(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    lost_id = await _lost(gateway, is_booked=True)
    new_id = await gateway.accepted(qos={"priority": "PRIORITY"})
    gateway.clock.advance(timedelta(seconds=11))

    [first] = await gateway.parts.booker.claim(limit=1)
    [second] = await gateway.parts.booker.claim(limit=1)

    assert [first.delivery.delivery_id, second.delivery.delivery_id] == [lost_id, new_id]


async def test_a_lost_answer_is_known_with_the_time_of_its_question(gateway: Gateway) -> None:
    await gateway.accepted()
    gateway.composition.is_away = True
    asked_at = gateway.clock.wall_now()
    for _ in range(2):
        assert await gateway.book_next()
        gateway.clock.advance(timedelta(seconds=11))

    [lost] = await _claimed(gateway)
    assert lost.asked_at == asked_at


async def test_a_lost_answer_is_learnt_without_asking_for_candidates(gateway: Gateway) -> None:
    delivery_id = await _lost(gateway, is_booked=True)
    gateway.clock.advance(timedelta(seconds=11))
    queries = len(gateway.registry.queries)
    await gateway.book_next()

    assert (await gateway.get(delivery_id))["state"] == "PLANNED"
    assert len(gateway.registry.queries) == queries
    assert gateway.composition.booking_count == 1


async def test_a_question_that_never_arrived_is_asked_again_with_candidates(
    gateway: Gateway,
) -> None:
    delivery_id = await _lost(gateway, is_booked=False)
    gateway.clock.advance(timedelta(seconds=11))
    await gateway.book_next()

    assert (await gateway.get(delivery_id))["state"] == "PLANNED"
    assert [each.shortlist.is_empty for each in gateway.composition.asked] == [True, False]


async def test_an_answer_that_came_is_not_lost_any_more(gateway: Gateway) -> None:
    await _lost(gateway, is_booked=False)
    gateway.registry.candidates_now = []
    gateway.clock.advance(timedelta(seconds=11))
    await gateway.book_next()
    gateway.clock.advance(timedelta(seconds=11))

    [waiting] = await _claimed(gateway)
    assert (waiting.asked_at, waiting.is_waiting) == (None, True)


class Booker:
    """Learns what was booked when its gate opens."""

    def __init__(self) -> None:
        self.under_way: set[str] = set()
        self.gate = asyncio.Event()

    async def learn(self, delivery_id: str) -> bool:
        self.under_way.add(delivery_id)
        await self.gate.wait()
        self.under_way.discard(delivery_id)
        return True


async def test_a_report_whose_sender_leaves_costs_others_no_answer() -> None:
    loop, booker = BookingLoop(Wake(), claimant="bkr_1", most=4), Booker()
    fake: Any = booker
    asking = [asyncio.create_task(loop.learn(fake, DeliveryId("dlv_1"))) for _ in range(3)]
    await asyncio.sleep(0)
    assert len(booker.under_way) == 1

    asking[1].cancel()
    await asyncio.gather(asking[1], return_exceptions=True)
    booker.gate.set()

    assert [await asking[0], await asking[2]] == [True, True]


async def test_reports_about_many_deliveries_ask_for_a_few_at_a_time() -> None:
    loop, booker = BookingLoop(Wake(), claimant="bkr_1", most=4), Booker()
    fake: Any = booker
    asking = [
        asyncio.create_task(loop.learn(fake, DeliveryId(f"dlv_{number}"))) for number in range(20)
    ]
    await asyncio.sleep(0)

    assert len(booker.under_way) == 4
    booker.gate.set()
    assert await asyncio.gather(*asking) == [True] * 20
