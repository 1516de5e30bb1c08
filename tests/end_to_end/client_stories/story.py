"""A shop's day with `skyway_client`: quote, accept, change, PIN, webhook, list, statement.

The arguments are read in `main`. The system has a network and drones that can fly it.
"""

import asyncio
import sys
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from typing import ClassVar

import httpx
import pytest
from skyway_client import AsyncSkyway, NotVerified, Skyway, problems, read_notification
from skyway_client.api.deliveries import (
    change_delivery,
    create_delivery,
    get_delivery,
    get_tracking_link,
    list_deliveries,
)
from skyway_client.api.quotes import create_quote
from skyway_client.api.statements import list_statements
from skyway_client.api.webhooks import create_webhook, delete_webhook
from skyway_client.delivery_events import DeliveryEvent
from skyway_client.models import (
    CustomerPackage,
    CustomerPlace,
    DeliveryChange,
    DeliveryCompletedEvent,
    DeliveryProofAwaitedEvent,
    DropoffVerification,
    DropoffVerificationMethod,
    NewWebhook,
    OfferChoice,
    QuoteRequest,
    RequestedDelivery,
)

LONGEST_WAIT_S = 120.0


class Shop(BaseHTTPRequestHandler):
    """The shop's server: it reads the notifications that it can verify."""

    secret: ClassVar[str]
    received: ClassVar[list[str]] = []
    has_last: ClassVar[threading.Event] = threading.Event()

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["content-length"]))
        event = read_notification(self.secret, dict(self.headers), body)
        assert event is not None
        self.received.append(event.type_)
        if isinstance(event, DeliveryCompletedEvent):
            self.has_last.set()
        self.send_response(204)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Say nothing."""


def order(skyway: Skyway, start: str, end: str) -> RequestedDelivery:
    """Ask for offers, and accept the best one."""
    destination = CustomerPlace(station_id=end)
    proof = DropoffVerification(method=DropoffVerificationMethod.PIN, wait_s=900)
    package = CustomerPackage(
        package_id="p1", mass_kg=0.8, destination=destination, dropoff_verification=proof
    )
    request = QuoteRequest(pickup=CustomerPlace(station_id=start), packages=[package])
    quote = skyway.send(create_quote(body=request))
    choice = OfferChoice(quote_id=quote.quote_id, offer_id=quote.offers[0].offer_id)
    delivery = skyway.send(create_delivery(body=choice))
    with pytest.raises(problems.QuoteTaken):
        skyway.send(create_delivery(body=choice))
    change = DeliveryChange(instructions="leave it at the door")
    changed = skyway.send(change_delivery(delivery.delivery_id, body=change))
    assert changed.instructions == change.instructions
    return delivery


def follow(skyway: Skyway, delivery_id: str) -> list[DeliveryEvent]:
    """All events of a delivery. When the drone waits for the PIN, the recipient types it."""
    events: list[DeliveryEvent] = []
    for event in skyway.events(delivery_id):
        events.append(event)
        if isinstance(event, DeliveryProofAwaitedEvent):
            type_pin(skyway, delivery_id)
    return events


def type_pin(skyway: Skyway, delivery_id: str) -> None:
    """Type the PIN as the tracking page does: it needs no key."""
    [package] = skyway.send(get_delivery(delivery_id)).packages
    assert package.dropoff_proof
    page = skyway.send(get_tracking_link(delivery_id)).tracking_url
    typed = {"package_id": package.package_id, "pin": package.dropoff_proof.pin}
    httpx.post(f"{page}/proof", json=typed).raise_for_status()


def spent(skyway: Skyway, event: DeliveryEvent) -> int:
    """What the customer has to pay in the month of an event, in minor units."""
    month = f"{event.occurred_at:%Y-%m}"
    return sum(each.amount for each in skyway.each(list_statements(month=month)))


async def look_back(url: str, key: str, delivery_id: str) -> list[DeliveryEvent]:
    """The events of a delivery that is over, and the delivery in the list, with asyncio."""
    async with AsyncSkyway(url, key) as skyway:
        listed = [each.delivery_id async for each in skyway.each(list_deliveries(limit=1))]
        assert delivery_id in listed
        return [event async for event in skyway.events(delivery_id)]


def main() -> None:
    """Arguments: the gateway's URL, a customer's key, the pickup and the destination."""
    url, key, start, end = sys.argv[1:]
    server = HTTPServer(("127.0.0.1", 0), Shop)
    with Skyway(url, key) as skyway:
        hook = NewWebhook(url=f"http://127.0.0.1:{server.server_port}/skyway")
        issued = skyway.send(create_webhook(body=hook))
        Shop.secret = issued.secret
        threading.Thread(target=server.serve_forever, daemon=True).start()
        delivery = order(skyway, start, end)
        events = follow(skyway, delivery.delivery_id)
        assert [event.sequence for event in events] == list(range(1, len(events) + 1))
        done = skyway.send(get_delivery(delivery.delivery_id))
        [package] = done.packages
        assert package.dropoff_proof
        assert package.dropoff_proof.given_by == "RECIPIENT"
        assert Shop.has_last.wait(LONGEST_WAIT_S)
        assert spent(skyway, events[-1]) > 0
        # The next owner of this port must not be notified.
        skyway.send(delete_webhook(issued.webhook_id))
    server.shutdown()
    assert asyncio.run(look_back(url, key, delivery.delivery_id)) == events
    assert Shop.received == [event.type_ for event in events]
    with pytest.raises(NotVerified):
        read_notification(Shop.secret, {"webhook-signature": "v1,AA=="}, b"{}")
    sys.stdout.write(f"{done.state.value}\n")


if __name__ == "__main__":
    main()
