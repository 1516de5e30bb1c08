"""Above its capacity the gateway refuses new requests before it accepts them, and nothing else."""

import pytest
from skyway_gateway.deliveries.booking.queue_store import unanswered
from skyway_gateway.deliveries.booking.run_bookings import BookingLoop

from skyway.runtime.errors import Overloaded
from skyway.runtime.loops import Wake
from tests.gateway.deliveries.booking.slow_pace import slow_pace
from tests.gateway.whole_gateway import Gateway, make_request


def _slow_loop(round_s: float, *, most: int = 4) -> BookingLoop:
    """A loop whose last rounds took so many seconds each."""
    loop = BookingLoop(Wake(), claimant="bkr_1", most=most)
    loop.pace = slow_pace(round_s, most=most)
    return loop


def _admitted(loop: BookingLoop, *, replicas: int = 1) -> int:
    """How many requests come in until one is refused."""
    for number in range(1_000):
        try:
            loop.must_have_room(replicas=replicas)
        except Overloaded:
            return number
        loop.note_accepted()
    raise AssertionError("nothing was refused")


def test_a_request_is_refused_when_it_would_wait_longer_than_six_seconds() -> None:
    assert _admitted(_slow_loop(2.0)) == 13  # the 14th would wait for 13 rounds of 0.5 s
    assert _admitted(_slow_loop(20.0)) == 2
    assert _admitted(_slow_loop(2.0), replicas=3) == 37


def test_a_refusal_says_when_to_come_again() -> None:
    loop = _slow_loop(20.0)
    loop.note_accepted()
    with (
        pytest.raises(Overloaded, match="would wait 10 s, longer than 6 s") as refused,
        loop.arriving(),
    ):
        loop.must_have_room(replicas=1)

    assert refused.value.retry_after_s == 4.0
    loop.must_have_room(replicas=1)  # the request that was arriving was not accepted


def test_requests_are_accepted_while_no_round_has_shown_how_long_it_takes() -> None:
    loop = BookingLoop(Wake(), claimant="bkr_1", most=4)
    for _ in range(1_000):
        loop.note_accepted()

    loop.must_have_room(replicas=1)


async def test_only_untried_requests_and_lost_answers_are_counted(gateway: Gateway) -> None:
    await gateway.planned()
    gateway.composition.is_busy = True
    await gateway.accepted()
    await gateway.book_next()  # it waits for a drone
    gateway.composition.is_busy = False
    assert await unanswered(gateway.parts.db) == 0
    await gateway.accepted()
    assert await unanswered(gateway.parts.db) == 1
    await gateway.book_next()  # it stands behind the other one, and was not tried
    assert await unanswered(gateway.parts.db) == 1

    gateway.composition.is_away = True
    while await gateway.book_next():
        pass
    assert await unanswered(gateway.parts.db) == 1
    gateway.composition.is_away = False
    await gateway.accepted()
    assert await unanswered(gateway.parts.db) == 2


async def test_a_gateway_above_its_capacity_refuses_only_new_requests(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted()
    gateway.parts.booking.pace = slow_pace(1e6)
    body = make_request()
    shed = await gateway.post(body)

    assert (shed.status_code, shed.json()["code"]) == (503, "OVERLOADED")
    assert int(shed.headers["Retry-After"]) > 1
    assert (await gateway.get(delivery_id))["state"] == "REQUESTED"
    path = f"/v1/deliveries/{delivery_id}/cancel"
    cancelled = await gateway.http.post(path, headers=gateway.customer)
    assert cancelled.status_code == 200
    listed = await gateway.http.get("/v1/deliveries", headers=gateway.customer)
    assert [each["delivery_id"] for each in listed.json()["items"]] == [delivery_id]


async def test_a_refusal_looks_at_neither_key_nor_body(gateway: Gateway) -> None:
    await gateway.accepted()
    gateway.parts.booking.pace = slow_pace(1e6)

    assert (await gateway.http.post("/v1/deliveries", content=b"{")).status_code == 503
