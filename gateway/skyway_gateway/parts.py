"""The parts of the gateway, which `build_parts` makes and `app` opens."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import timedelta
from functools import partial
from typing import Final

from skyway.announced_networks import CachedNetworks, NetworkLearner
from skyway.cells import CellClients
from skyway.delivery.request import DeliveryRequest
from skyway.runtime.clock import AnchoredClock, FleetClock
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.entrance import KeyEntrance, Meters
from skyway.runtime.http.identity import ServiceGate
from skyway.runtime.http.metrics_routes import MetricsGate
from skyway.runtime.limits import FairQueue, Slots
from skyway.runtime.metrics import Gauges
from skyway.runtime.minting import mint
from skyway.runtime.replicas.membership import Membership
from skyway.runtime.sql.database import Database
from skyway_gateway.access.audit_trail import RefusedLogins
from skyway_gateway.access.keys import Keys
from skyway_gateway.access.login_codes import LoginCodes
from skyway_gateway.access.recognise import CachedKeys
from skyway_gateway.access.usage import DroneUsage, StreamUsage
from skyway_gateway.clients import Composition, DeliveryComposition, NetworkFinder, Registry
from skyway_gateway.console.console_files import BaseMap
from skyway_gateway.console.system_routes import SmallWorld
from skyway_gateway.deliveries.apply_reports import OverdueNotifier, ReportApplier
from skyway_gateway.deliveries.booking.book import Booker
from skyway_gateway.deliveries.booking.run_bookings import BookingLoop, ScheduleOpener
from skyway_gateway.deliveries.booking.wake_waiting import Waker
from skyway_gateway.deliveries.proving.accept_proof import ProofAcceptance
from skyway_gateway.deliveries.proving.photos import Photos
from skyway_gateway.deliveries.records.write_delivery import DeliveryWriter
from skyway_gateway.deliveries.requests.accept import Acceptance
from skyway_gateway.deliveries.requests.cancel import Canceller
from skyway_gateway.deliveries.requests.change import Changer
from skyway_gateway.deliveries.requests.plan_change import ChangePlanner
from skyway_gateway.deliveries.requests.quota_store import DeliveryQuota
from skyway_gateway.forward.table import TenantLimit
from skyway_gateway.lateness.lateness_forecast import LatenessForecast
from skyway_gateway.live.feed import LiveFeed
from skyway_gateway.livemode import ByMode
from skyway_gateway.notifications.delivery_events import EventListeners
from skyway_gateway.notifications.post_webhook import Targets, WebhookPost
from skyway_gateway.notifications.secret_vault import SecretVault
from skyway_gateway.notifications.send_webhooks import WebhookSender
from skyway_gateway.notifications.webhook_store import WebhookQuota
from skyway_gateway.places.serve import PlaceServer
from skyway_gateway.proofs.upload_links import UploadLinks
from skyway_gateway.quotes.accept_offer import OfferKeeper
from skyway_gateway.quotes.check_request import CachedPayloadLimits, RequestChecks
from skyway_gateway.quotes.make_quote import HoldLimits, QuoteMaker
from skyway_gateway.sandbox.both_compositions import BothCompositions
from skyway_gateway.sandbox.player import Player
from skyway_gateway.tracking.pages import TrackingPages
from skyway_gateway.tracking_links import TrackingLinks

SERVICE: Final = "gateway"


@dataclass(frozen=True, slots=True)
class Backend:
    """What stands behind the gateway, for live accounts or for test accounts."""

    registry: Registry
    composition: Composition
    networks: CachedNetworks
    places: PlaceServer
    #: Refuses a request that this backend alone cannot serve.
    check: Callable[[DeliveryRequest], object]


@dataclass(frozen=True, slots=True)
class Parts:
    """The parts of all rooms; a `Wake` lets one room wake the loop of another."""

    db: Database
    membership: Membership
    clock: FleetClock
    anchor: AnchoredClock
    clients: Mapping[str, ServiceClient]
    registry: Registry
    composition: Composition
    servers: CellClients
    find: NetworkFinder
    networks: NetworkLearner
    places: PlaceServer
    sandbox: Backend
    cached_keys: CachedKeys
    cached_sessions: CachedKeys
    login_codes: LoginCodes
    base_map: BaseMap
    small_world: SmallWorld
    metrics_gate: MetricsGate
    entrance: KeyEntrance
    refused_logins: RefusedLogins
    tenant_limit: TenantLimit
    meters: Meters
    services: ServiceGate
    keys: Keys
    listeners: EventListeners
    writer: DeliveryWriter
    targets: Targets
    post: WebhookPost
    sender: WebhookSender
    vault: SecretVault
    booking: BookingLoop
    horizon: timedelta
    hold_limits: HoldLimits
    quota: DeliveryQuota
    personal_kept: timedelta
    proofs: ProofAcceptance
    photos: Photos
    uploads: UploadLinks
    webhook_quota: WebhookQuota
    streams: Slots
    trials: Slots
    #: Three queues: a problem may take seconds, and no quote or report waits for it.
    quoting: FairQueue
    composing: FairQueue
    reporting: FairQueue
    stream_usage: StreamUsage
    drone_usage: DroneUsage
    waker: Waker
    forecast: LatenessForecast
    live: LiveFeed
    links: TrackingLinks
    pages: TrackingPages
    followers: Slots
    gauges: Gauges = field(default_factory=Gauges)

    def all_clients(self) -> dict[str, ServiceClient]:
        """The clients of the registry and of all servers of composition, by their names."""
        return {"registry": self.clients["registry"], **self.servers.every()}

    @property
    def backends(self) -> ByMode[Backend]:
        """The services themselves, and the sandbox."""
        live = Backend(
            self.registry,
            self.composition,
            self.networks.cached,
            self.places,
            lambda request: request,
        )
        return ByMode(live, self.sandbox)

    @property
    def places_of(self) -> ByMode[PlaceServer]:
        """Finds the stations that serve places."""
        return self.backends.each(lambda backend: backend.places)

    @property
    def flown_by(self) -> DeliveryComposition:
        """What flies deliveries of both modes."""
        return BothCompositions(self.composition, self.sandbox.composition)

    @property
    def booker(self) -> Booker:
        """Books queued deliveries."""
        return Booker(
            self.db,
            ByMode(self.registry, self.sandbox.registry),
            self.flown_by,
            self.canceller.finish,
            self.writer,
            self.clock,
            mint,
            self.booking.claimant,
            self.waker,
            self.forecast,
            self.uploads,
        )

    @property
    def canceller(self) -> Canceller:
        """Cancels deliveries."""
        return Canceller(self.db, self.flown_by, self.writer, self.clock, mint)

    @property
    def changers(self) -> ByMode[Changer]:
        """Changes deliveries."""
        return self.backends.each(self._changer)

    def _changer(self, backend: Backend) -> Changer:
        return Changer(
            self.db,
            ChangePlanner(backend.places, self._quote_maker(backend)),
            self.flown_by,
            self.writer,
            self.clock,
            self.horizon,
            self.personal_kept,
            self.booking.queued,
            self.photos,
        )

    @property
    def schedule_opener(self) -> ScheduleOpener:
        """Requests deliveries whose pickup has come within the booking horizon."""
        return ScheduleOpener(self.db, self.writer, self.clock, self.booking.queued, self.horizon)

    @property
    def overdue_notifier(self) -> OverdueNotifier:
        """Notifies customers of late deliveries."""
        return OverdueNotifier(self.db, self.writer, self.clock)

    @property
    def applier(self) -> ReportApplier:
        """Applies mission reports."""
        freed = self.waker.note_change_around
        learn = partial(self.booking.learn, self.booker)
        return ReportApplier(
            self.db, self.writer, self.clock, self.booking.queued, freed, learn, self.proofs.follow
        )

    @property
    def player(self) -> Player:
        """Plays the reports of test deliveries."""
        return Player(self.db, self.clock, self.applier.apply)

    @property
    def quote_makers(self) -> ByMode[QuoteMaker]:
        """Makes quotes."""
        return self.backends.each(self._quote_maker)

    def _quote_maker(self, backend: Backend) -> QuoteMaker:
        return QuoteMaker(
            self.db,
            backend.registry,
            backend.composition,
            self.checks(backend),
            self.clock,
            mint,
            self.horizon,
            self.hold_limits,
            self.quoting,
            backend.networks,
            self.forecast,
            backend.places,
        )

    @property
    def acceptances(self) -> ByMode[Acceptance]:
        """Accepts delivery requests."""
        return self.backends.each(self._acceptance)

    def _acceptance(self, backend: Backend) -> Acceptance:
        return Acceptance(
            self.db,
            backend.places,
            self.checks(backend),
            OfferKeeper(backend.registry, backend.composition, self.clock),
            self.writer,
            self.clock,
            mint,
            self.booking,
            self.horizon,
            self.quota,
            self.links,
            self.personal_kept,
            self.photos,
        )

    def checks(self, backend: Backend) -> RequestChecks:
        """Checks delivery requests against networks and fleets."""
        limits = CachedPayloadLimits(backend.registry, self.clock)
        return RequestChecks(
            limits,
            backend.networks,
            backend.composition,
            self.clock,
            backend.places.wait,
            backend.check,
        )
