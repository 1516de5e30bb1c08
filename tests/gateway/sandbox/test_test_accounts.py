"""Keys of test accounts: who makes them, and what they cannot do."""

from typing import Any

import pytest

from tests.gateway.sandbox.played import sandbox_caller
from tests.gateway.whole_gateway import Gateway


async def _made(gateway: Gateway, headers: dict[str, str], **body: Any) -> Any:
    return await gateway.http.post("/v1/keys", json=body, headers=headers)


async def test_a_customer_makes_a_test_key_for_itself(gateway: Gateway) -> None:
    answer = await _made(gateway, gateway.customer, livemode=False, name="ci")

    made = answer.json()
    assert made["key"].startswith("sk_test_")
    assert (made["subject_id"], made["livemode"], made["mqtt"]) == ("test_alice", False, None)


async def test_a_live_key_says_so(gateway: Gateway) -> None:
    answer = await _made(gateway, gateway.operator, role="customer", subject_id="carol")

    assert answer.json()["key"].startswith("sk_live_")
    assert answer.json()["livemode"] is True


async def test_a_repeated_call_gets_the_same_test_key(gateway: Gateway) -> None:
    headers = {**gateway.customer, "Idempotency-Key": "once"}

    answers = [await _made(gateway, headers, livemode=False) for _ in range(2)]

    assert answers[0].json() == answers[1].json()


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"livemode": True},
        {"livemode": False, "subject_id": "bob"},
        {"livemode": False, "role": "operator"},
        {"livemode": False, "subject_id": "test_alice"},
    ],
    ids=str,
)
async def test_a_customer_makes_no_other_key(gateway: Gateway, body: dict[str, Any]) -> None:
    assert (await _made(gateway, gateway.customer, **body)).status_code == 422


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({"role": "customer", "subject_id": "test_bob"}, "subject_id"),
        ({"role": "operator", "subject_id": "test_op"}, "subject_id"),
        ({"role": "provider", "subject_id": "prv_1", "livemode": False}, "livemode"),
        ({"role": "customer", "subject_id": "c" * 60, "livemode": False}, "subject_id"),
        ({"role": "customer"}, "subject_id"),
        ({"subject_id": "carol"}, "role"),
    ],
    ids=str,
)
async def test_an_operator_makes_no_live_test_account(
    gateway: Gateway, body: dict[str, Any], field: str
) -> None:
    answer = await _made(gateway, gateway.operator, **body)

    assert answer.status_code == 422
    assert field in answer.text


async def test_a_test_key_makes_no_keys(gateway: Gateway) -> None:
    headers = await sandbox_caller(gateway)

    for livemode in (True, False):
        assert (await _made(gateway, headers, livemode=livemode)).status_code == 403


async def test_a_rotated_test_key_is_a_test_key(gateway: Gateway) -> None:
    headers = await sandbox_caller(gateway)

    answer = await gateway.http.post("/v1/keys/rotations", headers=headers)

    made = answer.json()
    assert made["key"].startswith("sk_test_")
    assert (made["subject_id"], made["mqtt"]) == ("test_alice", None)


async def test_test_keys_are_limited_as_live_ones(gateway: Gateway) -> None:
    most = gateway.parts.keys._most_per_subject
    for _ in range(most):
        await sandbox_caller(gateway)

    answer = await _made(gateway, gateway.customer, livemode=False)

    assert (answer.status_code, answer.json()["code"]) == (409, "TOO_MANY_KEYS")


async def test_a_customer_sees_its_test_keys_and_deletes_them(gateway: Gateway) -> None:
    test = await sandbox_caller(gateway)

    found = (await gateway.http.get("/v1/keys", headers=gateway.customer)).json()["items"]
    [key_id] = [each["key_id"] for each in found if not each["livemode"]]
    deleted = await gateway.http.delete(f"/v1/keys/{key_id}", headers=gateway.customer)

    assert {each["subject_id"] for each in found} == {"alice", "test_alice"}
    assert deleted.status_code == 204
    assert (await gateway.http.get("/v1/keys", headers=test)).status_code == 401


async def test_a_customer_does_not_delete_its_live_key(gateway: Gateway) -> None:
    answer = await gateway.http.delete("/v1/keys/key_customer", headers=gateway.customer)

    assert answer.status_code == 403


async def test_a_test_key_sees_no_live_key(gateway: Gateway) -> None:
    headers = await sandbox_caller(gateway)

    found = (await gateway.http.get("/v1/keys", headers=headers)).json()["items"]
    live = await gateway.http.get("/v1/keys/key_customer", headers=headers)

    assert {each["subject_id"] for each in found} == {"test_alice"}
    assert live.status_code == 404


@pytest.mark.parametrize("path", ["/v1/sessions", "/v1/session-links"])
async def test_a_test_key_does_not_log_in_to_the_console(gateway: Gateway, path: str) -> None:
    headers = await sandbox_caller(gateway)

    answer = await gateway.http.post(path, headers=headers)

    assert answer.status_code == 403
    assert "console" in answer.text
