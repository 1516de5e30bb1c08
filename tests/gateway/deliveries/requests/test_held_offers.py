"""Offers are kept or refused when they are accepted, and may be held from the quote on."""

import asyncio
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import httpx
import pytest

from tests.gateway.whole_gateway import Gateway


async def post_quote(gateway: Gateway, body: Any, **headers: str) -> httpx.Response:
    answer: httpx.Response = await gateway.http.post(
        "/v1/quotes", json=body, headers={**gateway.customer, **headers}
    )
    return answer


def choice(quote: Any, number: int = 0) -> dict[str, str]:
    return {"quote_id": quote["quote_id"], "offer_id": quote["offers"][number]["offer_id"]}


@pytest.fixture
async def quote(gateway: Gateway, request_body: Callable[..., Any], candidate: Any) -> Any:
    """A quote with two offers, which are not held."""
    gateway.registry.candidates_now = [candidate("drn_1"), candidate("drn_2", "prv_2")]
    return (await post_quote(gateway, request_body())).json()


@pytest.fixture
async def held_quote(gateway: Gateway, request_body: Callable[..., Any], candidate: Any) -> Any:
    """A quote with two offers that are held."""
    gateway.registry.candidates_now = [candidate("drn_1"), candidate("drn_2", "prv_2")]
    answer = await post_quote(gateway, {**request_body(), "hold": True})
    assert answer.status_code == 201, answer.text
    return answer.json()


async def count(gateway: Gateway, table: str) -> int:
    async with gateway.parts.db.read() as connection:
        found = await connection.exec_driver_sql(f"SELECT count(*) FROM {table}")
        return int(found.scalar_one())


async def test_a_quote_with_hold_says_which_offers_are_held_and_until_when(
    gateway: Gateway, held_quote: Any
) -> None:
    [query] = gateway.composition.quote_queries
    expires_wall_at = gateway.clock.wall_now() + timedelta(seconds=120)

    assert query.hold is not None
    assert (query.hold.customer_id, query.hold.life_s, query.hold.most) == ("alice", 120.0, 3)
    assert [offer["is_held"] for offer in held_quote["offers"]] == [True, True]
    assert held_quote["expires_wall_at"] == expires_wall_at.isoformat().replace("+00:00", "Z")
    assert "hold" not in held_quote["request"]


async def test_a_quote_without_hold_holds_nothing(gateway: Gateway, quote: Any) -> None:
    assert gateway.composition.holds == set()
    assert [offer["is_held"] for offer in quote["offers"]] == [False, False]


async def test_hold_must_be_true_or_false(
    gateway: Gateway, request_body: Callable[..., Any]
) -> None:
    answer = await post_quote(gateway, {**request_body(), "hold": "yes"})

    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == "hold"


async def test_a_pickup_beyond_the_horizon_cannot_be_held(
    gateway: Gateway, request_body: Callable[..., Any]
) -> None:
    later = gateway.clock.now() + timedelta(hours=25)
    body = {**request_body(earliest_pickup_at=later.isoformat()), "hold": True}

    answer = await post_quote(gateway, body)

    assert answer.status_code == 422
    [fault] = answer.json()["errors"]
    assert fault["field"] == "hold"
    assert "horizon of 24 hours" in fault["detail"]


async def test_a_repeated_quote_holds_once_and_gives_the_same_answer(
    gateway: Gateway, request_body: Callable[..., Any]
) -> None:
    body, key = {**request_body(), "hold": True}, {"Idempotency-Key": "one"}

    first = await post_quote(gateway, body, **key)
    again = await post_quote(gateway, body, **key)

    assert again.content == first.content
    assert len(gateway.composition.holds) == 1


async def test_simultaneous_repeats_of_a_quote_leave_one_hold(
    gateway: Gateway, request_body: Callable[..., Any]
) -> None:
    body, key = {**request_body(), "hold": True}, {"Idempotency-Key": "one"}

    answers = await asyncio.gather(*(post_quote(gateway, body, **key) for _ in range(3)))

    assert len({answer.content for answer in answers}) == 1
    assert len(gateway.composition.holds) == 1


async def test_a_customer_with_too_many_holds_is_refused_with_the_limit(
    gateway: Gateway, request_body: Callable[..., Any]
) -> None:
    gateway.composition.holds = {"hld_a", "hld_b", "hld_c"}

    answer = await post_quote(gateway, {**request_body(), "hold": True})

    assert (answer.status_code, answer.json()["code"]) == (409, "TOO_MANY_HOLDS")
    assert "3 quotes" in answer.json()["detail"]
    assert await count(gateway, "quotes") == 0


async def test_a_held_offer_is_booked_with_its_hold(gateway: Gateway, held_quote: Any) -> None:
    answer = await gateway.post(choice(held_quote, 1))
    await gateway.book_next()

    assert answer.status_code == 202
    [kept], [asked] = gateway.composition.kept, gateway.composition.asked
    assert kept.offer.hold is not None
    assert kept.offer.hold.number == 1
    assert asked.offer is not None
    assert asked.offer.hold == kept.offer.hold
    assert (await gateway.get(answer.json()["delivery_id"]))["state"] == "PLANNED"


