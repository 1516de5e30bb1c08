"""The booking loops: bookings run at the same time; later pickups wait and hold nothing."""

import asyncio
import math
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field, replace
from datetime import timedelta
from types import SimpleNamespace
from typing import Any

import pytest
from pydantic import ValidationError
from skyway_gateway.deliveries.booking.run_bookings import BookingLoop, books_from
from skyway_gateway.settings import GatewaySettings

from skyway.delivery.request import DeliveryRequest
from skyway.runtime.loops import Wake
from tests.gateway.whole_gateway import START, Gateway, make_request


@dataclass
class Booker:
    """A queue of names; each is booked when its gate opens, and the broken ones fail."""

    waiting: list[str]
    queued: Wake = field(default_factory=Wake)
    under_way: set[str] = field(default_factory=set)
    booked: list[str] = field(default_factory=list)
    looks: int = 0
    gate: asyncio.Event = field(default_factory=asyncio.Event)
    held: asyncio.Queue[frozenset[str]] = field(default_factory=asyncio.Queue)

    async def claim(self, *, limit: int) -> list[Any]:
        self.looks += 1
        taken, self.waiting = self.waiting[:limit], self.waiting[limit:]
        return [_queued(name) for name in taken]

    async def hold(self, deliveries: frozenset[str]) -> None:
        self.held.put_nowait(deliveries)

    async def candidates_of(self, line: Sequence[Any]) -> dict[str, Any]:
        if any("unknown" in queued.delivery.delivery_id for queued in line):
            raise RuntimeError(line)
        return {}

    async def book_or_retry(self, queued: Any, candidates: Any) -> bool:
        name = queued.delivery.delivery_id
        self.under_way.add(name)
        if name.startswith("slow"):
            await self.gate.wait()
        if name.startswith("broken"):
            raise RuntimeError(name)
        self.under_way.discard(name)
        self.booked.append(name)
        return True


Until = Callable[[Callable[[], bool]], Awaitable[None]]


@pytest.fixture
def until() -> Until:
    async def wait(is_so: Callable[[], bool]) -> None:
        async with asyncio.timeout(60):
            while not is_so():  # noqa: ASYNC110 - it is the loop under test that goes on
                await asyncio.sleep(0)

    return wait


def _queued(name: str) -> Any:
    """A request called "slow b of n" waits in the network "n" for a drone; others are new.

    Names that contain "urgent" are PRIORITY requests.
    """
    _, is_waiting, network_id = name.partition(" of ")
    qos = SimpleNamespace(priority="PRIORITY" if "urgent" in name else "STANDARD")
    request = SimpleNamespace(qos=qos)
    return SimpleNamespace(
        delivery=SimpleNamespace(delivery_id=name, created_at=START, request=request),
        is_waiting=bool(is_waiting),
        network_id=network_id or None,
    )


async def _run(
    booker: Booker,
    most: int,
    test: Callable[[], Awaitable[None]],
    *,
    loop: BookingLoop | None = None,
) -> None:
    loop = loop or BookingLoop(booker.queued, claimant="bkr_1", most=most)
    fake: Any = booker
    running = asyncio.create_task(loop.run(fake))
    try:
        await test()
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)


async def test_a_slow_booking_holds_up_no_other(until: Until) -> None:
    booker = Booker(["slow 1", "a", "b", "c", "d"])

    async def test() -> None:
        await until(lambda: booker.booked == ["a", "b", "c", "d"])
        assert booker.under_way == {"slow 1"}

    await _run(booker, 2, test)


async def test_no_more_than_the_limit_are_booked_at_the_same_time(until: Until) -> None:
    booker = Booker(["slow 1", "slow 2", "slow 3"])

    async def test() -> None:
        await until(lambda: len(booker.under_way) == 2)
        booker.queued.set()
        for _ in range(20):
            await asyncio.sleep(0)
        assert booker.under_way == {"slow 1", "slow 2"}
        booker.gate.set()
        await until(lambda: len(booker.booked) == 3)

    await _run(booker, 2, test)


async def test_a_failed_booking_does_not_disturb_the_others(until: Until) -> None:
    booker = Booker(["broken", "a"])

    async def test() -> None:
        await until(lambda: booker.booked == ["a"])
        booker.waiting.append("b")
        booker.queued.set()
        await until(lambda: booker.booked == ["a", "b"])

    await _run(booker, 2, test)


async def test_one_look_claims_everything_that_is_due(until: Until) -> None:
    booker = Booker(["slow 1", "slow 2", "slow 3"])

    async def test() -> None:
        await until(lambda: len(booker.under_way) == 3)
        assert booker.looks == 1

    await _run(booker, 8, test)


async def test_a_delivery_that_is_handed_over_is_booked_without_a_look(until: Until) -> None:
    booker = Booker([])
    loop = BookingLoop(booker.queued, claimant="bkr_1", most=2)
    assert not loop.is_free

    async def test() -> None:
        await until(lambda: loop.is_free)
        loop.begin(_queued("a"))
        await until(lambda: booker.booked == ["a"])
        assert booker.looks == 1

    await _run(booker, 2, test, loop=loop)
    assert not loop.is_free
    loop.begin(_queued("late"))
    assert booker.booked == ["a"]


