"""Turns: the first in order is next, other networks do not wait, nobody who left holds it up."""

import asyncio
from datetime import UTC, datetime, timedelta
from typing import Any

from skyway_composition.missions.booking.turns import AskingOrder, Turns

from skyway.contracts.mission import BookMissions
from skyway.contracts.shortlist import Shortlist
from skyway.ids import DeliveryId, NetworkId

NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)
CITY, COAST = NetworkId("city"), NetworkId("coast")


def order(minute: int, *, rank: int = 1, delivery_id: str = "dlv_1") -> AskingOrder:
    return AskingOrder(rank, NOON + timedelta(minutes=minute), DeliveryId(delivery_id))


class Bookings:
    """Bookings that note when they get their turn, and end when a test opens their gate."""

    def __init__(self) -> None:
        self.turns = Turns()
        self.begun: list[str] = []
        self.gates: dict[str, asyncio.Event] = {}
        self.tasks: dict[str, asyncio.Task[None]] = {}

    async def start(self, name: str, place: AskingOrder, network_id: NetworkId = CITY) -> None:
        self.gates[name] = asyncio.Event()
        self.tasks[name] = asyncio.create_task(self._book(name, place, network_id))
        await _settle()

    async def end(self, name: str) -> None:
        self.gates[name].set()
        await self.tasks[name]
        await _settle()

    async def cancel(self, name: str) -> None:
        self.tasks[name].cancel()
        await asyncio.gather(self.tasks[name], return_exceptions=True)
        await _settle()

    async def _book(self, name: str, place: AskingOrder, network_id: NetworkId) -> None:
        with self.turns.line_up(network_id, place) as turn:
            await turn.comes()
            self.begun.append(name)
            await self.gates[name].wait()


async def _settle() -> None:
    for _ in range(5):
        await asyncio.sleep(0)


async def test_waiting_bookings_get_their_turn_in_the_order_of_asking() -> None:
    bookings = Bookings()
    for name, minute in (("first to come", 9), ("late", 3), ("early", 1), ("middle", 2)):
        await bookings.start(name, order(minute))
    assert bookings.begun == ["first to come"]

    for name in ("first to come", "early", "middle", "late"):
        await bookings.end(name)

    assert bookings.begun == ["first to come", "early", "middle", "late"]


async def test_priority_comes_before_standard_and_the_id_decides_last() -> None:
    bookings = Bookings()
    await bookings.start("now", order(0))
    await bookings.start("standard b", order(1, delivery_id="b"))
    await bookings.start("standard a", order(1, delivery_id="a"))
    await bookings.start("priority", order(5, rank=0))

    for name in ("now", "priority", "standard a", "standard b"):
        await bookings.end(name)

    assert bookings.begun == ["now", "priority", "standard a", "standard b"]


async def test_a_booking_waits_for_an_earlier_one_that_is_still_being_planned() -> None:
    bookings = Bookings()
    with bookings.turns.line_up(CITY, order(0)):
        await bookings.start("later", order(1))
        assert bookings.begun == []
    await _settle()

    assert bookings.begun == ["later"]
    await bookings.end("later")


async def test_bookings_of_another_network_do_not_wait() -> None:
    bookings = Bookings()
    await bookings.start("city", order(0))

    await bookings.start("coast", order(1), COAST)

    assert bookings.begun == ["city", "coast"]
    await bookings.end("coast")
    await bookings.end("city")


async def test_a_booking_that_is_cancelled_while_it_waits_is_passed_over() -> None:
    bookings = Bookings()
    for name, minute in (("now", 0), ("gone", 1), ("next", 2)):
        await bookings.start(name, order(minute))

    await bookings.cancel("gone")
    await bookings.end("now")

    assert bookings.begun == ["now", "next"]
    await bookings.end("next")


async def test_a_booking_that_is_cancelled_in_its_turn_passes_the_turn_on() -> None:
    bookings = Bookings()
    for name, minute in (("now", 0), ("next", 1)):
        await bookings.start(name, order(minute))

    await bookings.cancel("now")

    assert bookings.begun == ["now", "next"]
    await bookings.end("next")


async def test_a_booking_that_is_cancelled_just_as_it_gets_its_turn_passes_it_on() -> None:
    bookings = Bookings()
    for name, minute in (("now", 0), ("gone", 1), ("next", 2)):
        await bookings.start(name, order(minute))

    bookings.gates["now"].set()
    await bookings.tasks["now"]
    bookings.tasks["gone"].cancel()
    await _settle()

    assert bookings.begun[-1] == "next"
    await bookings.end("next")


async def test_two_calls_for_one_delivery_both_get_a_turn() -> None:
    bookings = Bookings()
    for name in ("now", "call", "repeated call"):
        await bookings.start(name, order(0))

    for name in ("now", "call", "repeated call"):
        await bookings.end(name)

    assert bookings.begun == ["now", "call", "repeated call"]


def test_the_order_is_by_class_then_by_asking(make: Any) -> None:
    def place(priority: str, asked_at: datetime | None) -> AskingOrder:
        request = make.request("c", qos={"priority": priority})
        asked = BookMissions(
            attempt=1, request=request, shortlist=Shortlist.of(()), asked_at=asked_at
        )
        return AskingOrder.of(DeliveryId("dlv_1"), asked, NOON)

    later = NOON + timedelta(minutes=1)
    assert place("PRIORITY", later) < place("STANDARD", NOON - timedelta(days=1))
    assert place("STANDARD", NOON - timedelta(minutes=1)) < place("STANDARD", None)
    assert place("STANDARD", None) < place("STANDARD", later)


async def _asked(composition: Any, make: Any, name: str, minute: int) -> Any:
    body = BookMissions(
        attempt=1,
        request=make.request("c"),
        shortlist=Shortlist.of([make.candidate()]),
        asked_at=NOON + timedelta(minutes=minute),
    )
    return await composition.parts.bookings.book(DeliveryId(name), body)


async def test_the_customer_that_asked_first_gets_the_only_drone(
    composition: Any, make: Any
) -> None:
    row = NetworkId("row")
    with composition.parts.turns.line_up(row, order(0)):
        late = asyncio.create_task(_asked(composition, make, "dlv_late", 9))
        early = asyncio.create_task(_asked(composition, make, "dlv_early", 1))
        async with asyncio.timeout(60):
            while composition.parts.turns.waiting(row) < 2:  # noqa: ASYNC110 - the tasks go on
                await asyncio.sleep(0)

    [first], [second] = (await early).missions, (await late).missions
    assert (first.state, second.state) == ("BOOKED", "QUEUED")
    assert first.start_at < second.start_at


async def test_a_repeated_call_does_not_wait_for_a_turn(composition: Any, make: Any) -> None:
    first = await _asked(composition, make, "dlv_1", 1)

    with composition.parts.turns.line_up(NetworkId("row"), order(0)):
        assert await _asked(composition, make, "dlv_1", 1) == first
