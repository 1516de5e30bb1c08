"""Requests that find no drone wait in order, and are woken by what may help them."""

import random
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from skyway_gateway.deliveries.booking.wake_waiting import next_try_at, retry_at

from skyway.contracts.candidate import ProviderReason
from skyway.ids import DeliveryId, ProviderId
from tests.gateway.deliveries.booking.connections import connection
from tests.gateway.peers import make_candidate
from tests.gateway.whole_gateway import Gateway

NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)


async def waiting(gateway: Gateway, **changes: Any) -> str:
    """The id of a delivery that found no drone."""
    gateway.composition.is_busy = True
    delivery_id = await gateway.accepted(**changes)
    while await gateway.book_next():
        pass
    return delivery_id


async def place_of(gateway: Gateway, delivery_id: str) -> int | None:
    shown = (await gateway.get(delivery_id))["waiting"]
    return None if shown is None else int(shown["place"])


async def quiet(gateway: Gateway) -> None:
    """Let so much time pass that nothing is due for some seconds."""
    await gateway.parts.waker.step()
    for seconds in (3, 6, 12):
        gateway.clock.advance(timedelta(seconds=seconds))
        while await gateway.book_next():
            pass
    assert not await gateway.book_next()


async def wakes(gateway: Gateway) -> bool:
    """Whether something was noted since the last look that wakes requests."""
    return await gateway.parts.waker.noted.wait(0)


async def test_the_registry_is_asked_once_about_all_requests_of_a_line(gateway: Gateway) -> None:
    standard = DeliveryId(await waiting(gateway))
    pinned = {"priority": "PRIORITY", "providers": {"pinned": "prv_2"}}
    gateway.registry.candidates_now += [make_candidate("drn_2", provider_id="prv_2")]
    urgent = DeliveryId(await waiting(gateway, qos=pinned))
    gateway.parts.waker.note_change()
    await gateway.parts.waker.step()
    line = await gateway.parts.booker.claim(limit=9)
    gateway.registry.lists.clear()

    found = await gateway.parts.booker.candidates_of(line)
    gateway.registry.is_away = True

    assert [len(asked.queries) for asked in gateway.registry.lists] == [2]
    assert {each: found[each].shortlist.drone_ids for each in found} == {
        urgent: ("drn_2",),
        standard: ("drn_1", "drn_2"),
    }
    assert await gateway.parts.booker.candidates_of(line) == {}


async def test_a_waiting_request_shows_when_the_first_drone_is_free(gateway: Gateway) -> None:
    times = ("2026-03-02T14:00:00Z", "2026-03-02T13:00:00Z")
    gateway.composition.reasons = [
        ProviderReason(
            provider_id=ProviderId(f"prv_{number}"),
            code="BUSY",
            detail="busy",
            is_temporary=True,
            data={"free_at": free_at},
        )
        for number, free_at in enumerate(times, 1)
    ]

    delivery_id = await waiting(gateway)

    shown = (await gateway.get(delivery_id))["waiting"]
    assert shown["earliest_start_at"] == "2026-03-02T13:00:00Z"


@pytest.mark.parametrize(
    ("since_s", "next_s"),
    [
        (-1.0, 0.5),
        (0.0, 0.5),
        (0.01, 0.5),
        (0.5, 1.0),
        (0.51, 1.0),
        (1.2, 2.0),
        (3.0, 4.0),
        (4.0, 8.0),
        (8.0, 18.0),
        (8.01, 18.0),
        (18.3, 28.0),
        (100.0, 108.0),
    ],
)
def test_requests_woken_together_are_tried_at_the_same_moments(
    since_s: float, next_s: float
) -> None:
    now = NOON + timedelta(seconds=since_s)

    assert next_try_at(woken_at=NOON, now=now) == NOON + timedelta(seconds=next_s)


