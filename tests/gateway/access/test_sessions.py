"""Sessions of browsers: they stand for a key, and no other site can use them."""

from collections.abc import Mapping
from datetime import timedelta
from typing import Any

import httpx
import pytest
from skyway_gateway.access.session_routes import SESSION_LASTS
from skyway_gateway.access.session_store import MOST_PER_KEY
from skyway_gateway.tables import sessions
from sqlalchemy import select

from skyway.units import moment_to_ms
from tests.gateway.whole_gateway import Gateway, make_request

CURRENT = "/v1/sessions/current"
OWN = {"Origin": "http://gateway"}


async def opened(gateway: Gateway, headers: Mapping[str, str]) -> dict[str, str]:
    """The Cookie header of a new session."""
    answer = await gateway.http.post("/v1/sessions", headers=headers)
    assert answer.status_code == 201, answer.text
    gateway.http.cookies.clear()
    cookie, *attributes = answer.headers["set-cookie"].split("; ")
    assert {"HttpOnly", "Path=/", "SameSite=strict"} <= set(attributes)
    return {"Cookie": cookie}


async def status(
    gateway: Gateway, method: str, path: str, headers: Mapping[str, str], body: Any = None
) -> int:
    answer = await gateway.http.request(method, path, headers=headers, json=body)
    gateway.http.cookies.clear()
    return answer.status_code


async def test_a_session_calls_as_its_key_does(gateway: Gateway) -> None:
    cookie = await opened(gateway, gateway.customer)

    answer = await gateway.http.get(CURRENT, headers=cookie)

    assert answer.json() == {"role": "customer", "subject_id": "alice", "scopes": None}
    assert await status(gateway, "GET", "/v1/deliveries", cookie) == 200
    assert await status(gateway, "GET", "/v1/keys", cookie) == 403
    assert await status(gateway, "POST", "/v1/deliveries", cookie | OWN, make_request()) == 202


@pytest.mark.parametrize(
    "origin",
    [
        {},
        {"Origin": "null"},
        {"Origin": "http://evil.example"},
        {"Origin": "http://gateway.evil.example"},
        {"Origin": "http://gateway:81"},
    ],
    ids=str,
)
async def test_a_page_of_another_site_changes_nothing_with_a_session(
    gateway: Gateway, origin: dict[str, str]
) -> None:
    cookie = await opened(gateway, gateway.customer)

    for method, path in (("POST", "/v1/deliveries"), ("DELETE", CURRENT)):
        assert await status(gateway, method, path, cookie | origin, {}) == 403

    listed = await gateway.http.get("/v1/deliveries", headers=cookie)
    assert listed.json()["items"] == []


async def test_a_session_ends_when_its_browser_ends_it(gateway: Gateway) -> None:
    cookie = await opened(gateway, gateway.customer)

    answer = await gateway.http.delete(CURRENT, headers=cookie | OWN)

    assert answer.status_code == 204
    assert 'skyway_session=""' in answer.headers["set-cookie"]
    assert await status(gateway, "GET", CURRENT, cookie) == 401
    assert await status(gateway, "GET", CURRENT, gateway.customer) == 200


async def test_a_session_ends_with_its_key(gateway: Gateway) -> None:
    body = {"role": "operator", "subject_id": "dora"}
    issued = (await gateway.http.post("/v1/keys", json=body, headers=gateway.operator)).json()
    cookie = await opened(gateway, {"Authorization": f"Bearer {issued['key']}"})
    assert await status(gateway, "GET", CURRENT, cookie) == 200

    await gateway.http.delete(f"/v1/keys/{issued['key_id']}", headers=gateway.operator)
    gateway.clock.advance(timedelta(seconds=1))

    assert await status(gateway, "GET", CURRENT, cookie) == 401


