"""Replays: a customer's past events become due again at one webhook, in sequence."""

from collections.abc import Callable
from datetime import timedelta
from typing import Any

import httpx
import pytest
from skyway_gateway.notifications import replay_store
from skyway_gateway.notifications.webhook_store import claim_due
from sqlalchemy import text

from skyway.ids import WebhookId
from tests.gateway.whole_gateway import Gateway


async def make_webhook(gateway: Gateway, **fields: object) -> str:
    requested = {"url": "http://127.0.0.1:9/in", **fields}
    answer = await gateway.http.post("/v1/webhooks", json=requested, headers=gateway.customer)
    return str(answer.json()["webhook_id"])


async def replay(gateway: Gateway, webhook_id: str, **requested: object) -> httpx.Response:
    answer: httpx.Response = await gateway.http.post(
        f"/v1/webhooks/{webhook_id}/replay", json=requested, headers=gateway.customer
    )
    return answer


async def all_are(gateway: Gateway, state: str) -> None:
    """Set each notification to this state, as the sender does."""
    await gateway.execute("UPDATE notifications SET state = :state, attempts = 10", state=state)
    await gateway.execute(
        "INSERT INTO webhook_attempts (attempt_id, webhook_id, event_id, event_type, number,"
        " at_wall_ms, duration_ms, outcome)"
        " SELECT 'att_' || event_id, webhook_id, event_id, type, 10, 0, 0, 'DELIVERED'"
        " FROM notifications JOIN events USING (event_id)"
    )


async def due(gateway: Gateway, webhook_id: str) -> list[tuple[str, int]]:
    """What is sent next: the event of each delivery, and its number of attempts."""
    found = await claim_due(
        gateway.parts.db, WebhookId(webhook_id), limit=9, claimant="test", clock=gateway.clock
    )
    await gateway.execute("UPDATE notifications SET claimed_by = NULL, claimed_until_ms = 0")
    return [(one.event_id, one.attempts) for one in found]


async def states(gateway: Gateway) -> list[tuple[str, str]]:
    statement = text("SELECT event_id, state FROM notifications ORDER BY sequence")
    async with gateway.parts.db.read() as connection:
        return [(row.event_id, row.state) for row in await connection.execute(statement)]


@pytest.mark.parametrize("was", ["DELIVERED", "GIVEN_UP"])
async def test_replayed_events_of_a_delivery_are_due_in_sequence(
    gateway_on_both: Gateway, was: str
) -> None:
    gateway = gateway_on_both
    webhook_id = await make_webhook(gateway)
    delivery_id = await gateway.planned()
    await all_are(gateway, was)

    answer = await replay(gateway, webhook_id, delivery_id=delivery_id)

    assert (answer.status_code, answer.json()) == (202, {"queued": 2})
    first, second = [event["event_id"] for event in await gateway.events(delivery_id)]
    assert await due(gateway, webhook_id) == [(first, 0)]
    assert await states(gateway) == [(first, "PENDING"), (second, "PENDING")]


