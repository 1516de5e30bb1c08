"""What providers earn: the lines of the ledger, by day."""

from datetime import timedelta
from typing import Any

import pytest

from tests.gateway.whole_gateway import Gateway


async def completed(gateway: Gateway, *, state: str = "COMPLETED") -> None:
    delivery_id = await gateway.planned()
    for seq, kind in enumerate(("ACCEPTED", "LOADING", "LOADED"), start=1):
        await gateway.report(delivery_id, kind, seq=seq)
    await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1"])
    await gateway.report(delivery_id, "ENDED", seq=5, mission_state=state)


async def earnings(gateway: Gateway, query: str = "") -> dict[str, Any]:
    path = f"/v1/providers/prv_1/earnings{query}"
    answer = await gateway.http.get(path, headers=gateway.provider)
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


async def test_missions_that_delivered_are_added_up_by_day(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    await completed(gateway)
    await completed(gateway)
    gateway.clock.advance(timedelta(days=1))
    await completed(gateway)
    await completed(gateway, state="ABORTED")
    await gateway.planned()
    found = await earnings(gateway)
    assert (found["currency"], found["deliveries"], found["amount"]) == ("USD", 4, 4 * 1234)
    assert [(day["day"], day["missions"], day["amount"]) for day in found["by_day"]] == [
        ("2026-03-01", 2, 2468),
        ("2026-03-02", 2, 2468),
    ]


async def test_from_and_to_limit_when_lines_were_written(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    await completed(gateway)
    gateway.clock.advance(timedelta(days=1))
    await completed(gateway)

    async def amount(query: str) -> int:
        return int((await earnings(gateway, query))["amount"])

    assert await amount("?from=2026-03-02T12:00:00Z") == 1234
    assert await amount("?to=2026-03-02T12:00:00Z") == 1234
    assert await amount("?from=2026-03-01T00:00:00Z&to=2026-03-03T00:00:00Z") == 2468
    assert await amount("?from=2026-03-03T00:00:00Z") == 0


async def test_a_provider_without_missions_has_earned_nothing(gateway: Gateway) -> None:
    found = await earnings(gateway)
    assert (found["currency"], found["amount"], found["by_day"]) == (None, 0, [])


async def test_earnings_in_an_earlier_currency_are_only_listed(gateway: Gateway) -> None:
    gateway.is_damaged = True
    await completed(gateway)
    await gateway.execute("UPDATE ledger SET currency = 'EUR'")
    gateway.clock.advance(timedelta(days=1))
    await completed(gateway)
    found = await earnings(gateway)
    assert (found["currency"], found["amount"]) == ("USD", 1234)
    assert [day["currency"] for day in found["by_day"]] == ["EUR", "USD"]


async def test_a_provider_sees_only_its_own_earnings(gateway: Gateway) -> None:
    path = "/v1/providers/prv_2/earnings"
    assert (await gateway.http.get(path, headers=gateway.provider)).status_code == 404
    assert (await gateway.http.get(path, headers=gateway.operator)).status_code == 200
    assert (await gateway.http.get(path, headers=gateway.customer)).status_code == 403


@pytest.mark.parametrize("query", ["?from=yesterday", "?to=2026-03-01T00:00:00", "?until=1"])
async def test_a_bad_period_is_a_problem(gateway: Gateway, query: str) -> None:
    path = f"/v1/providers/prv_1/earnings{query}"
    assert (await gateway.http.get(path, headers=gateway.provider)).status_code == 422