async def test_waiting_requests_show_their_place_and_since_when_they_wait(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    first = await waiting(gateway)
    gateway.clock.advance(timedelta(seconds=1))
    urgent = await waiting(gateway, qos={"priority": "PRIORITY"})
    second = await waiting(gateway)

    assert [await place_of(gateway, each) for each in (first, urgent, second)] == [1, 1, 2]
    assert (await gateway.get(first))["waiting"]["since_at"] == "2026-03-01T12:00:00Z"
    listed = await gateway.http.get("/v1/deliveries", headers=gateway.customer)
    places = {each["delivery_id"]: each["waiting"]["place"] for each in listed.json()["items"]}
    assert places == {first: 1, urgent: 1, second: 2}

    gateway.composition.is_busy = False
    gateway.clock.advance(timedelta(seconds=30))
    while await gateway.book_next():
        pass
    assert await place_of(gateway, first) is None


async def test_the_end_of_a_mission_wakes_the_first_who_asked(
    gateway_on_both: Gateway, candidate: Callable[..., Any]
) -> None:
    gateway = gateway_on_both
    gateway.registry.candidates_now = [candidate("drn_1"), candidate("drn_2")]
    flown = await gateway.planned()
    first, second = await waiting(gateway), await waiting(gateway)
    await quiet(gateway)

    assert (await gateway.report(flown, "ACCEPTED", seq=1)).status_code == 204
    await gateway.parts.waker.step()
    assert not await gateway.book_next()
    assert (await gateway.report(flown, "REFUSED", seq=2)).status_code == 204
    await gateway.parts.waker.step()
    gateway.composition.is_busy = False
    while await gateway.book_next():
        await gateway.parts.waker.step()

    # The refused delivery asked before the others.
    assert [one for one, _ in gateway.composition.booked] == [flown, flown, first, second]


async def test_a_change_wakes_only_a_few(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    ids = [await waiting(gateway) for _ in range(6)]
    urgent = await waiting(gateway, qos={"priority": "PRIORITY"})
    await quiet(gateway)

    gateway.parts.waker.note_change()
    await gateway.parts.waker.step()
    due = await gateway.parts.booker.claim(limit=20)

    assert [each.delivery.delivery_id for each in due] == [urgent, *ids[:3]]


async def test_a_wake_during_a_try_is_not_lost(gateway: Gateway) -> None:
    delivery_id = await waiting(gateway)
    await quiet(gateway)
    gateway.clock.advance(timedelta(seconds=10))
    [queued] = await gateway.parts.booker.claim(limit=1)

    gateway.parts.waker.note_change()
    await gateway.parts.waker.step()
    await gateway.parts.booker.book_or_retry(queued)

    gateway.composition.is_busy = False
    assert await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "PLANNED"


async def test_a_new_request_stands_behind_those_that_wait(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    first = await waiting(gateway)
    await quiet(gateway)
    gateway.composition.is_busy = False
    later = await gateway.accepted()

    assert await gateway.book_next(), "the new request lines up"
    assert (await gateway.get(later))["waiting"]["place"] == 2
    await gateway.parts.waker.step()
    assert await gateway.book_next()

    assert (await gateway.get(first))["state"] == "PLANNED"
    assert (await gateway.get(later))["state"] == "REQUESTED"
    assert await gateway.book_next()
    assert (await gateway.get(later))["state"] == "PLANNED"


async def test_a_change_through_the_gateway_wakes_them(gateway: Gateway) -> None:
    delivery_id = await waiting(gateway)
    await quiet(gateway)

    closure = "/v1/stations/bulverde/closures/clo_1"
    await gateway.http.get("/v1/stations", headers=gateway.operator)
    await gateway.parts.waker.step()
    assert not await gateway.book_next()
    await gateway.http.delete(closure, headers=gateway.operator)
    await gateway.parts.waker.step()

    gateway.composition.is_busy = False
    assert await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "PLANNED"


async def test_only_a_drone_that_comes_online_wakes_them(gateway: Gateway) -> None:
    async def connections() -> Any:
        yield [connection("drn_1", "LOST")]
        yield [connection("drn_2", "LOST"), connection("drn_1", "ONLINE")]

    await waiting(gateway)
    await quiet(gateway)
    with pytest.raises(StopAsyncIteration):
        await gateway.parts.waker.follow(connections())
    await gateway.parts.waker.step()

    assert await gateway.book_next()


async def test_a_drone_that_reports_itself_online_again_and_again_wakes_them_once(
    gateway: Gateway,
) -> None:
    async def connections() -> Any:
        for status in ("ONLINE", "ONLINE", "LOST", "ONLINE") * 10:
            yield [connection("drn_1", status)]
            if await wakes(gateway):
                woken.append(status)

    woken: list[str] = []
    await waiting(gateway)
    await quiet(gateway)
    with pytest.raises(StopAsyncIteration):
        await gateway.parts.waker.follow(connections())

    assert woken == ["ONLINE"]


async def test_a_cancelled_request_gives_its_place_away(gateway: Gateway) -> None:
    first, second = await waiting(gateway), await waiting(gateway)

    path = f"/v1/deliveries/{first}/cancel"
    assert (await gateway.http.post(path, headers=gateway.customer)).status_code == 200

    assert await place_of(gateway, first) is None
    assert await place_of(gateway, second) == 1


async def test_changes_are_kept_while_the_database_is_away(gateway: Gateway) -> None:
    await waiting(gateway)
    await quiet(gateway)
    waker = gateway.parts.waker
    waker.note_change()
    await gateway.execute("ALTER TABLE deliveries RENAME TO elsewhere")
    with pytest.raises(Exception, match="deliveries"):
        await waker.step()
    await gateway.execute("ALTER TABLE elsewhere RENAME TO deliveries")

    await waker.step()

    assert await gateway.book_next()


def test_the_pause_after_a_lost_answer_grows_with_its_age() -> None:
    chance = random.Random(1)

    def longest_s(age_s: float) -> float:
        asked_at = NOON - timedelta(seconds=age_s)
        tries = [retry_at(NOON, asked_at=asked_at, chance=chance) - NOON for _ in range(200)]
        assert min(tries).total_seconds() >= min(age_s / 4, 5.0)
        return max(tries).total_seconds()

    assert longest_s(1) <= 3.0
    assert 5.5 < longest_s(12) <= 6.0
    assert 9.0 < longest_s(3600) <= 10.0