async def test_a_session_ends_after_twelve_hours(gateway: Gateway) -> None:
    cookie = await opened(gateway, gateway.customer)

    gateway.clock.advance(SESSION_LASTS - timedelta(seconds=1))
    assert await status(gateway, "GET", CURRENT, cookie) == 200
    gateway.clock.advance(timedelta(seconds=2))
    assert await status(gateway, "GET", CURRENT, cookie) == 401


async def test_a_key_has_a_bounded_number_of_sessions(gateway: Gateway) -> None:
    first = await opened(gateway, gateway.customer)
    for _ in range(MOST_PER_KEY):
        gateway.clock.advance(timedelta(seconds=1))
        last = await opened(gateway, gateway.customer)

    assert await status(gateway, "GET", CURRENT, first) == 401
    assert await status(gateway, "GET", CURRENT, last) == 200


async def test_a_session_ends_when_its_key_expires(gateway: Gateway) -> None:
    cookie = await opened(gateway, gateway.customer)
    soon_ms = moment_to_ms(gateway.clock.wall_now() + timedelta(minutes=10))
    await gateway.execute(f"UPDATE api_keys SET ends_wall_ms = {soon_ms}")
    gateway.clock.advance(timedelta(minutes=9))
    during = await status(gateway, "GET", CURRENT, cookie)

    gateway.clock.advance(timedelta(minutes=2))

    assert (during, await status(gateway, "GET", CURRENT, cookie)) == (200, 401)


async def test_a_session_cannot_be_prolonged_without_the_key(gateway: Gateway) -> None:
    cookie = await opened(gateway, gateway.customer)

    assert await status(gateway, "POST", "/v1/sessions", cookie | OWN) == 401


@pytest.mark.parametrize("path", ["/v1/sessions", "/v1/session-links", "/v1/keys/rotations"])
async def test_the_secret_of_a_session_is_no_key(gateway: Gateway, path: str) -> None:
    cookie = await opened(gateway, gateway.operator)
    shown = {"Authorization": f"Bearer {cookie['Cookie'].partition('=')[2]}"}

    assert await status(gateway, "GET", CURRENT, shown) == 401
    assert await status(gateway, "POST", path, shown) == 401


async def test_a_session_allows_what_its_key_allows(gateway: Gateway) -> None:
    body = {"role": "customer", "subject_id": "erin", "scopes": ["account:write", "live:read"]}
    issued = (await gateway.http.post("/v1/keys", json=body, headers=gateway.operator)).json()
    cookie = await opened(gateway, {"Authorization": f"Bearer {issued['key']}"})

    assert await status(gateway, "GET", "/v1/deliveries", cookie) == 403
    assert await status(gateway, "GET", CURRENT, cookie) == 403
    assert await status(gateway, "DELETE", CURRENT, cookie | OWN) == 204


async def test_the_database_holds_no_secret_of_a_session(gateway: Gateway) -> None:
    cookie = await opened(gateway, gateway.customer)

    async with gateway.parts.db.read() as connection:
        rows = (await connection.execute(select(sessions))).all()

    secret = cookie["Cookie"].partition("=")[2]
    assert secret.startswith("ss_")
    assert secret not in repr(rows)


async def test_a_key_in_the_header_counts_before_a_cookie(gateway: Gateway) -> None:
    cookie = await opened(gateway, gateway.customer)

    answer = await gateway.http.get(CURRENT, headers=cookie | gateway.operator)

    assert answer.json()["role"] == "operator"


async def test_a_cookie_that_was_made_up_is_refused(gateway: Gateway) -> None:
    assert await status(gateway, "GET", CURRENT, {"Cookie": "skyway_session=ss_guess"}) == 401
    assert await status(gateway, "GET", CURRENT, {"Cookie": "skyway_session=sk_customer"}) == 401


async def test_a_session_is_secure_over_https(gateway: Gateway) -> None:
    answer = await gateway.http.post("https://gateway/v1/sessions", headers=gateway.customer)

    assert isinstance(answer, httpx.Response)
    assert "Secure" in answer.headers["set-cookie"]