async def test_an_offer_that_is_not_held_is_held_when_it_is_accepted(
    gateway: Gateway, quote: Any
) -> None:
    answer = await gateway.post(choice(quote))
    await gateway.book_next()

    assert answer.status_code == 202
    [kept], [asked] = gateway.composition.kept, gateway.composition.asked
    assert kept.offer.hold is None
    assert asked.offer is not None
    assert asked.offer.hold is not None
    assert asked.offer.hold.hold_id == kept.hold_id


async def test_a_lost_offer_is_refused_immediately_with_the_next_best_offer(
    gateway: Gateway, quote: Any, reason: Callable[..., Any]
) -> None:
    gateway.composition.lost = [reason("OFFER_LOST", is_temporary=False, provider_id="prv_1")]

    answer = await gateway.post(choice(quote))

    problem, second = answer.json(), quote["offers"][1]
    assert (answer.status_code, problem["code"]) == (409, "OFFER_LOST")
    assert problem["next_offer"]["offer_id"] == second["offer_id"]
    assert second["offer_id"] in problem["detail"]
    assert [each["code"] for each in problem["reasons"]] == ["OFFER_LOST"]
    assert await count(gateway, "deliveries") == 0


async def test_the_next_best_offer_can_be_accepted_after_a_lost_one(
    gateway: Gateway, quote: Any, reason: Callable[..., Any]
) -> None:
    gateway.composition.lost = [reason("OFFER_LOST", is_temporary=False, provider_id="prv_1")]
    await gateway.post(choice(quote))
    gateway.composition.lost = []

    answer = await gateway.post(choice(quote, 1))

    assert answer.status_code == 202


async def test_the_last_offer_of_a_quote_has_no_next_one(
    gateway: Gateway, quote: Any, reason: Callable[..., Any]
) -> None:
    gateway.composition.lost = [reason("OFFER_LOST", is_temporary=False, provider_id="prv_2")]

    answer = await gateway.post(choice(quote, 1))

    assert answer.json()["code"] == "OFFER_LOST"
    assert "next_offer" not in answer.json()
    assert "ask for another quote" in answer.json()["detail"]


async def test_a_repeated_acceptance_gets_the_same_answer_and_asks_nothing(
    gateway: Gateway, quote: Any
) -> None:
    key = {"Idempotency-Key": "one"}
    first = await gateway.post(choice(quote), **key)
    gateway.composition.is_away = True

    again = await gateway.post(choice(quote), **key)

    assert (again.status_code, again.content) == (202, first.content)
    assert len(gateway.composition.kept) == 1


async def test_while_composition_is_away_an_offer_is_not_accepted(
    gateway: Gateway, quote: Any
) -> None:
    key = {"Idempotency-Key": "one"}
    gateway.composition.is_away = True

    refused = await gateway.post(choice(quote), **key)
    gateway.composition.is_away = False
    accepted = await gateway.post(choice(quote), **key)

    assert refused.status_code == 503
    assert refused.headers["retry-after"]
    assert accepted.status_code == 202


@pytest.mark.parametrize("second", [0, 1])
async def test_of_two_simultaneous_acceptances_one_wins_and_the_other_holds_nothing(
    gateway: Gateway, quote: Any, second: int
) -> None:
    answers = await asyncio.gather(*(gateway.post(choice(quote, n)) for n in (0, second)))

    assert sorted(answer.status_code for answer in answers) == [202, 409]
    [refused] = [answer for answer in answers if answer.status_code == 409]
    [accepted] = [answer for answer in answers if answer.status_code == 202]
    assert refused.json()["code"] == "QUOTE_TAKEN"
    assert gateway.composition.holds == {accepted.json()["offer"]["hold"]["hold_id"]}
    assert await count(gateway, "deliveries") == 1


async def test_each_call_for_an_offer_names_the_same_hold(
    gateway: Gateway, quote: Any, reason: Callable[..., Any]
) -> None:
    gateway.composition.lost = [reason("BUSY", is_temporary=True, provider_id="prv_1")]
    await gateway.post(choice(quote))
    gateway.composition.lost = []
    await gateway.post(choice(quote))

    first, again = gateway.composition.kept
    assert first.hold_id == again.hold_id


async def test_an_offer_that_is_held_for_another_customer_is_unknown(
    gateway: Gateway, held_quote: Any
) -> None:
    answer = await gateway.http.post(
        "/v1/deliveries", json=choice(held_quote), headers=gateway.other
    )

    assert answer.status_code == 404
    assert gateway.composition.kept == []


async def test_an_expired_offer_asks_composition_nothing(gateway: Gateway, quote: Any) -> None:
    gateway.clock.advance(timedelta(seconds=121))

    answer = await gateway.post(choice(quote))

    assert answer.json()["code"] == "QUOTE_EXPIRED"
    assert gateway.composition.kept == []


async def test_a_waiting_request_is_woken_when_a_hold_ends(
    gateway: Gateway, held_quote: Any
) -> None:
    waker = gateway.parts.waker
    gateway.composition.is_busy = True
    await gateway.accepted()
    await gateway.book_next()
    await waker.step()
    assert not await gateway.book_next()

    gateway.clock.advance(timedelta(seconds=9))
    await waker.step()
    assert not await _is_due_now(gateway)
    gateway.clock.advance(timedelta(seconds=117))
    await waker.step()

    assert await _is_due_now(gateway)


async def _is_due_now(gateway: Gateway) -> bool:
    async with gateway.parts.db.read() as connection:
        found = await connection.exec_driver_sql("SELECT next_try_wall_ms FROM deliveries")
        return int(found.scalar_one()) == 0
