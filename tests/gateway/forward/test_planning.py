"""Compositions, quotes and reports: sizes of tenants, and turns between them."""

from collections.abc import AsyncIterator

import pytest

from skyway.runtime.limits import FairQueue
from tests.gateway.whole_gateway import Gateway, make_request

#: 256 KiB, and 1 KiB for each of 2,000 stations.
TENANTS_BYTES = 256 * 1024 + 2_000 * 1024


@pytest.fixture
def full(gateway: Gateway) -> FairQueue:
    """A queue in which no work may wait; one may run."""
    queue = FairQueue("PLANNING", at_once=1, per_tenant=1, most_waiting=0)
    for name in ("composing", "quoting", "reporting"):
        object.__setattr__(gateway.parts, name, queue)  # parts are frozen
    return queue


async def padded(size: int) -> AsyncIterator[bytes]:
    """A problem of so many bytes."""
    yield b'{"a":"'
    left = size - len(b'{"a":""}')
    while left:
        part = min(left, 65_536)
        yield b"x" * part
        left -= part
    yield b'"}'


@pytest.mark.parametrize("is_announced", [True, False])
async def test_a_tenants_problem_has_a_limit_and_an_operators_a_larger_one(
    gateway: Gateway, *, is_announced: bool
) -> None:
    async def send(size: int, headers: dict[str, str]) -> int:
        given = {**headers, "content-type": "application/json"}
        if is_announced:
            given["content-length"] = str(size)
        answer = await gateway.http.post("/v1/compositions", content=padded(size), headers=given)
        return answer.status_code

    assert await send(TENANTS_BYTES, gateway.customer) == 200
    assert await send(TENANTS_BYTES + 1, gateway.customer) == 413
    assert await send(TENANTS_BYTES + 1, gateway.provider) == 413
    assert await send(TENANTS_BYTES + 1, gateway.operator) == 200


async def test_a_tenant_with_too_many_waiting_plans_is_refused(
    gateway: Gateway, full: FairQueue
) -> None:
    async with full.turn("customer:alice"):
        composition = await gateway.http.post("/v1/compositions", json={}, headers=gateway.customer)
        quote = await gateway.http.post("/v1/quotes", json=make_request(), headers=gateway.customer)

    for answer in (composition, quote):
        assert answer.status_code == 429
        assert answer.json()["code"] == "PLANNING"
        assert answer.headers["retry-after"] == "1"
    assert gateway.forwarded == []


async def test_dry_runs_take_turns_with_other_plans(gateway: Gateway, full: FairQueue) -> None:
    commands = "/v1/missions/msn_1/commands"
    async with full.turn("operator:op"):
        dry_runs = [
            await gateway.http.post(f"{path}?dry_run=true", json={}, headers=gateway.operator)
            for path in (commands, "/v1/stations/kyle/closures")
        ]
        given = await gateway.http.post(
            f"{commands}?dry_run=false", json={}, headers=gateway.operator
        )

    assert [answer.json()["code"] for answer in dry_runs] == ["PLANNING", "PLANNING"]
    assert given.status_code == 200
    assert len(gateway.forwarded) == 1


@pytest.mark.parametrize(
    "path",
    [
        "/v1/stats/deliveries",
        "/v1/stats/missions",
        "/v1/stats/drones",
        "/v1/stats/pads",
        "/v1/stats/fleets",
        "/v1/providers/prv_1/earnings",
        "/v1/providers/prv_1/schedule",
        "/v1/providers/prv_1/drones/drn_1/telemetry",
        "/v1/stations/kyle/schedule",
        "/v1/networks/city",
        "/v1/drones/drn_1/plans",
        "/v1/closures",
    ],
)
async def test_reports_take_turns_and_delay_no_other_call(
    gateway: Gateway, full: FairQueue, path: str
) -> None:
    async with full.turn("provider:prv_1"):
        report = await gateway.http.get(path, headers=gateway.provider)
        other = await gateway.http.get("/v1/missions", headers=gateway.provider)

    assert (report.status_code, report.json()["code"]) == (429, "PLANNING")
    assert other.status_code == 200
