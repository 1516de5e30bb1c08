"""Recognising keys: they are cached for a second; keys of drones are never cached."""

import asyncio
from datetime import timedelta

import pytest

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
    cached = gateway.parts.cached_keys
    lookup = asyncio.create_task(cached.caller_of("sk_customer"))
    await asyncio.sleep(0)  # it has begun

    cached.forget()
    await lookup
    await gateway.execute(DELETED_ELSEWHERE)

    assert await status(gateway) == 401


#: All calls that a drone may make; the services check what is its own.
ALLOWED = {
    ("GET", "/v1/clock"),
    ("GET", "/v1/missions"),
    ("GET", "/v1/missions/{mission_id}"),
    ("GET", "/v1/networks/{network_id}/stations"),
    ("GET", "/v1/providers/{provider_id}/drones/{drone_id}"),
    ("GET", "/v1/providers/{provider_id}/drones/{drone_id}/telemetry"),
    ("GET", "/v1/stations/{station_id}/pads"),
    ("POST", "/v1/enrolments"),
    ("POST", "/v1/enrolments/rotations"),
}


async def test_a_revoked_key_stops_with_the_next_call(gateway: Gateway) -> None:
    before = await gateway.http.get("/v1/clock", headers=gateway.drone)

    gateway.registry.drone_keys.clear()

    after = await gateway.http.get("/v1/clock", headers=gateway.drone)
    assert (before.status_code, after.status_code) == (200, 401)


async def test_a_drone_key_works_again_after_the_registry_was_away(gateway: Gateway) -> None:
    gateway.registry.is_away = True

    answer = await gateway.http.get("/v1/clock", headers=gateway.drone)

    assert answer.status_code == 503


@pytest.mark.parametrize("key", ["dk_", "dk_unknown", "sk_drone", "drn_1"])
async def test_an_invented_drone_key_is_refused(gateway: Gateway, key: str) -> None:
    answer = await gateway.http.get("/v1/clock", headers={"Authorization": f"Bearer {key}"})

    assert answer.status_code == 401


async def test_a_drone_may_make_only_the_listed_calls(
    gateway: Gateway, subtests: pytest.Subtests
) -> None:
    ids = dict.fromkeys(("pad",), "0")
    for path, operations in (await gateway.http.get("/openapi.json")).json()["paths"].items():
        for method in (name.upper() for name in operations):
            with subtests.test(f"{method} {path}"):
                url = "/".join(
                    ids.get(level[1:-1], "x_1") if level.startswith("{") else level
                    for level in path.split("/")
                )

                answer = await gateway.http.request(method, url, json={}, headers=gateway.drone)

                is_allowed = (method, path) in ALLOWED or not path.startswith("/v1/")
                # A call that reads its body first may refuse the empty body before the role.
                refused = {403, 422} if not is_allowed else {403}
                assert (answer.status_code in refused) is not is_allowed, answer.text
