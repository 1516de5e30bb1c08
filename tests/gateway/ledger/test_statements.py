"""Statements: both sides add up, each party sees its own, and a closed month never changes."""

import asyncio
import csv
import json
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from skyway_gateway.ledger.store import close_month
from sqlalchemy import text

from tests.gateway.ledger.paid_world import MONTH, asked, booked, closing_of, delivered
from tests.gateway.whole_gateway import Gateway

APRIL = "2026-04"


async def posted(gateway: Gateway, **body: object) -> Any:
    return await gateway.http.post("/v1/statements/lines", json=body, headers=gateway.operator)


async def close(gateway: Gateway, *, at: datetime = datetime(2026, 4, 4, tzinfo=UTC)) -> None:
    gateway.clock.advance(at - gateway.clock.now())
    await closing_of(gateway).step()


async def test_customers_pay_what_providers_get(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    await delivered(gateway)
    await delivered(gateway, later=timedelta(hours=2))

    customer, provider = await asked(gateway)

    assert (customer["role"], customer["party_id"]) == ("customer", "alice")
    assert (provider["role"], provider["party_id"]) == ("provider", "prv_1")
    assert customer["amount"] == provider["amount"] == 1234 + 617
    assert (customer["deliveries"], customer["lines"], customer["closed_at"]) == (2, 5, None)
    items = {kind: amount for kind, amount in customer["items"].items() if amount}
    assert items == {"base": 1000, "distance": 1468, "lateness": -617}


async def test_each_party_sees_only_its_own(gateway: Gateway) -> None:
    await delivered(gateway)

    others = {"role": "provider", "party_id": "alice"}
    for who, expected in (
        (gateway.customer, ["alice"]),
        (gateway.other, []),
        (gateway.provider, ["prv_1"]),
    ):
        found = await asked(gateway, who=who, **others)
        assert [each["party_id"] for each in found] == expected
        lines = await asked(gateway, "/lines", who=who, **others)
        assert len(lines) == 2 * len(expected)


async def test_a_change_of_currency_makes_two_statements(gateway: Gateway) -> None:
    await delivered(gateway)
    gateway.is_damaged = True
    await gateway.execute("UPDATE ledger SET currency = 'EUR'")
    await delivered(gateway)

    found = await asked(gateway, role="customer")

    assert [(each["currency"], each["amount"]) for each in found] == [("EUR", 1234), ("USD", 1234)]


async def test_pages_of_statements_and_lines_follow_one_another(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    await delivered(gateway)
    for path, expected in (("", 2), ("/lines", 2)):
        seen = 0
        cursor: dict[str, str | None] = {}
        for _ in range(expected):
            params = {"month": MONTH, "limit": "1", **cursor}
            url = f"/v1/statements{path}"
            page = await gateway.http.get(url, params=params, headers=gateway.operator)
            seen += len(page.json()["items"])
            cursor = {"cursor": page.json()["next_cursor"]}
        assert (seen, cursor) == (expected, {"cursor": None})


@pytest.mark.parametrize(
    "query", ["?month=2026-13", "?month=2026-3", "?month=march", "?month=2026-03&role=operator"]
)
async def test_a_bad_month_or_role_is_refused(gateway: Gateway, query: str) -> None:
    answer = await gateway.http.get(f"/v1/statements{query}", headers=gateway.operator)

    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] in ("month", "role")


async def test_without_a_month_the_present_one_is_shown(gateway: Gateway) -> None:
    await delivered(gateway)
    answer = await gateway.http.get("/v1/statements", headers=gateway.customer)

    assert [each["month"] for each in answer.json()["items"]] == [MONTH]


async def test_a_month_is_closed_three_days_after_its_end_and_once(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    await delivered(gateway)
    await close(gateway, at=datetime(2026, 4, 3, 23, 59, tzinfo=UTC))
    assert {each["closed_at"] for each in await asked(gateway)} == {None}

    await close(gateway)
    closed = await asked(gateway)
    gateway.clock.advance(timedelta(hours=1))
    await closing_of(gateway).step()

    assert {each["closed_at"] for each in closed} == {"2026-04-04T00:00:00Z"}
    assert await asked(gateway) == closed


async def test_a_month_that_another_replica_has_closed_is_not_closed_again(
    gateway_on_both: Gateway,
) -> None:
    """Two replicas that both lead for a moment have found the same month."""
    gateway = gateway_on_both
    await delivered(gateway)
    gateway.clock.advance(datetime(2026, 4, 4, tzinfo=UTC) - gateway.clock.now())

    closed = []
    for _ in range(2):
        async with gateway.parts.db.write() as tx:
            closed.append(await close_month(tx, MONTH, at=gateway.clock.now()))

    assert closed == [True, False]


async def test_webhooks_are_notified_once_of_a_closed_month(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    hook = {"url": "http://127.0.0.1:9/", "event_types": ["statement.closed"]}
    made = await gateway.http.post("/v1/webhooks", json=hook, headers=gateway.customer)
    assert made.json()["event_types"] == ["statement.closed"]
    await delivered(gateway)

    await close(gateway)
    await closing_of(gateway).step()

    gateway.is_damaged = True  # the event is not one of a delivery
    statement = text("SELECT e.type, e.body FROM notifications n JOIN events e USING (event_id)")
    async with gateway.parts.db.read() as connection:
        [(kind, body)] = (await connection.execute(statement)).all()
    assert kind == "statement.closed"
    assert json.loads(body)["data"]["totals"] == [{"currency": "USD", "amount": 1234, "lines": 2}]
    assert await gateway.broken() == []


async def test_a_correction_of_a_closed_month_counts_in_the_present_month(
    gateway: Gateway,
) -> None:
    delivery_id = await delivered(gateway)
    mission_id = (await gateway.get(delivery_id))["missions"][0]["mission_id"]
    await close(gateway)
    closed = await asked(gateway)

    answer = await posted(gateway, mission_id=mission_id, amount=-234, note="wrong station")

    assert answer.status_code == 201, answer.text
    assert (answer.json()["number"], answer.json()["month"]) == (3, APRIL)
    assert await asked(gateway) == closed
    customer, provider = await asked(gateway, month=APRIL)
    assert customer["amount"] == provider["amount"] == -234
    assert customer["items"]["correction"] == -234


async def test_corrections_at_the_same_moment_are_all_added(gateway_on_both: Gateway) -> None:
    delivery_id = await delivered(gateway_on_both)
    mission_id = (await gateway_on_both.get(delivery_id))["missions"][0]["mission_id"]

    answers = await asyncio.gather(
        *(posted(gateway_on_both, mission_id=mission_id, amount=-1, note="?") for _ in range(5))
    )

    numbers = sorted(answer.json()["number"] for answer in answers)
    assert numbers == list(range(numbers[0], numbers[0] + 5))


@pytest.mark.parametrize(
    ("amount", "detail"), [(0, "not 0"), (-1235, "between -1234"), (10**12, "and 999999998766")]
)
async def test_a_correction_beyond_what_was_paid_is_refused(
    gateway: Gateway, amount: int, detail: str
) -> None:
    delivery_id = await delivered(gateway)
    mission_id = (await gateway.get(delivery_id))["missions"][0]["mission_id"]

    answer = await posted(gateway, mission_id=mission_id, amount=amount, note="?")

    assert answer.status_code == 422
    assert detail in answer.json()["errors"][0]["detail"]


async def test_only_operators_correct_and_only_settled_missions(gateway: Gateway) -> None:
    delivery_id = await booked(gateway)
    mission_id = (await gateway.get(delivery_id))["missions"][0]["mission_id"]
    body = {"mission_id": mission_id, "amount": 1, "note": "?"}

    assert (await posted(gateway, **body)).status_code == 404
    for who in (gateway.customer, gateway.provider):
        answer = await gateway.http.post("/v1/statements/lines", json=body, headers=who)
        assert answer.status_code == 403


async def test_lines_outlive_their_delivery(gateway: Gateway) -> None:
    delivery_id = await delivered(gateway)
    tables = ("notifications", "events", "custody", "packages", "missions", "tracking_links")
    for table in (*tables, "deliveries"):
        await gateway.execute(f"DELETE FROM {table} WHERE delivery_id = :id", id=delivery_id)

    assert [each["amount"] for each in await asked(gateway)] == [1234, 1234]


async def test_statements_are_csv_and_a_page_for_those_who_ask(gateway: Gateway) -> None:
    await delivered(gateway)
    ask, params = "/v1/statements", {"month": MONTH}

    as_csv = await gateway.http.get(
        ask, params=params, headers={**gateway.customer, "Accept": "text/csv"}
    )
    browser = "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8"
    page = await gateway.http.get(
        ask, params=params, headers={**gateway.customer, "Accept": browser}
    )

    [row] = csv.DictReader(as_csv.text.splitlines())
    assert (row["party_id"], row["amount"], row["items.base"]) == ("alice", "1234", "500")
    assert page.headers["content-type"] == "text/html; charset=utf-8"
    assert page.headers["content-security-policy"].startswith("default-src 'none'")
    assert "<script" not in page.text
    assert "<caption>Customer alice, USD</caption>" in page.text
    assert "<th scope=row>Total</th><td>1,234</td>" in page.text
