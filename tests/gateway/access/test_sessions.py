"""Sessions of browsers: they stand for a key, and no other site can use them."""

import json
import re
from collections.abc import Iterator, Mapping
from datetime import timedelta
from pathlib import Path
from typing import Any

import httpx
import pytest
from skyway_gateway.access.scopes import NEEDS_KEY
from skyway_gateway.access.session_store import MOST_PER_KEY, SESSION_LASTS
from skyway_gateway.tables import sessions
from sqlalchemy import select

from skyway.units import moment_to_ms
from tests.gateway.whole_gateway import Gateway, make_request

CURRENT = "/v1/sessions/current"
DELIVERIES = "/v1/deliveries"

_OPENAPI = Path(__file__).parents[3] / "openapi"
#: Names of fields that hold a secret, or a link that is one.
_SECRET = re.compile(
    r"(.*_)?(key|secret|token|password|credential|credentials|tracking_url|login_url)"
    r"|private_key_pem"
)
#: Calls whose answer has such a field, and that no session can make or that give it none.
_GIVE_A_SESSION_NOTHING = {
    "POST /v1/deliveries": "its tracking_url is null for a session",
    "POST /v1/enrolments": "an enrolment token in the body is the proof",
    "POST /v1/enrolments/rotations": "drones only",
}
#: Calls that change something and leave no right behind, by what they change.
_LEAVE_NO_RIGHT = {
    "work": ("deliveries", "quotes", "compositions", "missions", "proofs", "small-world"),
    "the world": ("networks", "stations", "segments", "zones", "ground-stops"),
    "repairs": ("alarms", "quarantine"),
    "a fleet's own data": ("batteries", "maintenance", "maintenance-rules", "drone-models"),
}
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
    assert await status(gateway, "GET", "/v1/audit", cookie) == 403
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
    of_another_key = await opened(gateway, gateway.provider)
    first = await opened(gateway, gateway.customer)
    for _ in range(MOST_PER_KEY):
        gateway.clock.advance(timedelta(seconds=1))
        last = await opened(gateway, gateway.customer)

    assert await status(gateway, "GET", CURRENT, first) == 401
    for cookie in (last, of_another_key):
        assert await status(gateway, "GET", CURRENT, cookie) == 200


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


