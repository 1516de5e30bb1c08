"""Keys with a name, with scopes and with an expiry."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_gateway.access.scopes import CALLS, SCOPES, require_scope

from skyway.runtime.errors import ScopeMissing
from skyway.runtime.http.identity import Caller, KeyHolder
from tests.gateway.access.key_calls import ask_for_key, bearer, make_key, status_of
from tests.gateway.access.test_route_matrix import GUARDED
from tests.gateway.whole_gateway import START, Gateway

#: Only drones make it, whose keys have no scopes.
_OF_DRONES = {"POST /v1/enrolments/rotations"}


def ahead(**after: float) -> str:
    return (START + timedelta(**after)).isoformat()


def test_each_call_has_exactly_one_scope() -> None:
    listed = [call for calls in CALLS.values() for call in calls]

    assert sorted(listed) == sorted({each.name for each in GUARDED} - _OF_DRONES)
    assert set(CALLS) == set(SCOPES)


@pytest.mark.parametrize("scopes", [{"network:read"}, set(SCOPES)])
def test_a_call_that_has_no_scope_is_refused_to_each_key_with_scopes(scopes: set[str]) -> None:
    holder = KeyHolder(Caller("operator", "olga"), "key_1", frozenset(scopes))

    require_scope(holder, "GET /v1/networks")
    with pytest.raises(ScopeMissing):
        require_scope(holder, "GET /v1/unlisted")


def test_only_calls_that_change_nothing_have_a_scope_to_read() -> None:
    reading = {scope for scope in SCOPES if scope.endswith(":read")}

    for scope, calls in CALLS.items():
        if scope in reading:
            assert {call.split()[0] for call in calls} == {"GET"}, scope


async def test_a_key_shows_its_name_scopes_and_expiry(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    limits: dict[str, Any] = {
        "name": "Büro 2 (laptop)",
        "scopes": ["quotes:write", "deliveries:read", "quotes:write"],
        "expires_wall_at": ahead(days=1),
    }

    issued = await make_key(gateway, **limits)

    path = f"/v1/keys/{issued['key_id']}"
    shown = (await gateway.http.get(path, headers=gateway.operator)).json()
    assert shown["name"] == "Büro 2 (laptop)"
    assert shown["scopes"] == ["deliveries:read", "quotes:write"]
    assert shown["expires_wall_at"] == "2026-03-02T12:00:00Z"
    listed = await gateway.http.get("/v1/keys?subject_id=carol", headers=gateway.operator)
    assert listed.json()["items"] == [shown]


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("name", ""),
        ("name", "x" * 101),
        ("name", "bell\x07"),
        ("name", "two\nlines"),
        ("name", "right\u202eleft"),
        ("scopes", []),
        ("scopes", ["deliveries:delete"]),
        ("scopes", ["deliveries:read"] * 100),
        ("expires_wall_at", ahead(seconds=0)),
        ("expires_wall_at", ahead(seconds=-1)),
        ("expires_wall_at", ahead(days=3653, seconds=1)),
        ("expires_wall_at", "9999-12-31T23:59:59Z"),
        ("expires_wall_at", "0001-01-01T00:00:00Z"),
        ("expires_wall_at", "2026-03-02T12:00:00"),
    ],
)
async def test_a_limit_out_of_bounds_is_named(gateway: Gateway, field: str, value: Any) -> None:
    answer = await ask_for_key(gateway, **{field: value})

    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"].startswith(field)


async def test_a_key_without_the_scope_is_refused_with_the_scope_that_it_needs(
    gateway: Gateway,
) -> None:
    issued = await make_key(gateway, scopes=["deliveries:read"])

    answer = await gateway.http.post("/v1/quotes", json={}, headers=bearer(issued))

    assert answer.status_code == 403
    problem = answer.json()
    assert (problem["code"], problem["scope"]) == ("SCOPE_MISSING", "quotes:write")
    assert "quotes:write" in problem["detail"]
    assert await status_of(gateway, issued, "/v1/deliveries") == 200


async def test_a_scope_gives_nothing_that_the_role_may_not_do(gateway: Gateway) -> None:
    issued = await make_key(gateway, scopes=list(SCOPES))

    assert await status_of(gateway, issued, "/v1/audit") == 403
    assert await status_of(gateway, issued, "/v1/deliveries") == 200


async def test_a_key_ends_at_the_moment_of_its_expiry(gateway: Gateway) -> None:
    issued = await make_key(gateway, expires_wall_at=ahead(seconds=60))
    before = await status_of(gateway, issued)
    gateway.clock.advance(timedelta(seconds=59.999))
    last = await status_of(gateway, issued)

    gateway.clock.advance(timedelta(seconds=0.001))

    assert (before, last, await status_of(gateway, issued)) == (200, 200, 401)
    path = f"/v1/keys/{issued['key_id']}"
    assert (await gateway.http.get(path, headers=gateway.operator)).status_code == 404


async def test_an_expired_key_ends_its_broker_account_and_counts_no_more(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    issued = await make_key(gateway, expires_wall_at=ahead(seconds=60))
    await gateway.parts.keys.end_expired_keys()
    assert set(gateway.registry.accounts) == {"carol"}
    gateway.clock.advance(timedelta(seconds=60))

    await gateway.parts.keys.end_expired_keys()
    await gateway.parts.keys.close_orphaned_accounts()

    assert gateway.registry.accounts == {}
    listed = await gateway.http.get("/v1/keys?subject_id=carol", headers=gateway.operator)
    assert listed.json()["items"] == []
    gateway.clock.advance(timedelta(seconds=-30))  # the machine's clock is set back
    assert await status_of(gateway, issued) == 401


async def test_an_open_stream_may_not_be_read_after_the_expiry(gateway: Gateway) -> None:
    issued = await make_key(gateway, expires_wall_at=ahead(seconds=60))
    assert await gateway.parts.entrance._is_still_known(issued["key"])

    gateway.clock.advance(timedelta(seconds=60))

    assert not await gateway.parts.entrance._is_still_known(issued["key"])


@pytest.mark.parametrize(
    ("own", "requested", "status"),
    [
        (["keys:write", "quotes:write"], {"scopes": ["quotes:write"]}, 201),
        (["keys:write", "quotes:write"], {"scopes": ["deliveries:read"]}, 403),
        (["keys:write"], {}, 403),
        (["keys:write"], {"role": "operator", "subject_id": "op"}, 403),
        (["quotes:write"], {"scopes": ["quotes:write"]}, 403),
    ],
)
async def test_a_key_gives_only_its_own_scopes(
    gateway: Gateway, own: list[str], requested: dict[str, Any], status: int
) -> None:
    maker = await make_key(gateway, role="operator", subject_id="olga", scopes=own)

    answer = await ask_for_key(gateway, by=bearer(maker), **requested)

    assert answer.status_code == status


@pytest.mark.parametrize(
    ("requested", "status"),
    [
        ({"expires_wall_at": ahead(seconds=60)}, 201),
        ({"expires_wall_at": ahead(seconds=60.001)}, 403),
        ({}, 403),
    ],
)
async def test_a_key_gives_no_later_end_than_its_own(
    gateway: Gateway, requested: dict[str, Any], status: int
) -> None:
    limits: dict[str, Any] = {
        "role": "operator",
        "subject_id": "olga",
        "expires_wall_at": ahead(seconds=60),
    }
    maker = await make_key(gateway, **limits)

    answer = await ask_for_key(gateway, by=bearer(maker), **requested)

    assert answer.status_code == status


async def test_a_stored_answer_does_not_give_a_limited_key_more(gateway: Gateway) -> None:
    requested: dict[str, Any] = {"role": "operator", "subject_id": "op"}
    headers = {**gateway.operator, "Idempotency-Key": "k"}
    await gateway.http.post("/v1/keys", json=requested, headers=headers)
    limited = await make_key(gateway, **requested, scopes=["keys:write"])

    headers = {**bearer(limited), "Idempotency-Key": "k"}
    answer = await gateway.http.post("/v1/keys", json=requested, headers=headers)

    assert answer.status_code == 403


async def test_a_new_provider_gets_the_limits_of_its_makers_key(gateway: Gateway) -> None:
    limits: dict[str, Any] = {
        "scopes": ["fleet:read", "fleet:write"],
        "expires_wall_at": ahead(days=1),
    }
    maker = await make_key(gateway, role="operator", subject_id="olga", **limits)
    body = {"name": "Hill", "tariff": {"currency": "USD", "base": 1, "per_km": 1}}
    made = await gateway.http.post("/v1/providers", json=body, headers=bearer(maker))
    assert made.status_code == 201, made.text

    path = f"/v1/keys/{made.json()['key_id']}"
    shown = (await gateway.http.get(path, headers=gateway.operator)).json()

    assert (shown["scopes"], shown["expires_wall_at"]) == (limits["scopes"], "2026-03-02T12:00:00Z")


async def test_a_limited_key_gives_no_broker_account_that_reads_more(gateway: Gateway) -> None:
    writer = await make_key(gateway, scopes=["deliveries:write"])
    watcher: dict[str, Any] = {
        "role": "operator",
        "subject_id": "olga",
        "scopes": ["deliveries:read"],
    }

    assert writer["mqtt"] is None
    assert gateway.registry.accounts == {}
    assert (await make_key(gateway, **watcher))["mqtt"] is None


async def test_an_operators_account_ends_with_its_key(gateway: Gateway) -> None:
    guest: dict[str, Any] = {
        "role": "operator",
        "subject_id": "olga",
        "expires_wall_at": ahead(days=1),
    }
    issued = await make_key(gateway, **guest)
    assert gateway.registry.accounts == {"operator/olga": issued["mqtt"]["password"]}

    await gateway.http.delete(f"/v1/keys/{issued['key_id']}", headers=gateway.operator)
    await gateway.parts.keys.close_orphaned_accounts()

    assert gateway.registry.accounts == {}


async def test_an_account_ends_with_the_last_key_that_may_read(gateway: Gateway) -> None:
    reader = await make_key(gateway)
    await make_key(gateway, scopes=["deliveries:write"])
    await gateway.http.delete(f"/v1/keys/{reader['key_id']}", headers=gateway.operator)

    await gateway.parts.keys.close_orphaned_accounts()

    assert gateway.registry.accounts == {}
