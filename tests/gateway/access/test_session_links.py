"""Login links: each begins one session of its key within ten minutes, from the gateway's pages."""

import asyncio
from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Any

import httpx
import pytest
from skyway_gateway.access import session_store
from skyway_gateway.access.login_codes import CODE_LASTS, LoginCodes
from skyway_gateway.access.session_store import MOST_LINKS_PER_KEY
from skyway_gateway.tables import session_links
from sqlalchemy import select

from skyway.runtime.http.delays import WrongKeys
from skyway.units import moment_to_ms
from tests.gateway.access.key_calls import bearer, make_key
from tests.gateway.access.test_audit_trail import entries
from tests.gateway.access.test_entrance import limit
from tests.gateway.whole_gateway import Gateway

LINKS = "/v1/session-links"
SESSIONS = "/v1/sessions"
CURRENT = "/v1/sessions/current"
OWN = {"Origin": "http://gateway"}


async def linked(gateway: Gateway, headers: Mapping[str, str]) -> str:
    """The code of a new login link."""
    answer = await gateway.http.post(LINKS, headers=headers)
    assert answer.status_code == 201, answer.text
    address, _, code = answer.json()["url"].partition("#login=")
    assert address == "http://gateway/console"
    return str(code)


async def log_in(
    gateway: Gateway, code: object, headers: Mapping[str, str] = OWN
) -> httpx.Response:
    answer = await gateway.http.post(SESSIONS, json={"code": code}, headers=headers)
    gateway.http.cookies.clear()
    return answer


async def rows(gateway: Gateway) -> list[Any]:
    async with gateway.parts.db.read() as connection:
        return [*(await connection.execute(select(session_links))).all()]


