"""Every event and webhook of a delivery is in the trace of its request."""

from collections.abc import AsyncIterator
from datetime import timedelta
from typing import Any

import pytest

from skyway.contracts.mission_reports import TracedReport
from skyway.ids import DeliveryId
from skyway.runtime.tracing import new_traceparent, trace_id_of, tracing
from tests.gateway.notifications.receiver import Receiver, receiving
from tests.gateway.notifications.test_send_webhooks import _notify, _webhook
from tests.gateway.whole_gateway import Gateway, make_request

TRACE_ID = "4bf92f3577b34da6a3ce929d0e0e4736"
RECEIVED = f"00-{TRACE_ID}-00f067aa0ba902b7-01"


@pytest.fixture
async def receiver() -> AsyncIterator[Receiver]:
    async with receiving() as opened:
        yield opened


async def requested(gateway: Gateway) -> DeliveryId:
    answer = await gateway.post(make_request(), traceparent=RECEIVED)
    assert answer.status_code == 202, answer.text
    return DeliveryId(answer.json()["delivery_id"])


async def traces(gateway: Gateway) -> set[str | None]:
    """The trace ids of all messages that wait to be sent."""
    from skyway_gateway.tables import outbox
    from sqlalchemy import select

    async with gateway.parts.db.read() as connection:
        found = (await connection.execute(select(outbox.c.traceparent))).scalars()
        return {trace_id_of(traceparent) for traceparent in found}


async def test_every_event_is_in_the_trace_of_the_request(
    gateway_on_both: Gateway, receiver: Receiver
) -> None:
    gateway = gateway_on_both
    webhook = await _webhook(gateway, receiver.url)
    delivery_id = await requested(gateway)
    while await gateway.book_next():
        pass
    reports: tuple[tuple[str, dict[str, Any]], ...] = (
        ("ACCEPTED", {}),
        ("LOADED", {"package_ids": ["p1"]}),
        ("DELIVERED", {"package_ids": ["p1"]}),
    )
    for seq, (kind, fields) in enumerate(reports, start=1):
        report = gateway.mission_report(delivery_id, kind, seq=seq, **fields)
        traced = TracedReport(traceparent=new_traceparent(), report=report)
        await gateway.parts.applier.apply_all([traced])
    await _notify(gateway)

    events = await gateway.events(delivery_id)
    assert len(events) >= 6
    assert {trace_id_of(event["traceparent"]) for event in events} == {TRACE_ID}
    assert len({event["traceparent"] for event in events}) >= 5
    assert await traces(gateway) == {TRACE_ID}
    headers = [headers["traceparent"] for headers, _ in receiver.received]
    assert len(headers) == len(events)
    assert {trace_id_of(each) for each in headers} == {TRACE_ID}
    # Each try has a span of its own.
    assert len(set(headers)) == len(headers)
    assert webhook["state"] == "ACTIVE"


async def test_what_a_loop_finds_late_is_in_the_trace_of_the_request(gateway: Gateway) -> None:
    delivery_id = await requested(gateway)
    while await gateway.book_next():
        pass
    gateway.clock.advance(timedelta(days=1))
    with tracing(None):
        await gateway.parts.overdue_notifier.step()

    events = await gateway.events(delivery_id)
    assert [event["type"] for event in events][-1] == "delivery.delayed"
    assert {trace_id_of(event["traceparent"]) for event in events} == {TRACE_ID}