async def test_nothing_is_handed_over_while_older_deliveries_wait(until: Until) -> None:
    booker = Booker(["slow 1", "slow 2", "slow 3"])
    loop = BookingLoop(booker.queued, claimant="bkr_1", most=2)

    async def test() -> None:
        await until(lambda: len(booker.under_way) == 2)
        assert not loop.is_free
        booker.gate.set()
        await until(lambda: len(booker.booked) == 3)
        await until(lambda: loop.is_free)

    await _run(booker, 2, test, loop=loop)


async def test_deliveries_are_handed_over_up_to_the_limit(until: Until) -> None:
    booker = Booker([])
    loop = BookingLoop(booker.queued, claimant="bkr_1", most=2)

    async def test() -> None:
        await until(lambda: loop.is_free)
        loop.begin(_queued("slow 1"))
        assert loop.is_free
        loop.begin(_queued("slow 2"))
        assert not loop.is_free

    await _run(booker, 2, test, loop=loop)


async def test_deliveries_of_one_commit_beyond_the_limit_wait(until: Until) -> None:
    booker = Booker([])
    loop = BookingLoop(booker.queued, claimant="bkr_1", most=2)

    async def test() -> None:
        await until(lambda: loop.is_free)
        for name in ("slow 1", "slow 2", "slow 3"):
            loop.begin(_queued(name))
        for _ in range(20):
            await asyncio.sleep(0)
        assert booker.under_way == {"slow 1", "slow 2"}
        booker.gate.set()
        await until(lambda: len(booker.booked) == 3)

    await _run(booker, 2, test, loop=loop)


async def test_requests_that_wait_in_one_network_are_booked_one_after_the_other(
    until: Until,
) -> None:
    booker = Booker(["broken of n", "standard of n", "slow urgent of n", "other of m", "new"])

    async def test() -> None:
        await until(lambda: booker.booked == ["other of m", "new"])
        assert booker.under_way == {"slow urgent of n"}
        booker.gate.set()
        await until(lambda: len(booker.booked) == 4)
        assert booker.booked[2:] == ["slow urgent of n", "standard of n"]

    await _run(booker, 5, test)


async def test_a_line_is_booked_when_its_candidates_cannot_be_read(until: Until) -> None:
    booker = Booker(["unknown of n", "standard of n", "slow new"])

    async def test() -> None:
        await until(lambda: booker.booked == ["standard of n", "unknown of n"])
        assert booker.under_way == {"slow new"}
        booker.gate.set()
        await until(lambda: len(booker.booked) == 3)

    await _run(booker, 5, test)


async def test_the_loop_measures_its_rounds(until: Until) -> None:
    booker = Booker(["a", "broken b"])
    loop = BookingLoop(booker.queued, claimant="bkr_1", most=4)

    async def test() -> None:
        await until(lambda: loop.pace.per_s() < math.inf)

    await _run(booker, 4, test, loop=loop)


async def test_claims_of_running_bookings_are_renewed() -> None:
    booker = Booker(["slow 1", "a", "slow 2"])

    async def test() -> None:
        async with asyncio.timeout(60):
            while len(await booker.held.get()) > 2:  # the first renewal may include "a"
                pass
            assert await booker.held.get() == {"slow 1", "slow 2"}

    await _run(booker, 3, test)


async def scheduled(gateway: Gateway, *, hours: float = 72, **changes: Any) -> str:
    """The id of a delivery with a pickup so many hours ahead."""
    pickup_at = (gateway.clock.now() + timedelta(hours=hours)).isoformat()
    return await gateway.accepted(earliest_pickup_at=pickup_at, **changes)