async def test_a_link_begins_a_session_of_its_key(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both

    answer = await log_in(gateway, await linked(gateway, gateway.provider))

    assert answer.status_code == 201, answer.text
    assert answer.json() == {"role": "provider", "subject_id": "prv_1", "scopes": None}
    cookie, *attributes = answer.headers["set-cookie"].split("; ")
    assert {"HttpOnly", "Path=/", "SameSite=strict"} <= set(attributes)
    shown_by_link = await gateway.http.get(CURRENT, headers={"Cookie": cookie})
    assert shown_by_link.json() == answer.json()


async def test_a_link_works_once(gateway: Gateway) -> None:
    code = await linked(gateway, gateway.operator)

    assert (await log_in(gateway, code)).status_code == 201
    again = await log_in(gateway, code)

    assert again.status_code == 401
    assert "login link" in again.json()["detail"]
    assert "set-cookie" not in again.headers


async def test_only_one_of_simultaneous_logins_succeeds(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    code = await linked(gateway, gateway.customer)

    answers = await asyncio.gather(*(log_in(gateway, code) for _ in range(6)))

    assert sorted(answer.status_code for answer in answers) == [201, *[401] * 5]


async def test_a_link_that_another_replica_has_just_used_begins_no_session(
    gateway: Gateway,
) -> None:
    code = await linked(gateway, gateway.customer)
    other = LoginCodes(gateway.parts.db, gateway.clock, "http://gateway")
    assert await gateway.parts.login_codes.recognise(code)

    async with gateway.parts.db.write() as tx:
        assert await other.use(tx, code)

    assert (await log_in(gateway, code)).status_code == 401


async def test_a_link_ends_after_ten_minutes(gateway: Gateway) -> None:
    made = (await gateway.http.post(LINKS, headers=gateway.customer)).json()
    code = made["url"].partition("=")[2]
    expires_wall_at = datetime.fromisoformat(made["expires_wall_at"])
    assert expires_wall_at - gateway.clock.wall_now() == CODE_LASTS == timedelta(minutes=10)

    gateway.clock.advance(CODE_LASTS)

    assert (await log_in(gateway, code)).status_code == 401


async def test_a_link_ends_with_its_key(gateway: Gateway) -> None:
    issued = await make_key(gateway)
    code = await linked(gateway, bearer(issued))

    await gateway.http.delete(f"/v1/keys/{issued['key_id']}", headers=gateway.operator)

    assert (await log_in(gateway, code)).status_code == 401


async def test_a_link_ends_when_its_key_expires(gateway: Gateway) -> None:
    code = await linked(gateway, gateway.customer)
    soon_ms = moment_to_ms(gateway.clock.wall_now() + timedelta(minutes=2))
    await gateway.execute(f"UPDATE api_keys SET ends_wall_ms = {soon_ms}")

    gateway.clock.advance(timedelta(minutes=3))

    assert (await log_in(gateway, code)).status_code == 401


async def test_a_session_of_a_link_ends_with_its_key(gateway: Gateway) -> None:
    issued = await make_key(gateway)
    begun = await log_in(gateway, await linked(gateway, bearer(issued)))
    cookie = {"Cookie": begun.headers["set-cookie"].partition(";")[0]}
    assert (await gateway.http.get(CURRENT, headers=cookie)).status_code == 200

    await gateway.http.delete(f"/v1/keys/{issued['key_id']}", headers=gateway.operator)
    gateway.clock.advance(timedelta(seconds=1))

    assert (await gateway.http.get(CURRENT, headers=cookie)).status_code == 401


async def test_a_session_makes_no_link(gateway: Gateway) -> None:
    begun = await log_in(gateway, await linked(gateway, gateway.operator))
    cookie = {"Cookie": begun.headers["set-cookie"].partition(";")[0]}

    assert (await gateway.http.post(LINKS, headers=cookie | OWN)).status_code == 403


@pytest.mark.parametrize("path", [LINKS, SESSIONS])
async def test_a_link_allows_what_its_key_allows(gateway: Gateway, path: str) -> None:
    body = {"role": "customer", "subject_id": "erin", "scopes": ["live:read"]}
    issued = (await gateway.http.post("/v1/keys", json=body, headers=gateway.operator)).json()

    answer = await gateway.http.post(path, headers=bearer(issued))

    assert answer.status_code == 403
    assert answer.json()["code"] == "SCOPE_MISSING"


async def test_a_drone_makes_no_link(gateway: Gateway) -> None:
    assert (await gateway.http.post(LINKS, headers=gateway.drone)).status_code == 403


@pytest.mark.parametrize(
    "origin", [{}, {"Origin": "null"}, {"Origin": "http://evil.example"}], ids=str
)
async def test_a_page_of_another_site_uses_no_link(
    gateway: Gateway, origin: dict[str, str]
) -> None:
    code = await linked(gateway, gateway.customer)

    assert (await log_in(gateway, code, origin)).status_code == 403
    assert (await log_in(gateway, code)).status_code == 201


async def test_a_link_replaces_the_session_that_the_browser_has(gateway: Gateway) -> None:
    first = await log_in(gateway, await linked(gateway, gateway.customer))
    cookie = {"Cookie": first.headers["set-cookie"].partition(";")[0]}

    second = await log_in(gateway, await linked(gateway, gateway.operator), cookie | OWN)

    assert second.json()["role"] == "operator"


async def test_a_code_is_no_key(gateway: Gateway) -> None:
    code = await linked(gateway, gateway.operator)

    answer = await gateway.http.get(CURRENT, headers={"Authorization": f"Bearer {code}"})

    assert answer.status_code == 401


@pytest.mark.parametrize("body", [{}, {"code": ""}, {"code": 1}, {"code": "x" * 201}, []], ids=str)
async def test_a_body_without_a_code_is_refused(gateway: Gateway, body: object) -> None:
    answer = await gateway.http.post(SESSIONS, json=body, headers=OWN)

    assert answer.status_code == 422


async def test_a_session_begins_with_a_key_or_a_code(gateway: Gateway) -> None:
    answer = await gateway.http.post(SESSIONS, headers=OWN)

    assert answer.status_code == 401
    assert "login link" in answer.json()["detail"]


async def test_wrong_codes_are_slowed_as_wrong_keys_are(gateway: Gateway) -> None:
    limit(gateway, addresses=1000)
    waiting = WrongKeys(now=lambda: 0.0)
    object.__setattr__(
        gateway.parts, "entrance", replace(gateway.parts.entrance, wrong_keys=waiting)
    )
    gateway.parts.login_codes._in_use._pause_s = 0
    code = await linked(gateway, gateway.customer)

    tried = [(await log_in(gateway, f"guess {number}")).status_code for number in range(11)]

    assert tried == [*[401] * 10, 429]
    assert (await log_in(gateway, code)).status_code == 201
    assert (await log_in(gateway, code)).status_code == 401


async def test_wrong_codes_are_in_the_audit_log(gateway: Gateway) -> None:
    used = await linked(gateway, gateway.operator)
    await log_in(gateway, used)
    await log_in(gateway, used)
    await log_in(gateway, "guess")
    await gateway.parts.refused_logins.write()

    refused = [entry for entry in await entries(gateway) if entry["status"] == 401]

    assert [(entry["role"], entry["path"]) for entry in refused] == [
        ("unknown", SESSIONS),
        ("operator", SESSIONS),
    ]


async def test_neither_database_nor_audit_log_holds_a_code(gateway: Gateway) -> None:
    code = await linked(gateway, gateway.operator)
    await log_in(gateway, code)

    logged = await entries(gateway)

    assert [(entry["path"], entry["status"]) for entry in logged] == [(SESSIONS, 201), (LINKS, 201)]
    assert code not in repr(logged)
    assert code not in repr(await rows(gateway))
    assert len(code) >= 43


async def test_a_key_has_a_bounded_number_of_links(gateway: Gateway) -> None:
    of_another_key = await linked(gateway, gateway.provider)
    first = await linked(gateway, gateway.customer)
    for _ in range(MOST_LINKS_PER_KEY):
        gateway.clock.advance(timedelta(seconds=1))
        last = await linked(gateway, gateway.customer)

    assert len(await rows(gateway)) == MOST_LINKS_PER_KEY + 1
    assert (await log_in(gateway, first)).status_code == 401
    for code in (last, of_another_key):
        assert (await log_in(gateway, code)).status_code == 201


async def test_links_are_deleted_when_they_have_expired(gateway: Gateway) -> None:
    await linked(gateway, gateway.customer)
    gateway.clock.advance(CODE_LASTS + timedelta(seconds=1))
    kept = await linked(gateway, gateway.customer)

    async with gateway.parts.db.write() as tx:
        await session_store.delete_expired_links(tx, before=gateway.clock.wall_now())

    assert len(await rows(gateway)) == 1
    assert (await log_in(gateway, kept)).status_code == 201
