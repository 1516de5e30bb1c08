"""Forwarded calls: exactly the calls of the table, whole, in the caller's name."""

import json

import pytest
from skyway_gateway.forward.table import FORWARDED, Forwarded

from tests.gateway.whole_gateway import Gateway

IDS = {
    "provider_id": "prv_1",
    "drone_id": "drn_1",
    "battery_id": "bat_1",
    "model_id": "m300",
    "network_id": "texas",
    "station_id": "san-marcos",
    "mission_id": "msn_1",
    "pad": "0",
    "from_id": "san-marcos",
    "to_id": "mcqueeney",
    "closure_id": "cls_1",
    "alarm_id": "alm_1",
    "quarantine_id": "qua_1",
}
CALLERS = ("customer", "provider", "operator", "drone")
SUBJECTS = {"customer": "alice", "provider": "prv_1", "operator": "op", "drone": "drn_1"}


def path_of(row: Forwarded) -> str:
    return row.path.format(**IDS)


# These calls leave nothing in the gateway, so all rows may share one gateway.
async def test_a_call_reaches_its_service_only_for_its_roles(
    gateway: Gateway, subtests: pytest.Subtests
) -> None:
    for row in (row for row in FORWARDED if row.roles):
        with subtests.test(f"{row.method} {row.path}"):
            await assert_reaches_its_service(gateway, row)


async def assert_reaches_its_service(gateway: Gateway, row: Forwarded) -> None:
    path = path_of(row)
    for role in CALLERS:
        gateway.forwarded.clear()
        answer = await gateway.http.request(
            row.method, f"{path}?limit=3&x=a%20b", headers=getattr(gateway, role)
        )
        if role not in row.roles:
            assert answer.status_code == 403
            assert gateway.forwarded == []
            continue
        assert answer.status_code == 200, answer.text
        [seen] = gateway.forwarded
        assert (seen.service, seen.method, seen.path) == (row.service, row.method, path)
        assert seen.query == "limit=3&x=a%20b"
        assert seen.headers["skyway-caller"] == f"{role}:{SUBJECTS[role]}"
        assert seen.headers["authorization"] == "Bearer service_gateway-0123456789abcdef"
        assert answer.headers["etag"] == '"1-abc"'
    assert (await gateway.http.request(row.method, path)).status_code == 401


async def test_bodies_and_conditions_are_passed_on(gateway: Gateway) -> None:
    body = json.dumps({"type": "FeatureCollection", "features": ["x" * 1000] * 1000}).encode()
    headers = {
        **gateway.operator,
        "content-type": "application/geo+json",
        "if-match": '"1-abc"',
        "idempotency-key": "k",
        "skyway-caller": "operator:somebody-else",
        "cookie": "not for them",
    }
    answer = await gateway.http.put("/v1/networks/texas", content=body, headers=headers)
    assert answer.status_code == 200
    [seen] = gateway.forwarded
    assert seen.body == body
    assert seen.headers["content-type"] == "application/geo+json"
    assert seen.headers["if-match"] == '"1-abc"'
    assert seen.headers["idempotency-key"] == "k"
    assert seen.headers["skyway-caller"] == "operator:op"
    assert "cookie" not in seen.headers


async def test_a_token_is_exchanged_without_a_key(gateway: Gateway) -> None:
    body = {"enrolment_token": "enr_x"}
    headers = {"idempotency-key": "k", "skyway-caller": "operator:somebody-else"}
    answer = await gateway.http.post("/v1/enrolments", json=body, headers=headers)
    assert answer.status_code == 200
    [seen] = gateway.forwarded
    assert (seen.service, json.loads(seen.body)) == ("registry", body)
    assert seen.headers["skyway-caller"] == "service:gateway"
    assert seen.headers["idempotency-key"] == "k"
    assert [row.path for row in FORWARDED if not row.roles] == ["/v1/enrolments"]


async def test_a_provider_reaches_only_its_own_resources(gateway: Gateway) -> None:
    for method, path in (
        ("GET", "/v1/providers/prv_2"),
        ("PATCH", "/v1/providers/prv_2"),
        ("GET", "/v1/providers/prv_2/drones"),
        ("DELETE", "/v1/providers/prv_2/drones/drn_1"),
    ):
        answer = await gateway.http.request(method, path, headers=gateway.provider)
        assert answer.status_code == 404, path
    assert gateway.forwarded == []


@pytest.mark.parametrize(
    "path",
    [
        "/internal/candidates",
        "/internal/deliveries/dlv_1/closed",
        "/internal/broker-accounts/alice",
        "/v1/networks/texas/secrets",
        "/v1/providers/prv_1/drones/../../../../internal/candidates",
        "/v1/networks/..%2f..%2finternal%2fcandidates",
        "/v2/networks",
        "/",
    ],
)
async def test_other_calls_are_not_forwarded(gateway: Gateway, path: str) -> None:
    for method in ("GET", "POST", "PUT", "DELETE"):
        answer = await gateway.http.request(method, path, headers=gateway.operator)
        assert answer.status_code in (400, 401, 404, 405), (method, path, answer.text)
    assert gateway.forwarded == []


async def test_a_new_providers_key_is_in_the_answer_and_works(gateway: Gateway) -> None:
    body = {"name": "Fleet One", "tariff": {"base": 100}}
    answer = await gateway.http.post("/v1/providers", json=body, headers=gateway.operator)
    assert answer.status_code == 201
    made = answer.json()
    assert made["name"] == "Fleet One"
    assert answer.headers["location"] == "/v1/providers/prv_new"
    headers = {"Authorization": f"Bearer {made['key']}"}
    drones = await gateway.http.get("/v1/providers/prv_new/drones", headers=headers)
    assert drones.status_code == 200
    assert gateway.forwarded[-1].headers["skyway-caller"] == "provider:prv_new"


async def test_a_repeated_provider_call_gives_the_same_key(gateway: Gateway) -> None:
    headers = {**gateway.operator, "Idempotency-Key": "k"}
    body = {"name": "Fleet One"}
    first = await gateway.http.post("/v1/providers", json=body, headers=headers)
    again = await gateway.http.post("/v1/providers", json=body, headers=headers)
    assert (again.status_code, again.json()) == (201, first.json())
    assert [seen.headers["idempotency-key"] for seen in gateway.forwarded] == ["k", "k"]


async def test_only_operators_register_providers(gateway: Gateway) -> None:
    for headers in (gateway.customer, gateway.provider):
        answer = await gateway.http.post("/v1/providers", json={"name": "x"}, headers=headers)
        assert answer.status_code == 403
    assert gateway.forwarded == []


async def test_only_networks_may_have_large_bodies(gateway: Gateway) -> None:
    large = b'"' + b"x" * 300_000 + b'"'
    headers = {**gateway.operator, "content-type": "application/json"}
    for method, path, status in (
        ("PUT", "/v1/networks/texas", 200),
        ("POST", "/v1/providers/prv_1/drones", 413),
        ("PATCH", "/v1/providers/prv_1", 413),
        ("POST", "/v1/providers", 413),
    ):
        answer = await gateway.http.request(method, path, content=large, headers=headers)
        assert answer.status_code == status, path
