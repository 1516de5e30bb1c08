"""A round that ends late does not change a delivery that another replica has planned meanwhile."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass, replace
from datetime import timedelta
from typing import Any

from skyway_gateway.deliveries.booking.queue_store import note_reasons, try_later

from skyway.contracts.mission import Booking, BookMissions, ClosedDelivery
from tests.gateway.fake_composition import FakeComposition
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


@dataclass
class LateComposition:
    """Composition, whose answers to bookings arrive after something else has happened."""

    composition: FakeComposition
    meanwhile: Callable[[], Awaitable[None]]

    async def book(self, delivery_id: str, requested: BookMissions) -> Booking:
        answer = await self.composition.book(delivery_id, requested)
        await self.meanwhile()
        return answer

    async def close(self, delivery_id: str) -> ClosedDelivery:
        return await self.composition.close(delivery_id)


async def _round_that_ends_after_a_refusal(gateway: Gateway) -> str:
    """A round whose attempt another replica has planned meanwhile, and its drone has refused."""
    delivery_id = await gateway.accepted()
    [queued] = await gateway.parts.booker.claim(limit=1)

    async def meanwhile() -> None:
        gateway.composition.reasons.clear()
        gateway.clock.advance(timedelta(seconds=30))  # the claim runs out
        await gateway.book_next()
        mission = gateway.composition.booked[delivery_id, 1]
        refused = mission.model_copy(update={"state": "REFUSED"})
        gateway.composition.booked[delivery_id, 1] = refused
        answer = await gateway.report(delivery_id, "REFUSED", seq=1, code="NOT_AT_START")
        assert answer.status_code == 204, answer.text

    late: Any = LateComposition(gateway.composition, meanwhile)
    await replace(gateway.parts.booker, composition=late).book(queued)
    return delivery_id


async def test_a_late_round_plans_no_mission_that_was_refused_meanwhile(gateway: Gateway) -> None:
    delivery_id = await _round_that_ends_after_a_refusal(gateway)

    delivery = await gateway.get(delivery_id)
    assert (delivery["state"], delivery["attempt"], delivery["missions"]) == ("REQUESTED", 2, [])


async def test_a_late_round_does_not_give_up_a_later_attempt(
    gateway: Gateway, reason: Callable[..., Any]
) -> None:
    gateway.composition.reasons = [reason("OVERWEIGHT", is_temporary=False)]
    delivery_id = await _round_that_ends_after_a_refusal(gateway)

    delivery = await gateway.get(delivery_id)
    assert (delivery["state"], delivery["attempt"]) == ("REQUESTED", 2)
