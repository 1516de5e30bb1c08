"""The README's story, played with a client that openapi-python-client made from our document.

Run with the generated package `skyway_client` on the path; the arguments are read in `main`.
"""

import json
import subprocess
import sys
import threading
import time
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import ClassVar, TypeVar

from skyway_client import AuthenticatedClient
from skyway_client.api.deliveries import create_delivery, get_delivery, stream_delivery_events
from skyway_client.api.drones import list_drones, register_drones
from skyway_client.api.keys import create_key
from skyway_client.api.networks import list_stations, publish_network
from skyway_client.api.providers import create_provider
from skyway_client.api.webhooks import create_webhook, list_webhook_attempts
from skyway_client.models import (
    Delivery,
    DeliveryCompletedEvent,
    DeliveryRequest,
    DeliveryRequestedEvent,
    DronePage,
    IssuedKey,
    IssuedWebhook,
    NetworkDocument,
    NetworkInfo,
    NewDrone,
    NewKey,
    NewKeyRole,
    NewProvider,
    NewWebhook,
    Package,
    Place,
    ProblemDetails,
    ProviderWithKey,
    QoS,
    QoSObjectiveType0,
    RegisteredDrones,
    RequestedDelivery,
    StationInfoPage,
    Tariff,
    WebhookAttemptOutcome,
    WebhookAttemptPage,
)

T = TypeVar("T")

LONGEST_WAIT_S = 120.0
PACKAGE_KG = 0.8


class Customer(BaseHTTPRequestHandler):
    """The customer's server: it keeps the types of the events that it receives."""

    received: ClassVar[list[str]] = []

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["content-length"]))
        self.received.append(json.loads(body)["type"])
        self.send_response(204)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Say nothing."""


def expect(kind: type[T], answer: object) -> T:
    """The answer, which must be of this model and no problem."""
    if isinstance(answer, ProblemDetails):
        raise TypeError(f"{answer.title}: {answer.detail}")
    if not isinstance(answer, kind):
        raise TypeError(f"{answer!r} is no {kind.__name__}")
    return answer


def publish(operator: AuthenticatedClient, network_id: str, network: NetworkDocument) -> list[str]:
    """Publish a network, and read its stations."""
    info = expect(NetworkInfo, publish_network.sync(network_id, client=operator, body=network))
    stations = expect(StationInfoPage, list_stations.sync(info.network_id, client=operator))
    return [station.station_id for station in stations.items]


def make_fleet(
    url: str, operator: AuthenticatedClient, homes: list[str]
) -> tuple[AuthenticatedClient, ProviderWithKey, RegisteredDrones]:
    """Register a provider, who registers a drone at each home."""
    requested = NewProvider(
        name="Hill Country Drones", tariff=Tariff(currency="USD", base=500, per_km=25)
    )
    provider = expect(ProviderWithKey, create_provider.sync(client=operator, body=requested))
    owner = AuthenticatedClient(base_url=url, token=provider.key)
    drones = [NewDrone(model_id="paper-scenario", home_station_id=home) for home in homes]
    fleet = expect(
        RegisteredDrones, register_drones.sync(provider.provider_id, client=owner, body=drones)
    )
    assert all(drone.enrolment_token for drone in fleet.items)
    assert all(drone.mqtt.password for drone in fleet.items)
    return owner, provider, fleet


def wait_until_available(owner: AuthenticatedClient, provider_id: str) -> None:
    """Return when all drones of the provider can fly."""
    until = time.monotonic() + LONGEST_WAIT_S
    while time.monotonic() < until:
        page = expect(DronePage, list_drones.sync(provider_id, client=owner))
        if all(drone.state.value == "AVAILABLE" for drone in page.items):
            return
        time.sleep(0.2)
    raise TimeoutError("the drones did not become available")


def deliver(customer: AuthenticatedClient, start: str, end: str, hook_url: str) -> None:
    """Request a delivery, follow it to its end, and see that the webhook received its events."""
    webhook = expect(
        IssuedWebhook, create_webhook.sync(client=customer, body=NewWebhook(url=hook_url))
    )
    assert webhook.secret
    package = Package(package_id="p1", mass_kg=PACKAGE_KG, destination=Place(station_id=end))
    request = DeliveryRequest(
        pickup=Place(station_id=start),
        packages=[package],
        qos=QoS(objective=QoSObjectiveType0.FASTEST),
    )
    delivery = expect(
        RequestedDelivery,
        create_delivery.sync(client=customer, body=request, idempotency_key="story"),
    )
    events = follow(customer, delivery.delivery_id)
    first = DeliveryRequestedEvent.from_dict(events[0])
    last = DeliveryCompletedEvent.from_dict(events[-1])
    assert first.data.request.packages[0].mass_kg == PACKAGE_KG
    assert last.data.actual.delivery_time_s
    assert last.sequence == len(events)
    done = expect(Delivery, get_delivery.sync(delivery.delivery_id, client=customer))
    assert done.state.value == "COMPLETED"
    wait_until_notified(customer, webhook.webhook_id, len(events))


def follow(customer: AuthenticatedClient, delivery_id: str) -> list[dict[str, object]]:
    """The events of a delivery up to its end."""
    frames = stream_delivery_events.sync(delivery_id, client=customer)
    if not isinstance(frames, str):
        raise TypeError(f"{frames!r} is no text")
    lines = [line for line in frames.splitlines() if line.startswith("data: ")]
    return [json.loads(line.removeprefix("data: ")) for line in lines]


def wait_until_notified(customer: AuthenticatedClient, webhook_id: str, events: int) -> None:
    """Return when the webhook received all events, each at the first attempt."""
    until = time.monotonic() + LONGEST_WAIT_S
    while time.monotonic() < until:
        attempts = expect(
            WebhookAttemptPage, list_webhook_attempts.sync(webhook_id, client=customer)
        )
        if len(attempts.items) == events:
            assert {a.outcome for a in attempts.items} == {WebhookAttemptOutcome.DELIVERED}
            assert len(Customer.received) == events
            return
        time.sleep(0.2)
    raise TimeoutError("the webhook did not receive all events")


def main() -> None:
    """Arguments: the gateway's URL, an operator's key, a network's file, then `skyway fleet`."""
    url, operator_key, network_file, *fleet_command = sys.argv[1:]
    network = NetworkDocument.from_dict(json.loads(Path(network_file).read_text()))
    operator = AuthenticatedClient(base_url=url, token=operator_key, timeout=None)
    stations = publish(operator, "story", network)
    issued = expect(
        IssuedKey,
        create_key.sync(
            client=operator, body=NewKey(role=NewKeyRole.CUSTOMER, subject_id="river-books")
        ),
    )
    owner, provider, drones = make_fleet(url, operator, stations[:2])
    fleet_file = Path(network_file).with_name("fleet.json")
    fleet_file.write_text(json.dumps(drones.to_dict()))
    server = HTTPServer(("127.0.0.1", 0), Customer)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    fleet = subprocess.Popen([*fleet_command, str(fleet_file)])
    try:
        wait_until_available(owner, provider.provider_id)
        customer = AuthenticatedClient(base_url=url, token=issued.key)
        hook_url = f"http://127.0.0.1:{server.server_port}/skyway"
        deliver(customer, stations[0], stations[-1], hook_url)
    finally:
        fleet.terminate()
        fleet.wait(timeout=LONGEST_WAIT_S)
        server.shutdown()
    sys.stdout.write("COMPLETED\n")


if __name__ == "__main__":
    main()
