"""Notifying webhooks: at least once, under one id, in sequence, or given up."""

import asyncio
from collections.abc import AsyncIterator
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from skyway_gateway.notifications.webhook_store import due_endpoints
from standardwebhooks import Webhook

from skyway.contracts.message_examples import message_examples
from tests.gateway.notifications.receiver import Receiver, receiving
from tests.gateway.whole_gateway import Gateway


@pytest.fixture
async def receiver() -> AsyncIterator[Receiver]:
    async with receiving() as opened:
        yield opened


async def _webhook(gateway: Gateway, url: str, **fields: object) -> dict[str, Any]:
    answer = await gateway.http.post(
        "/v1/webhooks", json={"url": url, **fields}, headers=gateway.customer
    )
    assert answer.status_code == 201, answer.text
    made: dict[str, Any] = answer.json()
    return made


async def _notify(gateway: Gateway) -> int:
    """Send what is due now; how many."""
    sent = 0
    while True:
        async with gateway.parts.db.read() as connection:
            due = await due_endpoints(connection, at=gateway.clock.wall_now())
        if not due:
            return sent
        for endpoint in due:
            sent += await gateway.parts.sender.notify(endpoint)


async def _attempts(gateway: Gateway, webhook: dict[str, Any]) -> list[dict[str, Any]]:
    path = f"/v1/webhooks/{webhook['webhook_id']}/attempts?limit=200"
    answer = await gateway.http.get(path, headers=gateway.customer)
    found: list[dict[str, Any]] = answer.json()["items"]
    return sorted(found, key=lambda one: (one["wall_at"], one["number"]))


async def test_each_event_arrives_signed_in_sequence_under_its_id(
    gateway_on_both: Gateway, receiver: Receiver
) -> None:
    gateway = gateway_on_both
    # Receivers check the age of a signature against their own clock.
    gateway.clock.advance(datetime.now(UTC) - gateway.clock.wall_now())
    webhook = await _webhook(gateway, receiver.url)
    delivery_id = await gateway.planned()
    assert await _notify(gateway) == 2
    assert receiver.types == ["delivery.requested", "delivery.planned"]
    reported = await gateway.events(delivery_id)
    for (headers, body), raw, event in zip(
        receiver.received, receiver.bodies, reported, strict=True
    ):
        assert headers["webhook-id"] == event["event_id"]
        assert body == event
        Webhook(webhook["secret"]).verify(raw, headers)
    assert [(one["outcome"], one["status"]) for one in await _attempts(gateway, webhook)] == [
        ("DELIVERED", 200)
    ] * 2


async def test_a_failed_notification_is_repeated_under_the_same_id(
    gateway_on_both: Gateway, receiver: Receiver
) -> None:
    gateway = gateway_on_both
    webhook = await _webhook(gateway, receiver.url)
    receiver.answers = [500, "drop"]
    await gateway.accepted()
    assert await _notify(gateway) == 1
    gateway.clock.advance(timedelta(seconds=3))
    assert await _notify(gateway) == 0, "tried again too early"
    gateway.clock.advance(timedelta(seconds=4))
    assert await _notify(gateway) == 1
    gateway.clock.advance(timedelta(seconds=37))
    assert await _notify(gateway) == 1
    assert len({headers["webhook-id"] for headers, _ in receiver.received}) == 1
    attempts = await _attempts(gateway, webhook)
    assert [(one["number"], one["outcome"], one["status"]) for one in attempts] == [
        (1, "FAILED", 500),
        (2, "FAILED", None),
        (3, "DELIVERED", 200),
    ]
    assert attempts[0]["next_try_wall_at"] is not None
    assert attempts[2]["next_try_wall_at"] is None


async def test_a_webhook_shows_how_its_newest_attempt_went(
    gateway_on_both: Gateway, receiver: Receiver
) -> None:
    gateway = gateway_on_both
    webhook = await _webhook(gateway, receiver.url)
    path = f"/v1/webhooks/{webhook['webhook_id']}"

    async def last_outcomes() -> set[str | None]:
        one = await gateway.http.get(path, headers=gateway.customer)
        listed = await gateway.http.get("/v1/webhooks", headers=gateway.customer)
        return {each["last_outcome"] for each in (one.json(), *listed.json()["items"])}

    assert await last_outcomes() == {None}
    receiver.answers = [404]
    await gateway.accepted()
    await _notify(gateway)
    assert await last_outcomes() == {"FAILED"}
    gateway.clock.advance(timedelta(seconds=7))
    await _notify(gateway)
    assert await last_outcomes() == {"DELIVERED"}


async def test_later_events_of_a_delivery_wait_for_the_earlier_ones(
    gateway: Gateway, receiver: Receiver
) -> None:
    await _webhook(gateway, receiver.url)
    receiver.answers = [503]
    await gateway.planned()
    assert await _notify(gateway) == 1
    assert receiver.types == ["delivery.requested"]
    # Another delivery does not wait for this one.
    await gateway.planned()
    assert await _notify(gateway) == 2
    gateway.clock.advance(timedelta(seconds=7))
    await _notify(gateway)
    assert receiver.types[3:] == ["delivery.requested", "delivery.planned"]


