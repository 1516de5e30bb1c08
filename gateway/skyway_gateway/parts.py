"""What the gateway is made of; nothing of it is opened here."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from skyway.announced_networks.learning import NetworkLearner, asking
from skyway.runtime.clock import AnchoredClock, FleetClock, load_clock
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.identity import ServiceGate, ServiceIdentity
from skyway.runtime.loops import Wake
from skyway.runtime.minting import mint
from skyway.runtime.sql.database import Database
from skyway_gateway.access.issue_keys import Keys
from skyway_gateway.access.recognise_keys import DroneKeys, KnownKeys
from skyway_gateway.access.routes import KeyGate
from skyway_gateway.clients import Composition, Registry, RestComposition, RestRegistry
from skyway_gateway.deliveries.accepting.accept import Acceptance
from skyway_gateway.deliveries.booking.book import Booker
from skyway_gateway.deliveries.booking.run_bookings import BookingLoop
from skyway_gateway.deliveries.cancelling.cancel import Canceller
from skyway_gateway.deliveries.records.stored_delivery import KnownDeliveries
from skyway_gateway.deliveries.records.write_delivery import DeliveryWriter
from skyway_gateway.deliveries.reporting.apply_reports import Follower
from skyway_gateway.deliveries.reporting.notify_overdue import OverdueWatch
from skyway_gateway.notifications.record_events import Events
from skyway_gateway.notifications.stream_events import News
from skyway_gateway.notifications.webhooks.post_webhook import WebhookPost
from skyway_gateway.notifications.webhooks.send_webhooks import WebhookSender
from skyway_gateway.notifications.webhooks.targets import Targets
from skyway_gateway.quotes.cached_payload_limits import PayloadLimits
from skyway_gateway.quotes.check_request import Checks
from skyway_gateway.quotes.make_quote import QuoteMaker
from skyway_gateway.settings import GatewaySettings
from skyway_gateway.tables import outbox

SERVICE: Final = "gateway"


@dataclass(frozen=True, slots=True)
class Parts:
    """What the rooms are made of; `Wake`s tell one room's loop what another has done."""

    db: Database
    clock: FleetClock
    anchor: AnchoredClock
    clients: Mapping[str, ServiceClient]
    registry: Registry
    composition: Composition
    networks: NetworkLearner
    known_keys: KnownKeys
    gate: KeyGate
    services: ServiceGate
    keys: Keys
    news: News
    writer: DeliveryWriter
    targets: Targets
    post: WebhookPost
    sender: WebhookSender
    booking: BookingLoop

    @property
    def booker(self) -> Booker:
        """Books queued deliveries."""
        return Booker(
            self.db,
            self.registry,
            self.composition,
            self.canceller.finish,
            self.writer,
            self.clock,
            mint,
            self.booking.claimant,
        )

    @property
    def canceller(self) -> Canceller:
        """Cancels deliveries."""
        return Canceller(self.db, self.composition, self.writer, self.clock, mint)

    @property
    def overdue_watch(self) -> OverdueWatch:
        """Tells that deliveries are late."""
        return OverdueWatch(self.db, self.writer, self.clock)

    @property
    def follower(self) -> Follower:
        """Applies mission reports."""
        return Follower(self.db, self.writer, self.clock, self.booking.queued)

    @property
    def quote_maker(self) -> QuoteMaker:
        """Makes quotes."""
        return QuoteMaker(
            self.db,
            self.registry,
            self.composition,
            self.checks,
            self.clock,
            mint,
        )

    @property
    def acceptance(self) -> Acceptance:
        """Accepts delivery requests."""
        return Acceptance(self.db, self.checks, self.writer, self.clock, mint, self.booking)

    @property
    def checks(self) -> Checks:
        """Checks delivery requests against the world."""
        limits = PayloadLimits(self.registry, self.clock)
        return Checks(limits, self.networks.known, self.composition, self.clock)


def build_parts(
    settings: GatewaySettings,
    *,
    clients: Mapping[str, ServiceClient],
    anchor: AnchoredClock,
    clock: FleetClock,
) -> Parts:
    """The parts on these clients and this clock; nothing is opened."""
    db = Database(settings.database_url, outbox=outbox)
    registry = RestRegistry(clients["registry"])
    composition = RestComposition(clients["composition"])
    news, told, targets = News(), Wake(), Targets(settings.webhook_allow_networks)
    post = WebhookPost(targets)
    events = Events(clock=clock, mint=mint, news=news, webhooks=told)
    known_keys = KnownKeys(db, clock)
    return Parts(
        db=db,
        clock=clock,
        anchor=anchor,
        clients=clients,
        registry=registry,
        composition=composition,
        networks=NetworkLearner(asking(clients["composition"])),
        known_keys=known_keys,
        gate=KeyGate(known_keys, DroneKeys(registry)),
        services=ServiceGate(settings.secrets_dir, allowed=("composition",)),
        keys=Keys(
            db,
            known=known_keys,
            accounts=registry,
            secrets_dir=settings.secrets_dir,
            clock=clock,
            mint=mint,
        ),
        news=news,
        writer=DeliveryWriter(db, events, KnownDeliveries()),
        targets=targets,
        post=post,
        sender=WebhookSender(db, post, told, clock, mint),
        booking=BookingLoop(Wake(), claimant=mint("bkr"), most=settings.bookings_at_once),
    )


def parts_in_life(settings: GatewaySettings) -> Parts:
    """The parts as they run: with the services of these settings, and the system's clock."""
    identity = ServiceIdentity(SERVICE, settings.secrets_dir)
    clock = load_clock(settings.clock_file)
    clients = {
        "registry": ServiceClient("registry", settings.registry_url, identity),
        "composition": ServiceClient("composition", settings.composition_url, identity),
    }
    return build_parts(settings, clients=clients, anchor=clock, clock=clock)
