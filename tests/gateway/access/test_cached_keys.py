"""Keys are remembered for a moment, and not a moment longer."""

import asyncio
from datetime import timedelta

from tests.gateway.whole_gateway import Gateway

DELETED_ELSEWHERE = "UPDATE api_keys SET deleted_wall_ms = 1 WHERE key_id = 'key_customer'"


async def status(gateway: Gateway) -> int:
    answer = await gateway.http.get("/v1/deliveries", headers=gateway.customer)
    return int(answer.status_code)


async def test_a_key_that_another_replica_deletes_stops_within_a_second(gateway: Gateway) -> None:
    before = await status(gateway)
    await gateway.execute(DELETED_ELSEWHERE)
    gateway.clock.advance(timedelta(seconds=1))

    assert (before, await status(gateway)) == (200, 401)


async def test_a_key_that_is_deleted_here_stops_immediately(gateway: Gateway) -> None:
    before = await status(gateway)
    await gateway.http.delete("/v1/keys/key_customer", headers=gateway.operator)

    assert (before, await status(gateway)) == (200, 401)


async def test_a_key_that_is_deleted_during_its_lookup_is_not_cached(gateway: Gateway) -> None:
    known = gateway.parts.cached_keys
    lookup = asyncio.create_task(known.caller_of("sk_customer"))
    await asyncio.sleep(0)  # it has begun

    known.forget()
    await lookup
    await gateway.execute(DELETED_ELSEWHERE)

    assert await status(gateway) == 401
