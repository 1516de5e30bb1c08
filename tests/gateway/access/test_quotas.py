"""What a tenant may have at the same time: one more is refused, and nothing of it is written."""

from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from skyway_gateway.access.usage import DroneUsage
from skyway_gateway.deliveries.requests.quota_store import DeliveryLimits, DeliveryQuota
from skyway_gateway.notifications.webhook_store import WebhookQuota
from sqlalchemy import text

from skyway.ids import SubjectId
from skyway.runtime.errors import BudgetSpent, Conflict
from skyway.runtime.limits import Slots
from tests.gateway.whole_gateway import Gateway, make_request


class Clock:
    """Seconds that a test sets."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def seconds() -> Clock:
    return Clock()


@pytest.fixture
def limit(gateway: Gateway, seconds: Clock) -> Callable[..., DeliveryQuota]:
    def set_limits(*, live: int, scheduled: int = 100) -> DeliveryQuota:
        quota = DeliveryQuota(gateway.parts.db, DeliveryLimits(live, scheduled), now=seconds)
        replace_part(gateway, "quota", quota)
        return quota

    return set_limits


def replace_part(gateway: Gateway, name: str, part: object) -> None:
    """Parts are frozen: only a test replaces one."""
    object.__setattr__(gateway.parts, name, part)


async def count(gateway: Gateway, table: str) -> int:
    async with gateway.parts.db.read() as connection:
        return int((await connection.execute(text(f"SELECT count(*) FROM {table}"))).scalar_one())


async def quotas(gateway: Gateway, headers: dict[str, str]) -> dict[str, tuple[int, int]]:
    """What GET /v1/limits says: the most and the used of each quota."""
    answer = await gateway.http.get("/v1/limits", headers=headers)
    assert answer.status_code == 200, answer.text
    return {each["code"]: (each["most"], each["used"]) for each in answer.json()["quotas"]}


async def test_callers_see_only_the_quotas_that_they_have(gateway: Gateway) -> None:
    operator, customer, provider = [
        set(await quotas(gateway, each))
        for each in (gateway.operator, gateway.customer, gateway.provider)
    ]

    assert await quotas(gateway, gateway.drone) == {}
    assert "LIVE_VIEWS" not in operator
    assert "LIVE_VIEWS" in customer & provider
    assert "TOO_MANY_DRONES" in provider - customer - operator


def scheduled(gateway: Gateway) -> dict[str, Any]:
    later_at = gateway.clock.now() + timedelta(days=3)
    return make_request(earliest_pickup_at=later_at.isoformat())


async def test_a_customer_has_at_most_so_many_deliveries_that_are_not_over(
    gateway: Gateway, limit: Callable[..., DeliveryQuota], seconds: Clock
) -> None:
    limit(live=10)
    ids = [await gateway.accepted() for _ in range(10)]

    refused = await gateway.post(make_request())

    assert refused.status_code == 409
    assert refused.json()["code"] == "TOO_MANY_DELIVERIES"
    assert await count(gateway, "deliveries") == 10
    other = await gateway.http.post("/v1/deliveries", json=make_request(), headers=gateway.other)
    assert other.status_code == 202

    await gateway.http.post(f"/v1/deliveries/{ids[0]}/cancel", headers=gateway.customer)
    seconds.now_s += 2.0
    assert (await gateway.post(make_request())).status_code == 202
    seconds.now_s += 2.0
    assert (await gateway.post(make_request())).status_code == 409


async def test_a_customer_has_at_most_so_many_scheduled_deliveries(
    gateway: Gateway, limit: Callable[..., DeliveryQuota]
) -> None:
    limit(live=100, scheduled=3)
    for _ in range(3):
        assert (await gateway.post(scheduled(gateway))).status_code == 202

    refused = await gateway.post(scheduled(gateway))

    assert refused.json()["code"] == "TOO_MANY_SCHEDULED"
    assert (await gateway.post(make_request())).status_code == 202
    shown = await quotas(gateway, gateway.customer)
    assert shown["TOO_MANY_DELIVERIES"] == (100, 4)
    assert shown["TOO_MANY_SCHEDULED"] == (3, 3)


async def test_a_repeated_call_is_answered_again_when_the_customer_is_at_the_limit(
    gateway: Gateway, limit: Callable[..., DeliveryQuota]
) -> None:
    limit(live=1)
    first = await gateway.post(make_request(), **{"Idempotency-Key": "once"})

    again = await gateway.post(make_request(), **{"Idempotency-Key": "once"})

    assert (first.status_code, again.status_code) == (202, 202)
    assert first.json() == again.json()


async def test_four_replicas_together_keep_to_the_limit(gateway: Gateway, seconds: Clock) -> None:
    limits = DeliveryLimits(40, 40)
    replicas = [DeliveryQuota(gateway.parts.db, limits, now=seconds) for _ in range(4)]

    accepted = refused = 0
    for number in range(80):
        replace_part(gateway, "quota", replicas[number % 4])
        answer = await gateway.post(make_request())
        accepted += answer.status_code == 202
        refused += answer.status_code == 409

    assert (accepted, refused) == (40, 40)


async def test_an_honest_customer_is_counted_rarely(
    gateway: Gateway, limit: Callable[..., DeliveryQuota], monkeypatch: pytest.MonkeyPatch
) -> None:
    quota = limit(live=20_000)
    async with gateway.parts.db.write() as tx:
        await quota.admit(tx, SubjectId("alice"), is_scheduled=False)
    monkeypatch.setattr(tx.connection, "execute", None)

    for _ in range(4_999):
        await quota.admit(tx, SubjectId("alice"), is_scheduled=False)


async def test_the_memory_of_customers_is_bounded(
    gateway: Gateway, limit: Callable[..., DeliveryQuota]
) -> None:
    quota = limit(live=5)
    async with gateway.parts.db.write() as tx:
        for number in range(10_500):
            await quota.admit(tx, SubjectId(f"c{number}"), is_scheduled=False)

    assert len(quota._rooms) == 10_000


async def test_a_customer_has_at_most_so_many_webhooks(gateway: Gateway) -> None:
    replace_part(gateway, "webhook_quota", WebhookQuota(gateway.parts.db, 2))

    answers = [
        await gateway.http.post(
            "/v1/webhooks", json={"url": "http://127.0.0.1:9/"}, headers=gateway.customer
        )
        for _ in range(3)
    ]

    assert [answer.status_code for answer in answers] == [201, 201, 409]
    assert answers[2].json()["code"] == "TOO_MANY_WEBHOOKS"
    assert (await quotas(gateway, gateway.customer))["TOO_MANY_WEBHOOKS"] == (2, 2)


async def test_a_subject_has_at_most_so_many_keys(
    gateway: Gateway, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gateway.parts.keys, "_most_per_subject", 2)

    async def issue(name: str) -> Any:
        body = {"role": "customer", "subject_id": name}
        return await gateway.http.post("/v1/keys", json=body, headers=gateway.operator)

    first, _, refused = [await issue("carol") for _ in range(3)]

    assert refused.status_code == 409
    assert refused.json()["code"] == "TOO_MANY_KEYS"
    assert (await issue("dora")).status_code == 201
    key_id = first.json()["key_id"]
    await gateway.http.delete(f"/v1/keys/{key_id}", headers=gateway.operator)
    assert (await issue("carol")).status_code == 201


async def test_a_tenant_has_at_most_so_many_streams(gateway: Gateway) -> None:
    slots = Slots("STREAMS", 1)
    replace_part(gateway, "streams", slots)
    delivery_id = await gateway.accepted()

    with slots.held("customer:alice"):
        refused = await gateway.http.get(
            f"/v1/deliveries/{delivery_id}/events", headers=gateway.customer
        )

    assert refused.status_code == 429
    assert refused.json()["code"] == "STREAMS"
    assert refused.headers["retry-after"] == "1"


async def test_a_customer_has_few_test_events_on_their_way(gateway: Gateway) -> None:
    slots = Slots("WEBHOOK_TESTS", 1)
    replace_part(gateway, "trials", slots)
    made = await gateway.http.post(
        "/v1/webhooks", json={"url": "http://127.0.0.1:9/"}, headers=gateway.customer
    )
    path = f"/v1/webhooks/{made.json()['webhook_id']}/test"

    with slots.held("customer:alice"):
        refused = await gateway.http.post(path, headers=gateway.customer)

    assert refused.status_code == 429
    assert refused.json()["code"] == "WEBHOOK_TESTS"
    assert (await gateway.http.post(path, headers=gateway.customer)).status_code == 200


def test_a_slot_is_free_again_after_its_block() -> None:
    slots = Slots("STREAMS", 2)

    with slots.held("alice"), slots.held("alice"), slots.held("bob"):
        with pytest.raises(BudgetSpent):
            slots.held("alice").__enter__()
        assert slots.used("alice") == 2

    assert slots.used("alice") == 0
    assert not slots._used


async def test_a_provider_sees_how_many_drones_it_may_have(gateway: Gateway) -> None:
    shown = await quotas(gateway, gateway.provider)

    assert shown["TOO_MANY_DRONES"] == (20_000, 7)
    assert shown["TOO_MANY_KEYS"] == (100, 1)
    assert isinstance(gateway.parts.drone_usage, DroneUsage)


async def test_a_full_customer_is_not_counted_again_for_a_second(
    gateway: Gateway, limit: Callable[..., DeliveryQuota], monkeypatch: pytest.MonkeyPatch
) -> None:
    quota = limit(live=1)
    await gateway.accepted()
    assert (await gateway.post(make_request())).status_code == 409

    async with gateway.parts.db.write() as tx:
        monkeypatch.setattr(tx.connection, "execute", None)
        with pytest.raises(Conflict, match="TOO_MANY_DELIVERIES"):
            await quota.admit(tx, SubjectId("alice"), is_scheduled=False)
