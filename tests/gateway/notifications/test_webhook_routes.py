"""Webhooks over REST: the caller's own, secrets once, bad targets refused."""

from typing import Any

import pytest
from sqlalchemy import text

from tests.gateway.whole_gateway import Gateway

URL = "http://127.0.0.1:9/in"


async def _made(gateway: Gateway, **headers: str) -> dict[str, Any]:
    answer = await gateway.http.post(
        "/v1/webhooks", json={"url": URL}, headers={**gateway.customer, **headers}
    )
    assert answer.status_code == 201, answer.text
    made: dict[str, Any] = answer.json()
    return made


async def test_the_secret_is_shown_once(gateway: Gateway) -> None:
    made = await _made(gateway)
    assert made["secret"].startswith("whsec_")
    path = f"/v1/webhooks/{made['webhook_id']}"
    shown = (await gateway.http.get(path, headers=gateway.customer)).json()
    assert shown == {name: value for name, value in made.items() if name != "secret"}
    listed = (await gateway.http.get("/v1/webhooks", headers=gateway.customer)).json()
    assert listed["items"] == [shown]


async def test_the_same_idempotency_key_makes_one_webhook(gateway: Gateway) -> None:
    first = await _made(gateway, **{"Idempotency-Key": "k"})
    assert await _made(gateway, **{"Idempotency-Key": "k"}) == first


@pytest.mark.parametrize(
    ("url", "detail"),
    [
        ("http://10.0.0.1/", "not a public address"),
        ("ftp://example.com/", "http://"),
        ("http://user:pw@127.0.0.1/", "user name"),
        ("", "at least 1 character"),
        ("http://127.0.0.1/" + "x" * 2000, "at most 2000"),
    ],
)
async def test_a_bad_target_is_refused_by_field(gateway: Gateway, url: str, detail: str) -> None:
    made = await _made(gateway)
    for method, path in (("POST", "/v1/webhooks"), ("PATCH", f"/v1/webhooks/{made['webhook_id']}")):
        answer = await gateway.http.request(
            method, path, json={"url": url}, headers=gateway.customer
        )
        assert answer.status_code == 422
        [error] = answer.json()["errors"]
        assert error["field"] == "url"
        assert detail in error["detail"]


async def test_a_webhook_of_another_customer_is_not_found(gateway: Gateway) -> None:
    path = f"/v1/webhooks/{(await _made(gateway))['webhook_id']}"
    for method, url in (
        ("GET", path),
        ("DELETE", path),
        ("POST", f"{path}/test"),
        ("GET", f"{path}/attempts"),
    ):
        answer = await gateway.http.request(method, url, headers=gateway.other)
        assert answer.status_code == 404, url
    changed = await gateway.http.patch(path, json={"url": URL}, headers=gateway.other)
    assert changed.status_code == 404
    listed = await gateway.http.get("/v1/webhooks", headers=gateway.other)
    assert listed.json()["items"] == []


async def test_a_webhook_is_changed_disabled_and_deleted(gateway: Gateway) -> None:
    path = f"/v1/webhooks/{(await _made(gateway))['webhook_id']}"

    async def change(**fields: object) -> dict[str, Any]:
        answer = await gateway.http.patch(path, json=fields, headers=gateway.customer)
        assert answer.status_code == 200, answer.text
        changed: dict[str, Any] = answer.json()
        return changed

    assert (await change(event_types=["package.delivered"]))["event_types"] == ["package.delivered"]
    assert (await change(event_types=None))["event_types"] is None
    disabled = await change(state="DISABLED")
    assert (disabled["state"], disabled["disabled_reason"]) == ("DISABLED", "by its customer")
    await gateway.accepted()
    deleted = await gateway.http.delete(path, headers=gateway.customer)
    assert deleted.status_code == 204
    assert (await gateway.http.get(path, headers=gateway.customer)).status_code == 404


@pytest.mark.parametrize("field", ["url", "state"])
async def test_url_and_state_cannot_be_set_to_null(gateway: Gateway, field: str) -> None:
    path = f"/v1/webhooks/{(await _made(gateway))['webhook_id']}"
    answer = await gateway.http.patch(path, json={field: None}, headers=gateway.customer)
    assert answer.status_code == 422


async def test_any_key_may_read_the_fleet_clock(gateway: Gateway) -> None:
    answer = await gateway.http.get("/v1/clock", headers=gateway.provider)
    assert answer.json()["rate"] == 1.0
    assert set(answer.json()) == {"fleet_at", "wall_at", "rate", "now"}
    assert (await gateway.http.get("/v1/clock")).status_code == 401


async def test_a_disabled_webhook_misses_events(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    path = f"/v1/webhooks/{(await _made(gateway))['webhook_id']}"
    for state in ("DISABLED", "ACTIVE"):
        answer = await gateway.http.patch(path, json={"state": state}, headers=gateway.customer)
        assert answer.status_code == 200
        last = await gateway.accepted()
    async with gateway.parts.db.read() as connection:
        due = await connection.execute(text("SELECT delivery_id FROM notifications"))
    assert due.scalars().all() == [last]
