"""API keys: shown once, stored as hashes, deleted with immediate effect, cached for a second."""

import asyncio
from datetime import timedelta
from typing import Any

import pytest
from skyway_gateway.clients import RestRegistry

from skyway.runtime.errors import ServiceUnavailable
from tests.gateway.whole_gateway import Gateway


async def _issue(gateway: Gateway, role: str, subject_id: str, **headers: str) -> Any:
    return await gateway.http.post(
        "/v1/keys",
        json={"role": role, "subject_id": subject_id},
        headers={**gateway.operator, **headers},
    )


def _bearer(key: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {key}"}


async def test_a_customers_key_comes_with_a_broker_account(gateway: Gateway) -> None:
    answer = await _issue(gateway, "customer", "carol")
    assert answer.status_code == 201
    issued = answer.json()
    assert answer.headers["location"] == f"/v1/keys/{issued['key_id']}"
    assert issued["key"].startswith("sk_")
    assert issued["mqtt"]["user_name"] == "carol"
    assert gateway.registry.accounts == {"carol": issued["mqtt"]["password"]}
    listed = await gateway.http.get("/v1/deliveries", headers=_bearer(issued["key"]))
    assert listed.status_code == 200


async def test_each_operator_has_an_account_and_providers_have_none(gateway: Gateway) -> None:
    logins = [(await _issue(gateway, "operator", name)).json()["mqtt"] for name in ("olga", "otto")]
    assert [login["user_name"] for login in logins] == ["operator/olga", "operator/otto"]
    assert (await _issue(gateway, "provider", "prv_1")).json()["mqtt"] is None
    assert gateway.registry.accounts == {each["user_name"]: each["password"] for each in logins}


async def test_a_customer_and_an_operator_of_one_name_have_an_account_each(
    gateway: Gateway,
) -> None:
    issued = (await _issue(gateway, "operator", "carol")).json()
    await _issue(gateway, "customer", "carol")
    await gateway.http.delete(f"/v1/keys/{issued['key_id']}", headers=gateway.operator)

    await gateway.parts.keys.close_orphaned_accounts()

    assert list(gateway.registry.accounts) == ["carol"]


async def test_no_operator_gets_the_name_of_the_deployments_own_account(gateway: Gateway) -> None:
    assert (await _issue(gateway, "operator", "deployment")).status_code == 422


async def test_a_provider_must_be_registered_before_it_gets_a_key(
    gateway: Gateway, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def has_provider(self: object, provider_id: str, *, caller: object) -> bool:
        return provider_id != "prv_unknown"

    monkeypatch.setattr(RestRegistry, "has_provider", has_provider)

    answer = await _issue(gateway, "provider", "prv_unknown")

    assert answer.status_code == 422
    assert answer.json()["errors"] == [
        {"field": "subject_id", "detail": "no provider 'prv_unknown' is registered"}
    ]
    assert (await _issue(gateway, "provider", "prv_1")).status_code == 201


@pytest.mark.parametrize("name", ["operator", "gateway", "registry", "composition", "drn_01"])
async def test_a_customer_cannot_have_the_name_of_a_process_or_a_drone(
    gateway: Gateway, name: str
) -> None:
    answer = await _issue(gateway, "customer", name)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == "subject_id"


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({"role": "admin", "subject_id": "x"}, "role"),
        ({"role": "customer", "subject_id": "a b"}, "subject_id"),
        ({"role": "customer", "subject_id": "x" * 65}, "subject_id"),
        ({"role": "customer"}, "subject_id"),
    ],
)
async def test_a_bad_key_request_names_the_field(
    gateway: Gateway, body: dict[str, str], field: str
) -> None:
    answer = await gateway.http.post("/v1/keys", json=body, headers=gateway.operator)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == field


async def test_others_than_customers_and_operators_see_no_keys(gateway: Gateway) -> None:
    for headers, status in ((gateway.provider, 403), (gateway.drone, 403), ({}, 401)):
        for method, path in (
            ("POST", "/v1/keys"),
            ("GET", "/v1/keys"),
            ("GET", "/v1/keys/key_customer"),
            ("DELETE", "/v1/keys/key_customer"),
        ):
            body = {"role": "customer", "subject_id": "x"} if method == "POST" else None
            answer = await gateway.http.request(method, path, json=body, headers=headers)
            assert answer.status_code == status, (method, path)