@pytest.mark.parametrize("status", [429, 503])
async def test_a_receiver_is_not_asked_again_before_its_retry_after(
    gateway: Gateway, receiver: Receiver, status: int
) -> None:
    await _webhook(gateway, receiver.url)
    receiver.answers, receiver.retry_after = [status], "18"
    await gateway.planned()
    await _notify(gateway)
    gateway.clock.advance(timedelta(seconds=17))
    assert await _notify(gateway) == 0
    gateway.clock.advance(timedelta(seconds=1))
    assert await _notify(gateway) == 2


async def test_a_notification_is_given_up_after_its_last_attempt(
    gateway: Gateway, receiver: Receiver
) -> None:
    webhook = await _webhook(gateway, receiver.url)
    receiver.answers = [500] * 10
    await gateway.planned()
    for _ in range(10):
        await _notify(gateway)
        gateway.clock.advance(timedelta(hours=30))
    attempts = [
        one
        for one in await _attempts(gateway, webhook)
        if one["event_type"] == "delivery.requested"
    ]
    assert [one["outcome"] for one in attempts] == ["FAILED"] * 9 + ["GIVEN_UP"]
    assert attempts[-1]["next_try_wall_at"] is None
    # The next event is sent independently.
    await _notify(gateway)
    assert receiver.types[-1] == "delivery.planned"


async def test_a_receiver_that_answers_410_is_disabled(
    gateway: Gateway, receiver: Receiver
) -> None:
    webhook = await _webhook(gateway, receiver.url)
    receiver.answers = [410]
    await gateway.planned()
    await _notify(gateway)
    gateway.clock.advance(timedelta(days=3))
    assert await _notify(gateway) == 0
    path = f"/v1/webhooks/{webhook['webhook_id']}"
    shown = (await gateway.http.get(path, headers=gateway.customer)).json()
    assert (shown["state"], shown["disabled_reason"]) == ("DISABLED", "it answered 410")
    [attempt] = await _attempts(gateway, webhook)
    assert attempt["outcome"] == "GIVEN_UP"
    again = await gateway.http.patch(path, json={"state": "ACTIVE"}, headers=gateway.customer)
    assert again.json()["disabled_reason"] is None
    await gateway.accepted()
    assert await _notify(gateway) == 1


async def test_an_attempt_at_a_webhook_that_was_disabled_meanwhile_is_not_repeated(
    gateway: Gateway, receiver: Receiver
) -> None:
    webhook = await _webhook(gateway, receiver.url)
    path = f"/v1/webhooks/{webhook['webhook_id']}"
    receiver.answers = ["hang"]
    await gateway.accepted()
    sending = asyncio.ensure_future(_notify(gateway))
    await receiver.has_received.wait()
    await gateway.http.patch(path, json={"state": "DISABLED"}, headers=gateway.customer)
    receiver.hangs.set()  # the attempt fails now
    assert await sending == 1

    await gateway.http.patch(path, json={"state": "ACTIVE"}, headers=gateway.customer)
    gateway.clock.advance(timedelta(seconds=30))

    assert await _notify(gateway) == 0


async def test_an_event_that_came_while_its_webhook_was_disabled_waits(
    gateway: Gateway, receiver: Receiver
) -> None:
    """Both may be written at the same time, so the event is not given up with the others."""
    await _webhook(gateway, receiver.url)
    await gateway.accepted()
    found = []
    for state in ("DISABLED", "ACTIVE"):
        await gateway.execute(f"UPDATE webhooks SET state = '{state}'")
        async with gateway.parts.db.read() as connection:
            due = await due_endpoints(connection, at=gateway.clock.wall_now())
        found.append(len(due))

    assert found == [0, 1]


async def test_a_redirect_is_not_followed(gateway: Gateway, receiver: Receiver) -> None:
    webhook = await _webhook(gateway, receiver.url)
    receiver.answers = [302]
    await gateway.accepted()
    await _notify(gateway)
    assert len(receiver.received) == 1
    [attempt] = await _attempts(gateway, webhook)
    assert (attempt["outcome"], attempt["status"]) == ("FAILED", 300)


@pytest.mark.parametrize("status", [401, 404, 418])
async def test_an_attempt_shows_only_the_class_of_the_answer(
    gateway: Gateway, receiver: Receiver, status: int
) -> None:
    """A customer must not learn by webhooks what a server in our networks has."""
    webhook = await _webhook(gateway, receiver.url)
    receiver.answers = [status]
    await gateway.accepted()
    await _notify(gateway)

    [attempt] = await _attempts(gateway, webhook)

    assert (attempt["status"], attempt["detail"]) == (400, "answered 4xx")