async def test_an_event_may_be_replayed_after_later_ones(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    webhook_id = await make_webhook(gateway)
    delivery_id = await gateway.planned()
    await all_are(gateway, "DELIVERED")
    first, second = [event["event_id"] for event in await gateway.events(delivery_id)]

    assert (await replay(gateway, webhook_id, event_ids=[first])).json() == {"queued": 1}

    assert await states(gateway) == [(first, "PENDING"), (second, "DELIVERED")]
    assert await gateway.verified() == []


async def test_a_new_webhook_can_get_earlier_events(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.planned()
    webhook_id = await make_webhook(gateway, event_types=["delivery.planned"])

    assert (await replay(gateway, webhook_id, delivery_id=delivery_id)).json() == {"queued": 1}
    first, second = [event["event_id"] for event in await gateway.events(delivery_id)]
    assert await due(gateway, webhook_id) == [(second, 0)]
    # Events that are named by id are sent although the webhook does not subscribe to them.
    assert (await replay(gateway, webhook_id, event_ids=[first])).json() == {"queued": 1}
    assert await due(gateway, webhook_id) == [(first, 0)]


async def test_pending_events_are_not_queued_again(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    webhook_id = await make_webhook(gateway)
    delivery_id = await gateway.accepted()
    gateway.is_damaged = True  # nothing was tried
    await gateway.execute("UPDATE notifications SET attempts = 3")

    assert (await replay(gateway, webhook_id, delivery_id=delivery_id)).json() == {"queued": 0}
    assert [attempts for _, attempts in await due(gateway, webhook_id)] == [3]


async def test_a_span_replays_the_events_that_were_recorded_in_it(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    webhook_id = await make_webhook(gateway)
    moments, deliveries = [], []
    for _ in range(3):
        moments.append(gateway.clock.wall_now().isoformat())
        deliveries.append(await gateway.accepted())
        gateway.clock.advance(timedelta(minutes=1))
    await all_are(gateway, "DELIVERED")

    span = {"from_wall_at": moments[1], "to_wall_at": moments[2]}
    assert (await replay(gateway, webhook_id, **span)).json() == {"queued": 1}
    [(event_id, _)] = await due(gateway, webhook_id)
    assert [event["event_id"] for event in await gateway.events(deliveries[1])] == [event_id]
    assert (await replay(gateway, webhook_id, from_wall_at=moments[1])).json() == {"queued": 1}


async def test_a_span_of_too_many_events_is_refused(
    gateway: Gateway, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(replay_store, "_MOST_EVENTS", 2)
    webhook_id = await make_webhook(gateway)
    since = gateway.clock.wall_now().isoformat()
    for _ in range(3):
        await gateway.accepted()
    answer = await replay(gateway, webhook_id, from_wall_at=since)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == "from_wall_at"


async def test_events_of_other_customers_are_not_replayed(
    gateway_on_both: Gateway, request_body: Callable[..., Any]
) -> None:
    gateway = gateway_on_both
    webhook_id = await make_webhook(gateway)
    since = gateway.clock.wall_now().isoformat()
    theirs = await gateway.http.post("/v1/deliveries", json=request_body(), headers=gateway.other)
    delivery_id = theirs.json()["delivery_id"]
    [event] = await gateway.events(delivery_id)

    assert (await replay(gateway, webhook_id, delivery_id=delivery_id)).status_code == 404
    assert (await replay(gateway, webhook_id, event_ids=[event["event_id"]])).status_code == 404
    assert (await replay(gateway, webhook_id, from_wall_at=since)).json() == {"queued": 0}
    by_other = await gateway.http.post(
        f"/v1/webhooks/{webhook_id}/replay",
        json={"delivery_id": delivery_id},
        headers=gateway.other,
    )
    assert by_other.status_code == 404


async def test_a_disabled_webhook_cannot_replay(gateway: Gateway) -> None:
    webhook_id = await make_webhook(gateway)
    delivery_id = await gateway.accepted()
    await gateway.http.patch(
        f"/v1/webhooks/{webhook_id}", json={"state": "DISABLED"}, headers=gateway.customer
    )
    answer = await replay(gateway, webhook_id, delivery_id=delivery_id)
    assert (answer.status_code, answer.json()["code"]) == (409, "WEBHOOK_DISABLED")


@pytest.mark.parametrize(
    "requested",
    [
        {},
        {"delivery_id": "dlv_1", "event_ids": ["evt_1"]},
        {"event_ids": []},
        {"to_wall_at": "2026-03-01T12:00:00Z"},
        {"from_wall_at": "2026-03-01T12:00:00Z", "to_wall_at": "2026-03-01T12:00:00Z"},
    ],
)
async def test_a_replay_must_name_its_events(gateway: Gateway, requested: dict[str, Any]) -> None:
    assert (await replay(gateway, await make_webhook(gateway), **requested)).status_code == 422