async def test_the_database_holds_no_readable_keys(gateway: Gateway, tmp_path: Any) -> None:
    headers = {"Idempotency-Key": "k"}
    issued = (await _issue(gateway, "customer", "carol", **headers)).json()
    content = b"".join(path.read_bytes() for path in tmp_path.glob("service.db*"))
    assert issued["key_id"].encode() in content
    for secret in (issued["key"], issued["mqtt"]["password"]):
        assert secret.encode() not in content


async def test_a_deleted_key_stops_immediately_and_its_account_is_closed(gateway: Gateway) -> None:
    first = (await _issue(gateway, "customer", "carol")).json()
    second = (await _issue(gateway, "customer", "carol")).json()
    for key, accounts in ((first, {"carol"}), (second, set())):
        path = f"/v1/keys/{key['key_id']}"
        assert (await gateway.http.delete(path, headers=gateway.operator)).status_code == 204
        stopped = await gateway.http.get("/v1/deliveries", headers=_bearer(key["key"]))
        assert stopped.status_code == 401
        assert (await gateway.http.delete(path, headers=gateway.operator)).status_code == 404
        await gateway.parts.keys.close_orphaned_accounts()
        assert set(gateway.registry.accounts) == accounts


async def test_an_account_is_closed_when_the_registry_is_back(gateway: Gateway) -> None:
    issued = (await _issue(gateway, "customer", "carol")).json()
    gateway.registry.is_away = True
    await gateway.http.delete(f"/v1/keys/{issued['key_id']}", headers=gateway.operator)
    with pytest.raises(ServiceUnavailable):
        await gateway.parts.keys.close_orphaned_accounts()
    gateway.registry.is_away = False
    await gateway.parts.keys.close_orphaned_accounts()
    assert gateway.registry.accounts == {}
    gateway.registry.accounts["carol"] = "opened by somebody else"
    await gateway.parts.keys.close_orphaned_accounts()
    assert gateway.registry.accounts != {}, "closed once only"


async def test_repeating_the_call_opens_the_account_of_a_key(
    gateway: Gateway,
) -> None:
    headers = {"Idempotency-Key": "k"}
    gateway.registry.is_away = True
    assert (await _issue(gateway, "customer", "carol", **headers)).status_code == 503
    gateway.registry.is_away = False
    issued = (await _issue(gateway, "customer", "carol", **headers)).json()
    assert gateway.registry.accounts == {"carol": issued["mqtt"]["password"]}
    listed = await gateway.http.get("/v1/keys?subject_id=carol", headers=gateway.operator)
    assert len(listed.json()["items"]) == 1


async def test_a_repeated_call_does_not_restore_an_old_password(gateway: Gateway) -> None:
    headers = {"Idempotency-Key": "k"}
    old = (await _issue(gateway, "customer", "carol", **headers)).json()
    new = (await _issue(gateway, "customer", "carol")).json()
    assert (await _issue(gateway, "customer", "carol", **headers)).json() == old
    assert gateway.registry.accounts == {"carol": new["mqtt"]["password"]}


async def test_the_first_keys_are_added_once_and_stay_deleted(gateway: Gateway) -> None:
    operator = _bearer("operator_key-0123456789abcdef")
    new_customer = _bearer("customer_key-0123456789abcdef")
    assert (await gateway.http.get("/v1/deliveries", headers=new_customer)).status_code == 200
    listed = await gateway.http.get("/v1/keys?role=customer", headers=operator)
    [key] = [one for one in listed.json()["items"] if one["subject_id"] == "newcomer"]
    await gateway.http.delete(f"/v1/keys/{key['key_id']}", headers=operator)
    await gateway.parts.keys.make_first_keys()
    assert (await gateway.http.get("/v1/deliveries", headers=new_customer)).status_code == 401
    (gateway.secrets_dir / "customer_key").write_text("another-0123456789abcdef")
    await gateway.parts.keys.make_first_keys()
    another = _bearer("another-0123456789abcdef")
    assert (await gateway.http.get("/v1/deliveries", headers=another)).status_code == 200


