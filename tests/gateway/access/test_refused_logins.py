"""Wrong keys are slowed, counted, and in the audit log; honest neighbours notice nothing."""

import asyncio
import json
from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
from skyway_gateway.access.audit_trail import MOST_A_MINUTE, RefusedLogins
from skyway_gateway.access.recognise import KeysInUse

from skyway.ids import KeyId
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.http.delays import WrongKeys
from skyway.runtime.http.identity import Caller, KeyHolder, RefusedKey
from skyway.runtime.metrics import COUNTERS
from skyway.runtime.minting import mint
from skyway.runtime.peer_secrets import secret_hash
from tests.counting_mint import CountingMint
from tests.gateway.access.key_calls import bearer, make_key, rotate, status_of
from tests.gateway.access.test_audit_trail import entries
from tests.gateway.access.test_entrance import limit
from tests.gateway.whole_gateway import Gateway

UNKNOWN = RefusedKey("unknown")
CALL = {"method": "GET", "path": "/v1/x"}


async def guess(gateway: Gateway, number: int) -> int:
    headers = {"Authorization": f"Bearer sk_guess_{number}"}
    return (await gateway.http.get("/v1/clock", headers=headers)).status_code


async def written(gateway: Gateway) -> list[Any]:
    await gateway.parts.refused_logins.write()
    return await entries(gateway)


@pytest.fixture
async def guessed(gateway: Gateway) -> Gateway:
    """A gateway at which this address has to wait."""
    waiting = WrongKeys(now=lambda: 0.0)
    limit(gateway, addresses=1000)
    entrance = replace(gateway.parts.entrance, wrong_keys=waiting)
    # Parts are frozen: only a test replaces one.
    object.__setattr__(gateway.parts, "entrance", entrance)
    assert {await guess(gateway, number) for number in range(10)} == {401}
    return gateway


async def test_an_address_with_many_wrong_keys_waits(guessed: Gateway) -> None:
    headers = {"Authorization": "Bearer sk_one_more"}

    answer = await guessed.http.get("/v1/clock", headers=headers)

    assert answer.status_code == 429
    assert answer.json()["code"] == "WRONG_KEYS"
    assert int(answer.headers["retry-after"]) >= 1


async def test_a_right_key_of_that_address_never_waits(guessed: Gateway) -> None:
    assert (await guessed.http.get("/v1/clock", headers=guessed.customer)).status_code == 200
    issued = await make_key(guessed)
    assert await status_of(guessed, issued) == 200
    new = (await rotate(guessed, issued)).json()
    assert await status_of(guessed, new) == 200
    assert (await guessed.http.get("/v1/clock", headers=guessed.drone)).status_code == 200


async def test_a_right_key_is_let_in_when_the_address_has_spent_its_budget(
    gateway: Gateway,
) -> None:
    limit(gateway, addresses=10)
    assert [await guess(gateway, number) for number in range(2)] == [401, 429]

    assert (await gateway.http.get("/v1/clock", headers=gateway.customer)).status_code == 200


async def test_an_ended_key_waits_like_any_other(guessed: Gateway) -> None:
    issued = await make_key(guessed)
    path = f"/v1/keys/{issued['key_id']}"
    await guessed.http.delete(path, headers=guessed.operator)

    assert await status_of(guessed, issued) == 429


async def test_a_key_that_was_good_waits_once_it_was_refused(guessed: Gateway) -> None:
    issued = await make_key(guessed)
    assert await status_of(guessed, issued) == 200
    await guessed.http.delete(f"/v1/keys/{issued['key_id']}", headers=guessed.operator)
    assert await status_of(guessed, issued) == 401
    assert await status_of(guessed, issued) == 429


