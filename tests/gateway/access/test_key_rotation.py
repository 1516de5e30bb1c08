"""The holder of a key rotates it: the old key ends when the next one is first used."""

import asyncio
from datetime import timedelta
from typing import Any

import pytest
from skyway_gateway.access import store
from skyway_gateway.access.recognise import CachedKeys

from skyway.ids import KeyId
from skyway.runtime.http.identity import KeyHolder, RefusedKey
from tests.gateway.access.key_calls import bearer, make_key, rotate, status_of
from tests.gateway.whole_gateway import START, Gateway

pytestmark = pytest.mark.databases("sqlite")


async def next_key(gateway: Gateway, issued: Any, **headers: str) -> dict[str, Any]:
    answer = await rotate(gateway, issued, **headers)
    assert answer.status_code == 201, answer.text
    found: dict[str, Any] = answer.json()
    return found


async def test_the_next_key_has_the_rights_of_the_old_one(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    end = (START + timedelta(days=30)).isoformat()
    old = await make_key(
        gateway, name="laptop", scopes=["account:write", "account:read"], expires_wall_at=end
    )

    new = await next_key(gateway, old)

    for name in ("role", "subject_id", "name", "scopes", "expires_wall_at"):
        assert new[name] == old[name], name
    assert (new["replaces"], new["mqtt"]) == (old["key_id"], None)
    assert new["key"] != old["key"]


async def test_the_old_key_ends_when_the_next_one_is_first_used(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    old = await make_key(gateway)
    new = await next_key(gateway, old)
    before = await status_of(gateway, old)

    first = await status_of(gateway, new)

    assert (before, first, await status_of(gateway, old)) == (200, 200, 401)
    assert await status_of(gateway, new) == 200
    await gateway.parts.keys.close_orphaned_accounts()
    assert set(gateway.registry.accounts) == {"carol"}


async def test_another_replica_refuses_the_old_key_within_a_second(gateway: Gateway) -> None:
    old = await make_key(gateway)
    replica = CachedKeys(gateway.parts.db, gateway.clock)
    assert isinstance(await replica.recognise(old["key"]), KeyHolder)
    new = await next_key(gateway, old)
    await status_of(gateway, new)

    gateway.clock.advance(timedelta(seconds=1))

    refused = await replica.recognise(old["key"])
    assert isinstance(refused, RefusedKey)
    assert refused.reason == "revoked"


async def test_the_old_key_ends_after_a_day_at_the_latest(gateway: Gateway) -> None:
    old = await make_key(gateway)
    await next_key(gateway, old)
    gateway.clock.advance(timedelta(hours=23))
    new = await next_key(gateway, old)  # does not begin another day
    before = await status_of(gateway, old)

    gateway.clock.advance(timedelta(hours=1))

    assert (before, await status_of(gateway, old)) == (200, 401)
    assert await status_of(gateway, new) == 200


async def test_a_second_rotation_replaces_the_next_key(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    old = await make_key(gateway)
    lost = await next_key(gateway, old)

    new = await next_key(gateway, old)

    assert await status_of(gateway, lost) == 401
    assert await status_of(gateway, old) == 200
    assert await status_of(gateway, new) == 200
    assert await status_of(gateway, old) == 401


async def test_a_repeated_rotation_is_answered_the_same_to_this_key_only(gateway: Gateway) -> None:
    old, other = await make_key(gateway), await make_key(gateway)
    new = await next_key(gateway, old, **{"Idempotency-Key": "k"})

    assert await next_key(gateway, old, **{"Idempotency-Key": "k"}) == new
    foreign = await next_key(gateway, other, **{"Idempotency-Key": "k"})
    assert foreign["replaces"] == other["key_id"]


async def test_deleting_a_key_deletes_its_next_key(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    stolen = await make_key(gateway)
    new = await next_key(gateway, stolen)

    path = f"/v1/keys/{stolen['key_id']}"
    assert (await gateway.http.delete(path, headers=gateway.operator)).status_code == 204

    assert await status_of(gateway, stolen) == 401
    assert await status_of(gateway, new) == 401


async def test_a_late_rotation_of_the_old_key_does_not_end_a_key_in_use(gateway: Gateway) -> None:
    old = await make_key(gateway)
    new = await next_key(gateway, old)
    assert await status_of(gateway, new) == 200

    async with gateway.parts.db.write() as tx:
        await store.end_next(tx, KeyId(old["key_id"]), at=gateway.clock.wall_now())
    gateway.clock.advance(timedelta(seconds=10))  # what was cached of the key is forgotten

    assert await status_of(gateway, new) == 200


async def test_a_rotation_keeps_the_shorter_expiry(gateway: Gateway) -> None:
    end = (START + timedelta(seconds=60)).isoformat()
    old = await make_key(gateway, expires_wall_at=end)
    new = await next_key(gateway, old)

    gateway.clock.advance(timedelta(seconds=60))

    assert await status_of(gateway, new) == 401
    assert await status_of(gateway, old) == 401


async def test_rotations_do_not_count_as_keys(gateway: Gateway) -> None:
    old = await make_key(gateway)
    await next_key(gateway, old)

    shown = (await gateway.http.get("/v1/limits", headers=bearer(old))).json()

    [quota] = [each for each in shown["quotas"] if each["code"] == "TOO_MANY_KEYS"]
    assert quota["used"] == 1


async def test_rotations_at_the_same_time_leave_one_next_key(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    old = await make_key(gateway)

    made = await asyncio.gather(*(next_key(gateway, old) for _ in range(4)))

    found = [await status_of(gateway, each) for each in made]
    assert sorted(found) == [200, 401, 401, 401]


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_next_key_is_first_used_by_several_calls_together(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    new = await next_key(gateway, await make_key(gateway))
    replicas = [CachedKeys(gateway.parts.db, gateway.clock) for _ in range(4)]

    found = await asyncio.gather(*(each.recognise(new["key"]) for each in replicas))

    assert all(isinstance(each, KeyHolder) for each in found)


@pytest.mark.parametrize("role", ["provider", "operator", "customer"])
async def test_each_holder_rotates_its_own_key(gateway: Gateway, role: str) -> None:
    headers = getattr(gateway, role)

    answer = await gateway.http.post("/v1/keys/rotations", headers=headers)

    assert answer.status_code == 201
    assert answer.json()["role"] == role


async def test_a_key_without_the_scope_cannot_rotate_itself(gateway: Gateway) -> None:
    issued = await make_key(gateway, scopes=["deliveries:read"])

    assert (await rotate(gateway, issued)).json()["scope"] == "account:write"


async def test_a_key_that_was_rotated_gives_no_right_beyond_its_own_end(gateway: Gateway) -> None:
    old = await make_key(gateway, role="operator", subject_id="dora")
    await next_key(gateway, old)
    requested = {"role": "operator", "subject_id": "mallory"}
    soon = (START + timedelta(hours=1)).isoformat()

    endless = await gateway.http.post("/v1/keys", json=requested, headers=bearer(old))
    ending = await gateway.http.post(
        "/v1/keys", json={**requested, "expires_wall_at": soon}, headers=bearer(old)
    )

    assert endless.status_code == 403
    assert "no later end than its own" in endless.json()["detail"]
    assert ending.status_code == 201
