"""A broker account does not outlive the key that gave it its password."""

from typing import Any

import pytest
from skyway_gateway.access.account_store import account_is_open

from skyway.ids import KeyId, SubjectId
from tests.gateway.access.key_calls import make_key, rotate, status_of
from tests.gateway.whole_gateway import Gateway

pytestmark = pytest.mark.databases("sqlite")


async def delete(gateway: Gateway, issued: Any) -> None:
    path = f"/v1/keys/{issued['key_id']}"
    assert (await gateway.http.delete(path, headers=gateway.operator)).status_code == 204
    await gateway.parts.keys.close_orphaned_accounts()


async def next_key(gateway: Gateway, issued: Any, **headers: str) -> Any:
    answer = await rotate(gateway, issued, **headers)
    assert answer.status_code == 201, answer.text
    return answer.json()


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_stolen_keys_password_ends_with_it_although_another_key_stays(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    await make_key(gateway)
    stolen = await make_key(gateway)

    await delete(gateway, stolen)

    assert gateway.registry.accounts == {}


async def test_a_password_of_a_later_key_stays_when_an_earlier_key_ends(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    stolen = await make_key(gateway)
    later = await make_key(gateway)

    await delete(gateway, stolen)

    assert gateway.registry.accounts == {"carol": later["mqtt"]["password"]}


@pytest.mark.parametrize("role", ["customer", "operator"])
@pytest.mark.databases("sqlite", "postgresql")
async def test_a_rotation_gives_the_account_a_new_password(
    gateway_on_both: Gateway, role: str
) -> None:
    gateway = gateway_on_both
    old = await make_key(gateway, role=role)

    new = await next_key(gateway, old)
    await status_of(gateway, new)
    await gateway.parts.keys.close_orphaned_accounts()

    assert new["mqtt"]["user_name"] == old["mqtt"]["user_name"]
    assert new["mqtt"]["password"] != old["mqtt"]["password"]
    assert gateway.registry.accounts == {new["mqtt"]["user_name"]: new["mqtt"]["password"]}


async def test_a_second_rotation_gives_another_password(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    old = await make_key(gateway)
    await next_key(gateway, old)

    new = await next_key(gateway, old)
    await gateway.parts.keys.close_orphaned_accounts()

    assert gateway.registry.accounts == {"carol": new["mqtt"]["password"]}


async def test_a_rotation_leaves_the_password_of_another_key(gateway: Gateway) -> None:
    old = await make_key(gateway)
    other = await make_key(gateway)

    assert (await next_key(gateway, old))["mqtt"] is None
    assert gateway.registry.accounts == {"carol": other["mqtt"]["password"]}


async def test_a_rotation_opens_an_account_again_that_ended_with_another_key(
    gateway: Gateway,
) -> None:
    kept = await make_key(gateway)
    await delete(gateway, await make_key(gateway))

    new = await next_key(gateway, kept)

    assert gateway.registry.accounts == {"carol": new["mqtt"]["password"]}


async def test_a_rotation_is_repeated_when_the_registry_is_back(gateway: Gateway) -> None:
    old = await make_key(gateway)
    gateway.registry.is_away = True
    assert (await rotate(gateway, old, **{"Idempotency-Key": "k"})).status_code == 503
    gateway.registry.is_away = False

    new = await next_key(gateway, old, **{"Idempotency-Key": "k"})

    assert gateway.registry.accounts == {"carol": new["mqtt"]["password"]}


async def test_a_deleted_key_whose_next_password_was_refused_ends_the_account(
    gateway: Gateway,
) -> None:
    """The registry still has the first password when the rotation did not reach it."""
    await make_key(gateway)
    stolen = await make_key(gateway)
    gateway.registry.is_away = True
    await rotate(gateway, stolen)
    gateway.registry.is_away = False

    await delete(gateway, stolen)

    assert gateway.registry.accounts == {}


async def test_one_key_at_a_time_gave_an_account_its_password(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    first, second = await make_key(gateway), await make_key(gateway)
    async with gateway.parts.db.write() as tx:
        for issued in (second, first):
            key_id = KeyId(issued["key_id"])
            await account_is_open(tx, "customer", SubjectId("carol"), key_id=key_id)

    await delete(gateway, second)
    assert set(gateway.registry.accounts) == {"carol"}
    await delete(gateway, first)
    assert gateway.registry.accounts == {}