async def test_wrong_keys_are_looked_up_together(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    in_use = KeysInUse(gateway.parts.db, gateway.clock, pause_s=0)
    asked = [in_use.may_hold(secret_hash(f"sk_guess_{n}")) for n in range(2000)]

    found = await asyncio.gather(*asked, in_use.may_hold(secret_hash("sk_customer")))

    assert found == [False] * 2000 + [True]


async def test_a_key_that_another_replica_has_just_made_is_in_use(gateway: Gateway) -> None:
    in_use = KeysInUse(gateway.parts.db, gateway.clock, pause_s=0)
    assert not await in_use.may_hold(secret_hash("sk_guess"))

    issued = await make_key(gateway)

    assert await in_use.may_hold(secret_hash(issued["key"]))
    await gateway.http.delete(f"/v1/keys/{issued['key_id']}", headers=gateway.operator)
    gateway.clock.advance(timedelta(minutes=1))
    await in_use.may_hold(secret_hash("sk_guess"))
    assert not await in_use.may_hold(secret_hash(issued["key"]))


async def test_a_read_that_fails_is_tried_again(
    gateway: Gateway, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_use = KeysInUse(gateway.parts.db, gateway.clock, pause_s=0)

    def away() -> Any:
        raise ServiceUnavailable("database", "it is away")

    with monkeypatch.context() as patched:
        patched.setattr(gateway.parts.db.__class__, "read", lambda self: away())
        with pytest.raises(ServiceUnavailable):
            await in_use.may_hold(secret_hash("sk_customer"))

    assert await in_use.may_hold(secret_hash("sk_customer"))


async def test_each_kind_of_refused_key_is_counted_and_logged(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    soon = (gateway.clock.wall_now() + timedelta(seconds=1)).isoformat()
    expired, revoked = await make_key(gateway, expires_wall_at=soon), await make_key(gateway)
    await gateway.http.delete(f"/v1/keys/{revoked['key_id']}", headers=gateway.operator)
    gateway.clock.advance(timedelta(seconds=1))
    reasons = ("unknown", "expired", "revoked")
    before = {each: COUNTERS.value("skyway_keys_refused", reason=each) for each in reasons}
    for key in ("sk_nobody", expired["key"], revoked["key"]):
        await gateway.http.get("/v1/clock?q=1", headers=bearer({"key": key}))

    found = [each for each in await written(gateway) if each["status"] == 401]

    after = {each: COUNTERS.value("skyway_keys_refused", reason=each) for each in reasons}
    assert {each: after[each] - before[each] for each in reasons} == dict.fromkeys(reasons, 1)
    bodies = {json.loads(each["body"])["refused"]: each for each in found}
    assert set(bodies) == set(reasons)
    assert (bodies["unknown"]["role"], bodies["unknown"]["subject_id"]) == ("unknown", "unknown")
    assert json.loads(bodies["unknown"]["body"])["address"] == "127.0.0.1"
    assert (bodies["revoked"]["role"], bodies["revoked"]["subject_id"]) == ("customer", "carol")
    assert json.loads(bodies["expired"]["body"])["key_id"] == expired["key_id"]
    assert {each["path"] for each in found} == {"/v1/clock"}
    text = json.dumps(found)
    assert not [key for key in ("sk_nobody", expired["key"], revoked["key"]) if key in text]


async def test_an_address_has_one_entry_a_minute(gateway: Gateway) -> None:
    for number in range(5):
        await guess(gateway, number)
    first = await written(gateway)
    for number in range(5):
        await guess(gateway, number)

    assert await written(gateway) == first
    gateway.clock.advance(timedelta(minutes=1))
    await guess(gateway, 1)
    assert len(await written(gateway)) == len(first) + 1 == 2


async def test_replicas_write_one_entry_together(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    replicas = [RefusedLogins(gateway.parts.db, gateway.clock, mint) for _ in range(3)]
    for replica in replicas:
        replica.note(UNKNOWN, **CALL, address="203.0.113.7")

    await asyncio.gather(*(replica.write() for replica in replicas))

    assert len(await entries(gateway)) == 1


async def test_many_addresses_have_a_bounded_number_of_entries(gateway: Gateway) -> None:
    replicas = [RefusedLogins(gateway.parts.db, gateway.clock, mint) for _ in range(2)]
    for number in range(10_000):
        for replica, name in zip(replicas, "ab", strict=True):
            replica.note(UNKNOWN, **CALL, address=f"{name}{number}")
    assert max(len(replica._waiting) for replica in replicas) <= MOST_A_MINUTE

    await asyncio.gather(*(replica.write() for replica in replicas))

    assert len(await entries(gateway, "?limit=200")) == MOST_A_MINUTE


async def test_entries_wait_while_the_database_is_away_and_memory_is_bounded(
    gateway: Gateway, monkeypatch: pytest.MonkeyPatch
) -> None:
    logins = RefusedLogins(gateway.parts.db, gateway.clock, CountingMint())

    def away(_self: object) -> Any:
        raise ServiceUnavailable("database", "it is away")

    with monkeypatch.context() as patched:
        patched.setattr(gateway.parts.db.__class__, "write", away)
        for minute in range(100):
            for number in range(MOST_A_MINUTE):
                logins.note(UNKNOWN, **CALL, address=f"{minute}-{number}")
            gateway.clock.advance(timedelta(minutes=1))
        with pytest.raises(ServiceUnavailable):
            await logins.write()

    assert len(logins._waiting) == 10 * MOST_A_MINUTE
    await logins.write()
    assert len(logins._waiting) == 0


@pytest.mark.parametrize("text", ["/v1/\x00", "/v1/\udcff", "/v1/" + "x" * 10_000, "/\u202e"])
async def test_what_an_unknown_caller_sends_can_be_stored(
    gateway_on_both: Gateway, text: str
) -> None:
    logins = gateway_on_both.parts.refused_logins
    logins.note(UNKNOWN, method="X" * 10_000, path=text, address="")

    [entry] = await written(gateway_on_both)

    assert entry["method"] == "OTHER"
    assert len(entry["path"]) <= 500


async def test_a_drone_without_a_key_is_logged_as_unknown(gateway: Gateway) -> None:
    holder = KeyHolder(Caller("drone", "drn_1"), key_id=KeyId("drn_1"))
    gateway.parts.refused_logins.note(RefusedKey("revoked", holder), **CALL, address="a")
    gateway.is_damaged = True  # no key of the gateway's belongs to a drone

    [entry] = await written(gateway)

    assert (entry["role"], entry["subject_id"]) == ("unknown", "drn_1")
