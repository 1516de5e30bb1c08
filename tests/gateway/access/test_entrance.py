"""The key and the budget of a request are looked at before its body."""

import asyncio
from collections.abc import AsyncIterator
from dataclasses import replace
from typing import Any

import httpx
import pytest
from skyway_gateway.access.recognise import AllKeys
from skyway_gateway.console.console_files import console_files
from skyway_gateway.settings import GatewaySettings

from skyway.runtime.http.delays import Brake
from skyway.runtime.http.entrance import Meters
from skyway.runtime.limits import Budget, Meter, network_of
from tests.gateway.whole_gateway import Gateway


def limit(
    gateway: Gateway, *, tenants: int = 100, refusals: int = 100, addresses: int = 100
) -> None:
    """Give every tenant and address so many requests, which hardly refill."""
    meters = Meters(
        Meter(Budget("TENANT_REQUESTS", 0.001, tenants)),
        Meter(Budget("TENANT_REFUSALS", 0.001, refusals)),
        Meter(Budget("ADDRESS_REQUESTS", 0.001, addresses)),
    )
    brake = Brake(held_s=0)
    entrance = replace(
        gateway.parts.entrance,
        meters=meters,
        brake=brake,
        _recognised={},
    )
    read_keys_without_pause(gateway)
    # Parts are frozen: only a test replaces one.
    object.__setattr__(gateway.parts, "meters", meters)
    object.__setattr__(gateway.parts, "entrance", entrance)


def read_keys_without_pause(gateway: Gateway) -> None:
    """Have wrong keys of an address without budget wait for no other ones."""
    keys = gateway.parts.entrance.keys
    assert isinstance(keys, AllKeys)
    keys._in_use._pause_s = 0


class Body:
    """A body that notes whether it is read."""

    def __init__(self) -> None:
        self.was_read = False

    async def __aiter__(self) -> AsyncIterator[bytes]:
        self.was_read = True
        yield b"{}"


async def get(gateway: Gateway, headers: dict[str, str]) -> httpx.Response:
    return await gateway.http.get("/v1/clock", headers=headers)


@pytest.mark.parametrize("headers", [{}, {"Authorization": "Bearer sk_unknown"}])
@pytest.mark.parametrize(
    "call", ["POST /v1/deliveries", "PUT /v1/networks/x", "POST /internal/mission-reports"]
)
async def test_the_body_of_an_unknown_caller_is_not_read(
    gateway: Gateway, call: str, headers: dict[str, str]
) -> None:
    method, path = call.split(" ")
    body = Body()

    answer = await gateway.http.request(method, path, content=body, headers=headers)

    assert answer.status_code == 401
    assert not body.was_read


async def test_the_body_of_a_tenant_without_budget_is_not_read(gateway: Gateway) -> None:
    limit(gateway, tenants=1)
    await get(gateway, gateway.customer)
    body = Body()

    answer = await gateway.http.post("/v1/quotes", content=body, headers=gateway.customer)

    assert answer.status_code == 429
    assert not body.was_read


async def test_a_tenants_answers_say_what_is_left_until_the_budget_is_spent(
    gateway: Gateway,
) -> None:
    limit(gateway, tenants=3)

    answers = [await get(gateway, gateway.customer) for _ in range(4)]

    assert [answer.status_code for answer in answers] == [200, 200, 200, 429]
    assert [answer.headers["ratelimit-remaining"] for answer in answers] == ["2", "1", "0", "0"]
    refusal = answers[-1]
    assert refusal.json()["code"] == "TENANT_REQUESTS"
    assert refusal.json()["type"] == "urn:skyway:problem:too-many-requests"
    assert int(refusal.headers["retry-after"]) >= 1
    assert refusal.headers["ratelimit-limit"] == "3"