async def test_a_pickup_beyond_the_horizon_waits_as_scheduled(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both

    delivery_id = await scheduled(gateway)

    assert (await gateway.get(delivery_id))["state"] == "SCHEDULED"
    assert not await gateway.book_next()
    assert gateway.composition.asked == []
    requested, event = await gateway.events(delivery_id)
    assert requested["type"] == "delivery.requested"
    assert event["type"] == "delivery.scheduled"
    assert event["data"] == {
        "earliest_pickup_at": "2026-03-04T12:00:00.000Z",
        "books_from_at": "2026-03-03T12:00:00.000Z",
    }


async def test_a_request_whose_windows_all_open_later_waits_as_scheduled(gateway: Gateway) -> None:
    opens_at = (gateway.clock.now() + timedelta(hours=72)).isoformat()

    delivery_id = await gateway.accepted(window={"not_before_at": opens_at})

    assert (await gateway.get(delivery_id))["state"] == "SCHEDULED"
    assert (await gateway.events(delivery_id))[-1]["data"]["books_from_at"] == (
        "2026-03-03T12:00:00.000Z"
    )


async def test_a_pickup_within_the_horizon_is_booked_immediately(gateway: Gateway) -> None:
    delivery_id = await scheduled(gateway, hours=24)

    assert (await gateway.get(delivery_id))["state"] == "REQUESTED"
    assert await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "PLANNED"


async def test_it_is_booked_when_its_pickup_comes_within_the_horizon(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    delivery_id = await scheduled(gateway)

    gateway.clock.advance(timedelta(hours=47))
    await gateway.parts.schedule_opener.step()
    assert (await gateway.get(delivery_id))["state"] == "SCHEDULED"

    gateway.clock.advance(timedelta(hours=1))
    await gateway.parts.schedule_opener.step()
    assert (await gateway.get(delivery_id))["state"] == "REQUESTED"
    assert await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "PLANNED"


async def test_two_replicas_request_it_once(gateway: Gateway) -> None:
    delivery_id = await scheduled(gateway)
    gateway.clock.advance(timedelta(hours=60))

    await gateway.parts.schedule_opener.step()
    assert await gateway.book_next()
    planned = await gateway.get(delivery_id)
    await gateway.parts.schedule_opener.step()

    assert await gateway.get(delivery_id) == planned
    assert gateway.composition.booking_count == 1


async def test_a_changed_horizon_counts_for_deliveries_that_wait_already(gateway: Gateway) -> None:
    delivery_id = await scheduled(gateway)
    opener = replace(gateway.parts.schedule_opener, horizon=timedelta(hours=100))

    await opener.step()

    assert (await gateway.get(delivery_id))["state"] == "REQUESTED"


async def test_it_is_given_up_an_hour_after_its_pickup(gateway: Gateway) -> None:
    delivery_id = await scheduled(gateway)
    gateway.composition.is_busy = True
    gateway.clock.advance(timedelta(hours=72, minutes=59))
    await gateway.parts.schedule_opener.step()

    await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "REQUESTED"
    # The hour began when the delivery was requested: the gateway was away until then.
    gateway.clock.advance(timedelta(hours=1))
    await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "REJECTED"


async def test_a_scheduled_delivery_can_be_cancelled(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await scheduled(gateway, packages=2)
    path = f"/v1/deliveries/{delivery_id}/cancel"

    one = await gateway.http.post(path, json={"package_ids": ["p1"]}, headers=gateway.customer)
    assert one.json()["state"] == "SCHEDULED"
    both = await gateway.http.post(path, headers=gateway.customer)

    assert both.json()["state"] == "CANCELLED"
    gateway.clock.advance(timedelta(hours=60))
    await gateway.parts.schedule_opener.step()
    assert not await gateway.book_next()
    assert (await gateway.event_types(delivery_id))[-1] == "delivery.cancelled"


async def test_a_cancellation_whose_process_died_is_finished(gateway: Gateway) -> None:
    delivery_id = await scheduled(gateway)
    await gateway.execute("UPDATE deliveries SET cancel_reason = 'ordered twice'")

    await gateway.parts.schedule_opener.step()
    assert await gateway.book_next()

    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "CANCELLED"
    assert delivery["packages"][0]["detail"] == "ordered twice"


async def test_an_accepted_offer_with_a_late_pickup_waits_too(gateway: Gateway) -> None:
    body = make_request(earliest_pickup_at=(START + timedelta(hours=72)).isoformat())
    quote = (await gateway.http.post("/v1/quotes", json=body, headers=gateway.customer)).json()
    chosen = {"quote_id": quote["quote_id"], "offer_id": quote["offers"][0]["offer_id"]}

    accepted = (await gateway.post(chosen)).json()

    assert accepted["state"] == "SCHEDULED"
    assert accepted["offer"]["provider_id"] == "prv_1"


@pytest.mark.parametrize("days", [30.1, 366])
async def test_a_pickup_more_than_thirty_days_ahead_is_refused(
    gateway: Gateway, days: float
) -> None:
    pickup_at = START + timedelta(days=days)

    answer = await gateway.post(make_request(earliest_pickup_at=pickup_at.isoformat()))

    assert answer.status_code == 422
    [error] = answer.json()["errors"]
    assert error["field"] == "earliest_pickup_at"
    assert "the limit of 2026-03-31T12:00:00.000Z, 30 days ahead" in error["detail"]


@pytest.mark.parametrize("hours", [0, -1, float("nan"), float("inf"), 721])
def test_a_horizon_that_is_no_span_up_to_thirty_days_is_refused(hours: float) -> None:
    with pytest.raises(ValidationError, match="booking_horizon_h"):
        GatewaySettings.model_validate(
            {"database_url": "sqlite:///x", "mqtt_url": "mqtt://x", "booking_horizon_h": hours}
        )


def test_a_request_without_an_earliest_pickup_is_never_scheduled() -> None:
    request = DeliveryRequest.model_validate(make_request())
    assert books_from(request, timedelta(hours=24)) is None