def _operations(document: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    for path, item in document["paths"].items():
        for method, operation in item.items():
            if method != "parameters":
                yield f"{method.upper()} {path}", operation


def _fields(document: dict[str, Any], schema: Any, seen: frozenset[str]) -> Iterator[str]:
    """The names of all fields that a value of this schema can have."""
    if isinstance(schema, list):
        for each in schema:
            yield from _fields(document, each, seen)
    elif isinstance(schema, dict):
        name = str(schema.get("$ref", "")).rpartition("/")[2]
        if name and name not in seen:
            named = document["components"]["schemas"][name]
            yield from _fields(document, named, seen | {name})
        yield from schema.get("properties", {})
        for each in schema.values():
            yield from _fields(document, each, seen)


def _with_secrets(document: dict[str, Any]) -> Iterator[str]:
    """The operations whose answers can hold a secret."""
    for call, operation in _operations(document):
        answers = [
            answer.get("content", {})
            for status, answer in operation["responses"].items()
            if status.startswith("2")
        ]
        if any(_SECRET.fullmatch(name) for name in _fields(document, answers, frozenset())):
            yield call


def _documents() -> list[dict[str, Any]]:
    names = ("gateway", "provider-registry", "composition")
    return [json.loads((_OPENAPI / f"{name}.json").read_text(encoding="utf-8")) for name in names]


def test_each_call_whose_answer_holds_a_secret_needs_the_key_itself() -> None:
    public = {
        call for document in _documents() for call in _with_secrets(document) if " /v1/" in call
    }

    assert {"POST /v1/keys", "POST /v1/webhooks", "POST /v1/providers"} <= public
    assert public - NEEDS_KEY == set(_GIVE_A_SESSION_NOTHING)


def test_each_call_that_changes_something_is_known_to_leave_a_right_or_none() -> None:
    harmless = {word for words in _LEAVE_NO_RIGHT.values() for word in words}
    others = {
        "PUT /v1/branding",
        "PATCH /v1/providers/{provider_id}",
        "PATCH /v1/providers/{provider_id}/drones/{drone_id}",
        "PUT /v1/providers/{provider_id}/drones/{drone_id}/battery",
        "POST /v1/sessions",
        "POST /v1/statements/lines",
        "POST /v1/webhooks/{webhook_id}/replay",
        "POST /v1/webhooks/{webhook_id}/test",
    }
    undecided = {
        call
        for call, _ in _operations(_documents()[0])
        if call.split()[0] in {"POST", "PUT", "PATCH"}
        and call not in NEEDS_KEY | others | set(_GIVE_A_SESSION_NOTHING)
        and not harmless & set(call.split("/")[2:])
    }

    assert undecided == set()


async def test_no_session_gets_a_right_that_outlives_it(
    gateway: Gateway, subtests: pytest.Subtests
) -> None:
    gateway.is_damaged = True  # examples of bodies are not true of this gateway
    document = _documents()[0]
    cookies = {
        role: await opened(gateway, getattr(gateway, role))
        for role in ("operator", "provider", "customer")
    }
    for call, operation in _operations(document):
        if call not in NEEDS_KEY:
            continue
        method, path = call.split()
        url = re.sub(r"\{\w+\}", "absent", path.replace("{provider_id}", "prv_1"))
        content = operation.get("requestBody", {}).get("content", {}).get("application/json", {})
        stated = re.search(r"Callers: ([\w, ]+)\.", operation["description"])
        assert stated is not None
        for role in stated[1].split(", "):
            with subtests.test(f"{call} as {role}"):
                shown = {"headers": cookies[role] | OWN, "json": content.get("example")}
                answer = await gateway.http.request(method, url, **shown)

                assert (answer.status_code, answer.json()["code"]) == (403, "KEY_NEEDED")
                assert "Authorization: Bearer" in answer.json()["detail"]
                assert "KEY_NEEDED" in operation["description"]


async def test_a_delivery_of_a_session_has_no_link_even_if_its_key_asked_first(
    gateway: Gateway,
) -> None:
    cookie = await opened(gateway, gateway.customer)
    once = {"Idempotency-Key": "the-same-call"}
    body = make_request()
    with_key = await gateway.http.post(DELIVERIES, json=body, headers=gateway.customer | once)

    with_session = await gateway.http.post(DELIVERIES, json=body, headers=cookie | OWN | once)
    another = await gateway.http.post(DELIVERIES, json=body, headers=cookie | OWN)

    assert with_key.json()["tracking_url"].startswith("http://gateway/track/")
    assert with_session.json() == {**with_key.json(), "tracking_url": None}
    assert another.json()["tracking_url"] is None


async def test_the_key_beside_the_cookie_gives_what_a_session_does_not(gateway: Gateway) -> None:
    cookie = await opened(gateway, gateway.operator)
    body = {"role": "operator", "subject_id": "dora"}

    refused = await gateway.http.post("/v1/keys", json=body, headers=cookie | OWN)
    made = await gateway.http.post("/v1/keys", json=body, headers=cookie | OWN | gateway.operator)

    assert (refused.status_code, made.status_code) == (403, 201)


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1:1", "gateway:81"])
async def test_links_do_not_follow_the_host_of_a_request(gateway: Gateway, host: str) -> None:
    headers = gateway.customer | {"Host": host, "X-Forwarded-Host": host, "Forwarded": host}

    delivery = await gateway.http.post(DELIVERIES, json=make_request(), headers=headers)
    path = f"{DELIVERIES}/{delivery.json()['delivery_id']}/tracking-link"
    links = [
        delivery.json()["tracking_url"],
        (await gateway.http.get(path, headers=headers)).json()["tracking_url"],
        (await gateway.http.post(path, headers=headers)).json()["tracking_url"],
        (await gateway.http.post("/v1/session-links", headers=headers)).json()["url"],
    ]

    assert [link.split("/")[:3] for link in links] == [["http:", "", "gateway"]] * 4
