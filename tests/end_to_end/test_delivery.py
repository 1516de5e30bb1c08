"""One real delivery from request to hand-over, through every process."""

import json
from typing import Any

import httpx
import pytest

from skyway.runtime.tracing import trace_id_of
from tests.end_to_end.webhook_receiver import webhook_receiver

pytestmark = [pytest.mark.end_to_end, pytest.mark.storage_pair("postgresql-mosquitto")]


#: The trace that the customer has begun.
TRACE_ID = "4bf92f3577b34da6a3ce929d0e0e4736"
TRACEPARENT = f"00-{TRACE_ID}-00f067aa0ba902b7-01"


def test_a_delivery_is_flown_and_its_customer_is_notified_by_sse_and_webhook(system: Any) -> None:
    system.publish_corridor("notified")
    provider = system.start_fleet(["notified-s1", "notified-s2"])
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    with webhook_receiver() as receiver:
        body = {"url": receiver.url}
        webhook = system.call("POST", "/v1/webhooks", key=key, body=body).json()
        delivery_id = system.request_delivery(
            ["notified-s3", "notified-s4"], pickup="notified-s1", traceparent=TRACEPARENT
        )
        streamed = _events_of(system, delivery_id, key)
        delivery = system.until_state(delivery_id, "COMPLETED")
        # Webhooks are sent one after another, so the last ones arrive after the stream has ended.
        _until_notified(system, webhook["webhook_id"], key, streamed)
        system.call("DELETE", f"/v1/webhooks/{webhook['webhook_id']}", key=key)

    assert [event["sequence"] for event in streamed] == list(range(1, len(streamed) + 1))
    types = [event["type"] for event in streamed]
    assert types[:3] == ["delivery.requested", "delivery.planned", "delivery.dispatched"]
    assert types[-1] == "delivery.completed"
    assert types.count("package.delivered") == 2
    assert {package["state"] for package in delivery["packages"]} == {"DELIVERED"}
    assert delivery["missions"][0]["provider_id"] == provider["provider_id"]
    posted = receiver.of(delivery_id)
    assert {event["event_id"] for _, event in posted} == {event["event_id"] for event in streamed}
    # One trace from the customer's POST over REST and MQTT to the last webhook.
    traceparents = [headers["traceparent"] for headers, _ in posted]
    assert {trace_id_of(each) for each in traceparents} == {TRACE_ID}
    assert {trace_id_of(event["traceparent"]) for event in streamed} == {TRACE_ID}
    assert len(set(traceparents)) == len(traceparents)


def _events_of(system: Any, delivery_id: str, key: str) -> list[dict[str, Any]]:
    """All events of a delivery, read by SSE until the stream ends."""
    url = f"{system.keys['SKYWAY_GATEWAY_URL']}/v1/deliveries/{delivery_id}/events"
    headers = {"Authorization": f"Bearer {key}"}
    with httpx.stream("GET", url, headers=headers, timeout=90) as stream:
        return [
            json.loads(line.removeprefix("data: "))
            for line in stream.iter_lines()
            if line.startswith("data: ")
        ]


def _until_notified(system: Any, webhook_id: str, key: str, events: list[dict[str, Any]]) -> None:
    """Return when the webhook's attempts show that each of these events was delivered."""
    path = f"/v1/webhooks/{webhook_id}/attempts?limit=200"

    def missing() -> set[str]:
        attempts = system.call("GET", path, key=key).json()["items"]
        delivered = {each["event_id"] for each in attempts if each["outcome"] == "DELIVERED"}
        return {event["event_id"] for event in events} - delivered

    system.eventually(lambda: not missing(), "all events by webhook", instead=missing)
