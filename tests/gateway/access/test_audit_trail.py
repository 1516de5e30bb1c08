"""The audit log: the calls of operators and providers, without secrets."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from skyway_gateway.access.audit_store import LONGEST_BODY, body_text, path_text
from skyway_gateway.access.audit_trail import AuditTrail

from skyway.runtime.clock import AnchoredClock
from skyway.runtime.http.identity import Caller
from skyway.runtime.minting import mint
from skyway.runtime.sql.database import Database
from tests.gateway.whole_gateway import Gateway

TRACE = "00-0123456789abcdef0123456789abcdef-0123456789abcdef-01"


async def entries(gateway: Gateway, query: str = "") -> list[Any]:
    """The log, the newest first."""
    answer = await gateway.http.get(f"/v1/audit{query}", headers=gateway.operator)
    assert answer.status_code == 200, answer.text
    found: list[Any] = answer.json()["items"]
    return found


async def close_station(gateway: Gateway, **headers: str) -> None:
    await gateway.http.post(
        "/v1/stations/san-marcos/closures?dry_run=true",
        json={"reason": "storm"},
        headers={**gateway.operator, **headers},
    )


async def test_a_call_of_an_operator_is_logged_with_its_answer(
    gateway_on_both: Gateway,
) -> None:
    await close_station(gateway_on_both, traceparent=TRACE)

    [entry] = await entries(gateway_on_both)
    assert entry["entry_id"].startswith("aud_")
    assert (entry["role"], entry["subject_id"]) == ("operator", "op")
    assert (entry["method"], entry["status"]) == ("POST", 200)
    assert entry["path"] == "/v1/stations/san-marcos/closures?dry_run=true"
    assert json.loads(entry["body"]) == {"reason": "storm"}
    assert entry["at"] == "2026-03-01T12:00:00Z"
    assert entry["traceparent"].split("-")[1] == TRACE.split("-")[1]
    # The handler has received the whole body.
    assert json.loads(gateway_on_both.forwarded[0].body) == {"reason": "storm"}


async def test_refused_calls_are_logged(gateway: Gateway) -> None:
    await gateway.http.put("/v1/networks/texas", json={}, headers=gateway.provider)
    await gateway.http.post("/v1/keys", json={"role": "king"}, headers=gateway.operator)

    found = [(one["role"], one["path"], one["status"]) for one in await entries(gateway)]
    assert sorted(found) == [
        ("operator", "/v1/keys", 422),
        ("provider", "/v1/networks/texas", 403),
    ]


async def test_reading_and_calls_of_customers_are_not_logged(
    gateway: Gateway, request_body: Callable[..., Any]
) -> None:
    await gateway.post(request_body())
    await gateway.http.get("/v1/missions", headers=gateway.operator)
    await gateway.http.post("/v1/zones", json={})  # by nobody

    assert await entries(gateway) == []


async def test_a_customers_changes_of_tracking_links_are_logged(gateway: Gateway) -> None:
    path = f"/v1/deliveries/{await gateway.planned()}/tracking-link"
    for method in ("GET", "POST", "DELETE"):
        await gateway.http.request(method, path, headers=gateway.customer)

    logged = [(each["role"], each["method"], each["path"]) for each in await entries(gateway)]
    assert sorted(logged) == [("customer", "DELETE", path), ("customer", "POST", path)]


async def test_the_log_is_paged_and_filtered(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    await close_station(gateway)
    await gateway.http.patch("/v1/providers/prv_1", json={"name": "x"}, headers=gateway.provider)
    await gateway.http.delete("/v1/zones/cls_1", headers=gateway.operator)

    assert len(await entries(gateway)) == 3
    [by_provider] = await entries(gateway, "?role=provider")
    assert await entries(gateway, "?subject_id=prv_1") == [by_provider]
    assert [one["method"] for one in await entries(gateway, "?path=/v1/zo")] == ["DELETE"]
    assert await entries(gateway, "?path=/V1/zones") == []
    assert await entries(gateway, "?path=%25zones") == []
    first = await gateway.http.get("/v1/audit?limit=2", headers=gateway.operator)
    cursor = first.json()["next_cursor"]
    [last] = await entries(gateway, f"?limit=2&cursor={cursor}")
    assert last["path"].startswith("/v1/stations/")


@pytest.mark.parametrize(
    "damage",
    [
        "UPDATE audit SET status = 403",
        "UPDATE audit SET subject_id = 'somebody_else'",
        "UPDATE audit SET body = NULL",
        "DELETE FROM audit",
    ],
)
async def test_an_entry_that_was_changed_later_is_found(gateway: Gateway, damage: str) -> None:
    gateway.is_damaged = True
    await close_station(gateway)
    assert await gateway.verified() == []
    await gateway.execute(damage)

    found = await gateway.verified()

    rule = "the audit log has every entry as it was written"
    assert any(each.startswith(rule) for each in found)


async def test_only_operators_read_the_log(gateway: Gateway) -> None:
    for headers in (gateway.customer, gateway.provider):
        assert (await gateway.http.get("/v1/audit", headers=headers)).status_code == 403


async def test_a_long_body_is_passed_on_whole_and_cut_in_the_log(gateway: Gateway) -> None:
    body = json.dumps({"features": ["x" * 100] * 1000})
    headers = {**gateway.operator, "content-type": "application/json"}
    await gateway.http.put("/v1/networks/texas", content=body, headers=headers)

    [entry] = await entries(gateway)
    assert entry["body"] == body[:LONGEST_BODY]
    assert gateway.forwarded[0].body.decode() == body


@pytest.mark.parametrize(
    ("raw", "kept"),
    [
        (b"", None),
        (b'{"password": "p", "a": 1}', '{"password": "***", "a": 1}'),
        (b'{"mqtt_password":"a\\"b", "b": 2}', '{"mqtt_password":"***", "b": 2}'),
        (b'{"Key": "sk_1", "key_id": "key_1"}', '{"Key": "***", "key_id": "key_1"}'),
        (b'{"enrolment_token": "cut of', '{"enrolment_token": "***"'),
        (b"\xff\x00", "\ufffd\ufffd"),
    ],
)
def test_secrets_and_unstorable_characters_are_removed(raw: bytes, kept: str | None) -> None:
    assert body_text(raw) == kept


def test_a_long_path_is_cut() -> None:
    assert path_text("/v1/x", b"a=b") == "/v1/x?a=b"
    assert len(path_text("/v1/" + "x" * 1000, b"")) == 500


async def test_a_failed_call_is_logged_as_not_answered(gateway: Gateway) -> None:
    gateway.is_damaged = True
    await gateway.execute("DROP TABLE idempotency")
    headers = {**gateway.operator, "Idempotency-Key": "k"}
    requested = {"role": "customer", "subject_id": "carol"}
    answer = await gateway.http.post("/v1/keys", json=requested, headers=headers)

    assert answer.status_code == 500
    [entry] = await entries(gateway)
    assert (entry["path"], entry["status"]) == ("/v1/keys", 0)


async def test_a_lost_log_entry_does_not_hold_back_the_answer(tmp_path: Path) -> None:
    async def answered(scope: Any, _receive: Any, send: Any) -> None:
        scope["state"]["caller"] = Caller("operator", "op")
        await send({"type": "http.response.start", "status": 201})

    async def receive() -> Any:
        return {"type": "http.request"}

    async def keep(message: Any) -> None:
        sent.append(message["status"])

    sent: list[int] = []
    closed = Database(f"sqlite:///{tmp_path}/never-opened.db")
    trail = AuditTrail(answered, db=closed, clock=AnchoredClock.plain(), mint=mint)
    scope = {"type": "http", "method": "POST", "path": "/v1/x", "query_string": b""}
    await trail(scope, receive, keep)

    assert sent == [201]
