"""`skyway verify` names keys, sessions and tracking links that are not what the audit log says."""

from datetime import timedelta
from typing import Any

import pytest

from tests.gateway.whole_gateway import Gateway

KEY = "a key was made, and is deleted, as the audit log says"
LOGIN = "a session or login link lasts no longer than its span, and its begin was logged"
LINK = "a tracking link was renewed and withdrawn as the audit log says"

#: A span after which each call is surely logged.
LATER = timedelta(minutes=1)


@pytest.fixture
async def used(gateway_on_both: Gateway) -> Any:
    """A gateway with keys of each kind, logins, and a renewed and a withdrawn tracking link."""
    gateway = gateway_on_both
    for body in (
        {"role": "customer", "subject_id": "carol", "scopes": ["deliveries:read"]},
        {"role": "customer", "subject_id": "dave", "expires_wall_at": "2026-03-05T00:00:00Z"},
        {"role": "operator", "subject_id": "lee", "name": "laptop"},
    ):
        made = await gateway.http.post("/v1/keys", json=body, headers=gateway.operator)
        assert made.status_code == 201, made.text
    await gateway.http.delete(f"/v1/keys/{made.json()['key_id']}", headers=gateway.operator)
    rotated = await gateway.http.post("/v1/keys/rotations", headers=gateway.customer)
    assert rotated.status_code == 201
    for headers in (gateway.operator, gateway.provider, gateway.customer):
        await gateway.http.post("/v1/sessions", headers=headers)
        gateway.http.cookies.clear()
    link = (await gateway.http.post("/v1/session-links", headers=gateway.operator)).json()
    code = link["url"].rpartition("=")[2] if "url" in link else ""
    own = {"Origin": "http://gateway"}
    await gateway.http.post("/v1/sessions", json={"code": code}, headers=own)
    gateway.http.cookies.clear()
    first, second = await gateway.planned(), await gateway.planned()
    for method, delivery_id in (("POST", first), ("POST", second), ("DELETE", second)):
        path = f"/v1/deliveries/{delivery_id}/tracking-link"
        await gateway.http.request(method, path, headers=gateway.customer)
    gateway.clock.advance(LATER)
    assert await gateway.verified() == []
    return gateway


DAMAGES = [
    ("an operator's key of a customer", "SET role = 'operator' WHERE subject_id = 'carol'", KEY),
    ("more scopes", "SET scopes = NULL WHERE subject_id = 'carol'", KEY),
    (
        "a later end",
        "SET expires_wall_ms = NULL, ends_wall_ms = NULL WHERE subject_id = 'dave'",
        KEY,
    ),
    ("a deleted key in use", "SET deleted_wall_ms = NULL WHERE subject_id = 'lee'", KEY),
]


@pytest.mark.databases("postgresql")
@pytest.mark.parametrize(
    ("damage", "rule"),
    [
        *(pytest.param(f"UPDATE api_keys {sql}", rule, id=name) for name, sql, rule in DAMAGES),
        pytest.param("DELETE FROM api_keys WHERE subject_id = 'carol'", KEY, id="a key deleted"),
        pytest.param(
            "UPDATE sessions SET expires_wall_ms = expires_wall_ms + 3600000", LOGIN, id="longer"
        ),
        pytest.param(
            "UPDATE sessions SET key_id = (SELECT key_id FROM api_keys WHERE subject_id = 'lee')",
            LOGIN,
            id="a session of somebody else",
        ),
        pytest.param(
            "UPDATE session_links SET expires_wall_ms = expires_wall_ms + 3600000",
            LOGIN,
            id="a link that lasts longer",
        ),
        pytest.param("DELETE FROM tracking_links", LINK, id="links deleted"),
        pytest.param(
            "UPDATE tracking_links SET is_withdrawn = (1 = 0)", LINK, id="a link open again"
        ),
        pytest.param("UPDATE tracking_links SET number = 1", LINK, id="an earlier link"),
    ],
)
async def test_a_value_that_is_not_what_the_log_says_is_named(
    used: Gateway, damage: str, rule: str
) -> None:
    used.is_damaged = True
    await used.execute(damage)

    assert rule in await used.verified()


async def test_what_was_made_before_the_log_was_pruned_is_not_judged(used: Gateway) -> None:
    last = "(SELECT max(number) FROM audit)"
    await used.execute(
        f"UPDATE audit_head SET pruned_entries = {last} - 1, pruned_hash ="
        f" (SELECT hash FROM audit WHERE number = {last} - 1)"
    )
    await used.execute(f"DELETE FROM audit WHERE number < {last}")

    assert await used.verified() == []
