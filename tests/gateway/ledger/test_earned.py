"""Earnings of a month by day, drone and route agree with the statement."""

from datetime import timedelta
from typing import Any

import pytest

from tests.gateway.ledger.paid_world import MONTH, asked, delivered
from tests.gateway.whole_gateway import Gateway


async def earned(gateway: Gateway, by: str, **query: str) -> list[dict[str, Any]]:
    return await asked(gateway, "/earnings", who=gateway.provider, by=by, **query)


@pytest.mark.parametrize("by", ["day", "drone", "route"])
async def test_the_sum_over_all_rows_is_the_amount_of_the_statement(
    gateway_on_both: Gateway, by: str
) -> None:
    gateway = gateway_on_both
    await delivered(gateway)
    gateway.clock.advance(timedelta(days=1))
    await delivered(gateway, later=timedelta(hours=2))

    rows = await earned(gateway, by)

    [statement] = await asked(gateway, who=gateway.provider)
    assert sum(row["amount"] for row in rows) == statement["amount"] == 1234 + 617
    assert len(rows) == (2 if by == "day" else 1)


async def test_a_row_names_its_day_its_drone_or_its_route(gateway: Gateway) -> None:
    delivery_id = await delivered(gateway)
    delivery = await gateway.get(delivery_id)

    [day], [drone], [route] = [await earned(gateway, by) for by in ("day", "drone", "route")]

    assert (day["day"], day["drone_id"], day["deliveries"]) == ("2026-03-01", None, 1)
    assert drone["drone_id"] == delivery["missions"][0]["drone_id"]
    ends = (route["from_station_id"], route["to_station_id"])
    destination = delivery["packages"][0]["destination"]["station_id"]
    assert ends == (delivery["request"]["pickup"]["station_id"], destination)


async def test_pages_and_csv_have_all_days(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    await delivered(gateway)
    gateway.clock.advance(timedelta(days=1))
    await delivered(gateway)
    params = {"month": MONTH, "by": "day", "limit": "1"}
    headers = {**gateway.provider, "Accept": "text/csv"}

    first = await gateway.http.get("/v1/statements/earnings", params=params, headers=headers)
    following = first.headers["link"].partition(">")[0].removeprefix("<")
    second = await gateway.http.get(following, headers=headers)

    assert "2026-03-01" in first.text
    assert "2026-03-02" in second.text
    assert "link" not in second.headers


async def test_providers_see_their_own_earnings_only(gateway: Gateway) -> None:
    await delivered(gateway)
    body = {"role": "provider", "subject_id": "prv_2"}
    made = await gateway.http.post("/v1/keys", json=body, headers=gateway.operator)
    other = {"Authorization": f"Bearer {made.json()['key']}"}

    assert await asked(gateway, "/earnings", who=other, by="day", provider_id="prv_1") == []
    assert len(await asked(gateway, "/earnings", by="day", provider_id="prv_1")) == 1
    path = "/v1/statements/earnings?by=day"
    assert (await gateway.http.get(path, headers=gateway.customer)).status_code == 403


@pytest.mark.parametrize("query", ["?by=customer", "?by=day&month=March"])
async def test_a_query_of_no_earnings_is_refused(gateway: Gateway, query: str) -> None:
    path = f"/v1/statements/earnings{query}"
    answer = await gateway.http.get(path, headers=gateway.provider)

    assert answer.status_code == 422