async def test_a_name_that_later_has_a_private_address_is_not_called(
    gateway: Gateway, receiver: Receiver
) -> None:
    webhook = await _webhook(gateway, receiver.url)
    await gateway.execute("UPDATE webhooks SET url = 'http://10.0.0.1/in'")
    await gateway.accepted()
    await _notify(gateway)
    [attempt] = await _attempts(gateway, webhook)
    assert attempt["outcome"] == "FAILED"
    assert "not a public address" in attempt["detail"]


async def test_a_webhook_gets_only_the_types_it_subscribes_to(
    gateway: Gateway, receiver: Receiver
) -> None:
    await _webhook(gateway, receiver.url, event_types=["delivery.planned"])
    await gateway.planned()
    await _notify(gateway)
    assert receiver.types == ["delivery.planned"]


async def test_a_webhook_gets_no_events_of_other_customers(
    gateway: Gateway, receiver: Receiver
) -> None:
    answer = await gateway.http.post(
        "/v1/webhooks", json={"url": receiver.url}, headers=gateway.other
    )
    assert answer.status_code == 201
    await gateway.planned()
    assert await _notify(gateway) == 0


async def test_two_replicas_send_a_notification_once(
    gateway_on_both: Gateway, receiver: Receiver
) -> None:
    gateway = gateway_on_both
    await _webhook(gateway, receiver.url)
    await gateway.accepted()
    await asyncio.gather(*(_notify(gateway) for _ in range(3)))
    assert len(receiver.received) == 1


async def test_claims_of_a_dead_sender_are_sent_again(gateway: Gateway, receiver: Receiver) -> None:
    await _webhook(gateway, receiver.url)
    await gateway.accepted()
    receiver.answers = ["hang"]
    dying = asyncio.ensure_future(_notify(gateway))
    await receiver.has_received.wait()
    dying.cancel()
    await asyncio.gather(dying, return_exceptions=True)
    # A receiver may take 10 s, and the sender needs a moment to write the outcome.
    gateway.clock.advance(timedelta(seconds=15))
    assert await _notify(gateway) == 0
    gateway.clock.advance(timedelta(seconds=6))
    assert await _notify(gateway) == 1
    first, second = receiver.received
    assert first[0]["webhook-id"] == second[0]["webhook-id"]


async def test_a_slow_endpoint_delays_no_other(gateway: Gateway, receiver: Receiver) -> None:
    """With the running loop, a healthy receiver is notified while another one hangs."""
    async with receiving() as hanging:
        hanging.answers = ["hang"] * 10
        await _webhook(gateway, hanging.url)
        await _webhook(gateway, receiver.url)
        running = asyncio.ensure_future(gateway.parts.sender.run())
        try:
            async with asyncio.timeout(60):
                await gateway.planned()
                await hanging.has_received.wait()
                while len(receiver.received) < 2:
                    receiver.has_received.clear()
                    await receiver.has_received.wait()
            assert receiver.types == ["delivery.requested", "delivery.planned"]
            assert hanging.types == ["delivery.requested"]
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)


async def test_a_customer_can_test_a_webhook(gateway: Gateway, receiver: Receiver) -> None:
    webhook = await _webhook(gateway, receiver.url)
    path = f"/v1/webhooks/{webhook['webhook_id']}/test"
    answer = await gateway.http.post(path, headers=gateway.customer)
    assert (answer.status_code, answer.json()["outcome"]) == (200, "DELIVERED")
    assert receiver.types == ["webhook.test"]
    ((_, event),) = receiver.received
    assert set(message_examples()["DeliveryPlannedEvent"].model_dump(mode="json")) <= set(event)
    assert (event["delivery_id"], event["sequence"]) == ("webhook-test", 1)
    assert event["data"] == {"webhook_id": webhook["webhook_id"]}
    receiver.answers = [500]
    answer = await gateway.http.post(path, headers=gateway.customer)
    assert (answer.json()["outcome"], answer.json()["status"]) == ("GIVEN_UP", 500)
    assert len(await _attempts(gateway, webhook)) == 2
    assert (await gateway.http.post(path, headers=gateway.other)).status_code == 404


async def test_a_replay_arrives_under_the_same_ids_in_sequence(
    gateway_on_both: Gateway, receiver: Receiver
) -> None:
    gateway = gateway_on_both
    webhook = await _webhook(gateway, receiver.url)
    delivery_id = await gateway.planned()
    assert await _notify(gateway) == 2
    path = f"/v1/webhooks/{webhook['webhook_id']}/replay"
    await gateway.http.post(path, json={"delivery_id": delivery_id}, headers=gateway.customer)
    assert await _notify(gateway) == 2
    assert receiver.bodies[2:] == receiver.bodies[:2]
    ids = [headers["webhook-id"] for headers, _ in receiver.received]
    assert ids[2:] == ids[:2]
    assert await _notify(gateway) == 0