@pytest.mark.parametrize(
    ("method", "path"), [("GET", "/v1/deliveries/dlv_unknown"), ("POST", "/v1/quotes")]
)
async def test_a_tenant_that_is_refused_too_often_has_to_wait(
    gateway: Gateway, method: str, path: str
) -> None:
    limit(gateway, refusals=2)
    calls = [("GET", "/v1/clock"), (method, path), (method, path), ("GET", "/v1/clock")]

    answers = [await gateway.http.request(*call, headers=gateway.customer) for call in calls]

    assert [answer.status_code // 100 for answer in answers] == [2, 4, 4, 4]
    assert answers[-1].json()["code"] == "TENANT_REFUSALS"
    assert int(answers[-1].headers["retry-after"]) >= 1
    assert (await get(gateway, gateway.other)).status_code == 200


async def test_operators_may_be_refused_as_often_as_they_like(gateway: Gateway) -> None:
    limit(gateway, refusals=1)

    for _ in range(3):
        answer = await gateway.http.get("/v1/deliveries/dlv_unknown", headers=gateway.operator)
        assert answer.status_code == 404


async def test_a_spent_budget_is_not_counted_as_a_refusal(gateway: Gateway) -> None:
    limit(gateway, tenants=3, refusals=1)

    answers = [await get(gateway, gateway.customer) for _ in range(6)]

    assert [answer.json().get("code") for answer in answers[3:]] == ["TENANT_REQUESTS"] * 3


async def test_a_tenant_without_budget_takes_nothing_from_another(gateway: Gateway) -> None:
    limit(gateway, tenants=3)
    for _ in range(50):
        await get(gateway, gateway.customer)

    assert (await get(gateway, gateway.other)).status_code == 200


async def test_an_address_that_tries_keys_is_slowed_and_shuts_out_no_known_key(
    gateway: Gateway,
) -> None:
    limit(gateway, addresses=50)
    assert (await get(gateway, gateway.customer)).status_code == 200
    gateway.parts.cached_keys.forget()

    tried = [await get(gateway, {"Authorization": f"Bearer sk_{n}"}) for n in range(20)]

    assert [answer.status_code for answer in tried].count(401) == 4
    assert tried[-1].status_code == 429
    assert tried[-1].json()["code"] == "ADDRESS_REQUESTS"
    assert (await get(gateway, gateway.customer)).status_code == 200


async def test_good_keys_of_one_address_cost_their_address_little(gateway: Gateway) -> None:
    limit(gateway, addresses=60)

    for headers in (gateway.customer, gateway.other, gateway.provider, gateway.operator) * 20:
        assert (await get(gateway, headers)).status_code == 200
        gateway.parts.cached_keys.forget()


async def test_an_enrolment_that_is_refused_costs_more_than_one_that_succeeds(
    gateway: Gateway,
) -> None:
    limit(gateway, addresses=100)

    await gateway.http.post("/v1/enrolments", json={"token": "good"})
    assert gateway.parts.meters.addresses.read("127.0.0.1").left == 99
    gateway.registry.is_away = True
    await gateway.http.post("/v1/enrolments", json={"token": "bad"})
    assert gateway.parts.meters.addresses.read("127.0.0.1").left <= 98


async def test_a_forwarded_address_is_not_believed(gateway: Gateway) -> None:
    limit(gateway, addresses=30)

    answers = [
        await gateway.http.get("/v1/clock", headers={"X-Forwarded-For": f"10.0.0.{number}"})
        for number in range(5)
    ]

    assert [answer.status_code for answer in answers] == [401, 401, 401, 429, 429]


async def test_who_guesses_the_secrets_of_services_spends_the_budget_of_the_address(
    gateway: Gateway,
) -> None:
    limit(gateway, addresses=30)

    answers = [
        await gateway.http.post(
            "/internal/mission-reports", headers={"Authorization": f"Bearer guess_{number}"}
        )
        for number in range(5)
    ]

    assert [answer.status_code for answer in answers] == [401, 401, 401, 429, 429]


async def test_whether_the_process_is_alive_is_always_answered(gateway: Gateway) -> None:
    limit(gateway, addresses=10)
    for _ in range(5):
        await gateway.http.get("/v1/clock")

    assert (await gateway.http.get("/healthz")).status_code == 200
    assert (await gateway.http.get("/metrics")).status_code == 429


@pytest.mark.parametrize("path", ["/v1/providers/a%2fdrones", "/v1/networks/..%5Cx", "/%2Fdocs"])
async def test_an_encoded_slash_is_refused(gateway: Gateway, path: str) -> None:
    answer = await gateway.http.get(path, headers=gateway.operator)

    assert answer.status_code == 400
    assert gateway.forwarded == []


async def test_the_limits_are_shown_to_each_role(gateway: Gateway) -> None:
    limit(gateway, tenants=10)
    for _ in range(4):
        await get(gateway, gateway.customer)

    async def shown(headers: dict[str, str]) -> Any:
        answer = await gateway.http.get("/v1/limits", headers=headers)
        assert answer.status_code == 200
        requests, *refusals = answer.json()["budgets"]
        shown = [(each["code"], each["left"]) for each in refusals]
        assert shown == ([] if headers == gateway.operator else [("TENANT_REFUSALS", 100)])
        return requests

    assert await shown(gateway.customer) | {"full_after_s": 0} == {
        "code": "TENANT_REQUESTS",
        "per_s": 0.001,
        "burst": 10,
        "left": 5,
        "full_after_s": 0,
    }
    for headers in (gateway.provider, gateway.operator, gateway.drone):
        assert (await shown(headers))["left"] == 9


@pytest.mark.parametrize(
    ("host", "network"),
    [
        ("203.0.113.7", "203.0.113.7"),
        ("::ffff:203.0.113.7", "203.0.113.7"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("2001:db8:1:2::99", "2001:db8:1:2::/64"),
        ("no address", ""),
        ("9" * 10_000, ""),
    ],
)
def test_the_addresses_of_one_ipv6_network_pay_together(host: str, network: str) -> None:
    assert network_of(host) == network


async def test_a_tenant_pays_for_the_bytes_of_its_bodies(gateway: Gateway) -> None:
    limit(gateway)
    headers = {**gateway.customer, "Content-Type": "application/json"}

    await gateway.http.post("/v1/compositions", content=b" " * 320 * 1024, headers=headers)

    # One for the request, and one for each 64 KiB beyond the first.
    spent = gateway.parts.meters.tenants.spent("customer:alice")
    assert spent == pytest.approx(5.0, abs=0.01)


async def test_an_address_pays_for_the_bytes_of_its_answers(gateway: Gateway) -> None:
    limit(gateway)

    answer = await gateway.http.get("/docs/assets/swagger-ui-bundle.js")

    spent = 100 - gateway.parts.meters.addresses.read("127.0.0.1").left
    assert spent >= 10 + len(answer.content) // (64 * 1024) - 1


async def test_forty_people_behind_one_address_can_open_the_console_together(
    gateway: Gateway,
) -> None:
    burst: int = GatewaySettings.model_fields["address_requests_burst"].default
    limit(gateway, addresses=burst)
    still = replace(gateway.parts.entrance, now=lambda: 0.0)
    object.__setattr__(gateway.parts, "entrance", still)
    page = ["/console", *(f"/console/{path}" for path in console_files() if path != "index.html")]

    for path in page:
        answer = await gateway.http.get(path, headers={"Accept-Encoding": "gzip"})
        assert answer.status_code == 200, path

    assert gateway.parts.meters.addresses.spent("127.0.0.1") <= burst / 40


async def test_of_requests_that_wait_the_tenant_that_has_spent_least_begins_first(
    gateway: Gateway,
) -> None:
    limit(gateway)
    for name in ("customer", "provider"):
        await get(gateway, getattr(gateway, name))  # from now on both keys are known
    gateway.parts.meters.tenants.charge("customer:alice", 50)
    begun: list[str] = []

    async def ask(name: str, headers: dict[str, str]) -> None:
        await get(gateway, headers)
        begun.append(name)

    await asyncio.gather(*(ask(name, getattr(gateway, name)) for name in ("customer", "provider")))

    assert begun == ["provider", "customer"]


async def test_a_caller_with_too_many_waiting_requests_is_refused(gateway: Gateway) -> None:
    limit(gateway)
    gateway.parts.entrance._turns.slots.most = 0

    answer = await get(gateway, gateway.customer)

    assert (answer.status_code, answer.json()["code"]) == (429, "WAITING_REQUESTS")