async def test_keys_are_listed_in_pages_without_secrets(gateway: Gateway) -> None:
    found, cursor = [], ""
    while cursor is not None:
        query = f"?limit=2{f'&cursor={cursor}' if cursor else ''}"
        page = (await gateway.http.get(f"/v1/keys{query}", headers=gateway.operator)).json()
        found += page["items"]
        cursor = page["next_cursor"]
    assert len(found) == 6
    assert not [key for key in found if set(key) & {"key", "key_hash", "mqtt"}]
    one = await gateway.http.get("/v1/keys/key_customer", headers=gateway.operator)
    assert one.json()["subject_id"] == "alice"


DELETED_ELSEWHERE = "UPDATE api_keys SET deleted_wall_ms = 1 WHERE key_id = 'key_customer'"


async def status(gateway: Gateway) -> int:
    answer = await gateway.http.get("/v1/deliveries", headers=gateway.customer)
    return int(answer.status_code)


async def test_a_key_that_another_replica_deletes_stops_within_a_second(gateway: Gateway) -> None:
    before = await status(gateway)
    await gateway.execute(DELETED_ELSEWHERE)
    gateway.clock.advance(timedelta(seconds=1))

    assert (before, await status(gateway)) == (200, 401)


async def test_a_key_that_is_deleted_here_stops_immediately(gateway: Gateway) -> None:
    before = await status(gateway)
    await gateway.http.delete("/v1/keys/key_customer", headers=gateway.operator)

    assert (before, await status(gateway)) == (200, 401)


async def test_a_key_that_is_deleted_during_its_lookup_is_not_cached(gateway: Gateway) -> None:
    cached = gateway.parts.cached_keys
    lookup = asyncio.create_task(cached.recognise("sk_customer"))
    await asyncio.sleep(0)  # it has begun

    cached.forget()
    await lookup
    await gateway.execute(DELETED_ELSEWHERE)

    assert await status(gateway) == 401


#: All calls that a drone may make; the services check what is its own.
ALLOWED = {
    ("GET", "/v1/clock"),
    ("GET", "/v1/limits"),
    ("GET", "/v1/missions"),
    ("GET", "/v1/missions/{mission_id}"),
    ("GET", "/v1/networks/{network_id}/stations"),
    ("GET", "/v1/providers/{provider_id}/drones/{drone_id}"),
    ("GET", "/v1/providers/{provider_id}/drones/{drone_id}/telemetry"),
    ("GET", "/v1/stations/{station_id}/pads"),
    ("POST", "/v1/enrolments"),
    ("POST", "/v1/enrolments/rotations"),
    # Its address is the secret.
    ("PUT", "/v1/proofs/uploads/{token}"),
}


async def test_a_revoked_key_stops_with_the_next_call(gateway: Gateway) -> None:
    before = await gateway.http.get("/v1/clock", headers=gateway.drone)

    gateway.registry.drone_keys.clear()

    after = await gateway.http.get("/v1/clock", headers=gateway.drone)
    assert (before.status_code, after.status_code) == (200, 401)


async def test_a_drone_key_works_again_after_the_registry_was_away(gateway: Gateway) -> None:
    gateway.registry.is_away = True

    answer = await gateway.http.get("/v1/clock", headers=gateway.drone)

    assert answer.status_code == 503


@pytest.mark.parametrize("key", ["dk_", "dk_unknown", "sk_drone", "drn_1"])
async def test_an_invented_drone_key_is_refused(gateway: Gateway, key: str) -> None:
    answer = await gateway.http.get("/v1/clock", headers={"Authorization": f"Bearer {key}"})

    assert answer.status_code == 401


async def test_a_drone_may_make_only_the_listed_calls(
    gateway: Gateway, subtests: pytest.Subtests
) -> None:
    ids = dict.fromkeys(("pad",), "0")
    for path, operations in (await gateway.http.get("/openapi.json")).json()["paths"].items():
        for method in (name.upper() for name in operations):
            with subtests.test(f"{method} {path}"):
                url = "/".join(
                    ids.get(level[1:-1], "x_1") if level.startswith("{") else level
                    for level in path.split("/")
                )

                answer = await gateway.http.request(method, url, json={}, headers=gateway.drone)

                is_allowed = (method, path) in ALLOWED or not path.startswith("/v1/")
                # A call that reads its body first may refuse the empty body before the role.
                refused = {403, 422} if not is_allowed else {403}
                assert (answer.status_code in refused) is not is_allowed, answer.text
