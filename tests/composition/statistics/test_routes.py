"""GET /v1/stats/missions: missions under way, and messages that wait to be sent."""

from typing import Any

import pytest
from sqlalchemy import text

from skyway.units import moment_to_ms


async def insert(composition: Any, table: str, **values: object) -> None:
    names = ", ".join(values)
    places = ", ".join(f":{name}" for name in values)
    async with composition.db.write() as tx:
        statement = text(f"INSERT INTO {table} ({names}) VALUES ({places})")
        await tx.execute(statement, values)


@pytest.fixture
async def busy(composition: Any) -> Any:
    """Missions of two providers; one mission is over."""
    now_ms = moment_to_ms(composition.clock.now())
    states = [("ACTIVE", "prv_1"), ("ACTIVE", "prv_2"), ("BOOKED", "prv_1"), ("ABORTED", "prv_1")]
    for number, (state, provider_id) in enumerate(states):
        await insert(composition, "deliveries", delivery_id=f"dlv_{number}")
        await insert(
            composition,
            "missions",
            mission_id=f"msn_{number}",
            delivery_id=f"dlv_{number}",
            attempt=1,
            trip=1,
            provider_id=provider_id,
            drone_id=f"drn_{number}",
            state=state,
            network_id="row",
            start_ms=now_ms,
            served_ms=now_ms,
            released_ms=now_ms,
            expires_ms=now_ms,
            body="{}",
            request="{}",
            candidate="{}",
            report_seq=0,
        )
    return composition


async def asked(composition: Any, caller: str) -> Any:
    answer = await composition(caller, "GET", "/v1/stats/missions")
    assert answer.status_code == 200, answer.text
    return answer.json()


async def test_missions_that_are_not_over_are_counted_by_state(busy: Any) -> None:
    assert (await asked(busy, "operator:op"))["by_state"] == {"ACTIVE": 2, "BOOKED": 1}


async def test_a_provider_sees_only_its_own_missions(busy: Any) -> None:
    found = await asked(busy, "provider:prv_2")

    assert (found["by_state"], found["unsent"]) == ({"ACTIVE": 1}, {})


async def test_unsent_messages_are_counted_by_channel(busy: Any) -> None:
    before = (await asked(busy, "operator:op"))["unsent"].get("gateway", 0)
    for _ in range(2):
        await insert(
            busy,
            "outbox",
            channel="gateway",
            stream="s",
            address="/",
            payload=b"{}",
            confirmed_by="answer",
            mqtt_qos=0,
            is_retained=False,
        )

    assert (await asked(busy, "operator:op"))["unsent"]["gateway"] == before + 2


async def test_better_orders_of_the_last_days_are_shown_to_their_provider(busy: Any) -> None:
    day_ms, now_ms = 24 * 3600 * 1000, moment_to_ms(busy.clock.now())
    today_ms = now_ms - now_ms % day_ms
    for provider_id, days_ago, saved_min in (("prv_1", 0, 30), ("prv_1", 2, 15), ("prv_2", 9, 50)):
        await insert(
            busy,
            "better_orders",
            provider_id=provider_id,
            day_ms=today_ms - days_ago * day_ms,
            orders=2,
            moves=3,
            saved_ms=saved_min * 60_000,
        )

    own, other = await asked(busy, "provider:prv_1"), await asked(busy, "provider:prv_2")

    assert (own["better_orders"], own["saved_minutes"]) == ({"prv_1": 4}, {"prv_1": 45})
    assert other["better_orders"] == {}


async def test_customers_may_not_see_mission_statistics(busy: Any) -> None:
    assert (await busy("customer:c1", "GET", "/v1/stats/missions")).status_code == 403


@pytest.mark.parametrize("path", ["drones", "missions", "pads"])
async def test_a_span_does_not_begin_before_the_calendar(composition: Any, path: str) -> None:
    at_its_begin = await composition(
        "operator:op", "GET", f"/v1/stats/{path}?to=1970-01-01T06:00:00Z"
    )
    empty = await composition("operator:op", "GET", f"/v1/stats/{path}?to=1970-01-01T00:00:00Z")

    assert at_its_begin.status_code < 500, at_its_begin.text
    assert empty.status_code in (200, 422), empty.text
