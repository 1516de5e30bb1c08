"""Builds the parts of the gateway from its settings; nothing is opened."""

import secrets
from collections.abc import Mapping
from datetime import timedelta
from functools import partial
from typing import TYPE_CHECKING, Final

from skyway.announced_networks import CachedNetworks, NetworkLearner, stations_from
from skyway.cells import CellClients
from skyway.runtime.clock import AnchoredClock, FleetClock, load_clock
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.entrance import KeyEntrance, Meters
from skyway.runtime.http.identity import ServiceGate, ServiceIdentity
from skyway.runtime.http.metrics_routes import MetricsGate
from skyway.runtime.limits import Budget, FairQueue, Meter, Slots
from skyway.runtime.loops import Wake
from skyway.runtime.minting import mint
from skyway.runtime.replicas.membership import Membership
from skyway.runtime.replicas.replica_store import ReplicaStore
from skyway.runtime.sql.database import Database
from skyway_gateway.access import session_store
from skyway_gateway.access.audit_trail import RefusedLogins
from skyway_gateway.access.keys import Keys
from skyway_gateway.access.login_codes import LoginCodes
from skyway_gateway.access.recognise import AllKeys, CachedKeys, DroneKeys, KeysInUse
from skyway_gateway.access.usage import DroneUsage, StreamUsage
from skyway_gateway.clients import Composition, NetworkFinder, RestRegistry, RoutedComposition
from skyway_gateway.console.console_files import BaseMap
from skyway_gateway.console.page_routes import BASE_MAP_PATH, CONSOLE_PATH
from skyway_gateway.console.system_routes import SmallWorld
from skyway_gateway.deliveries.booking.run_bookings import BookingLoop
from skyway_gateway.deliveries.booking.wake_waiting import Waker
from skyway_gateway.deliveries.proving.accept_proof import ProofAcceptance
from skyway_gateway.deliveries.proving.photos import Photos
from skyway_gateway.deliveries.records.delivery_rows import DeliveryCache
from skyway_gateway.deliveries.records.write_delivery import DeliveryWriter
from skyway_gateway.deliveries.requests.quota_store import DeliveryLimits, DeliveryQuota
from skyway_gateway.forward.table import TenantLimit, open_calls
from skyway_gateway.gauge_store import OPEN_ROWS
from skyway_gateway.lateness.lateness_forecast import LatenessForecast
from skyway_gateway.live.feed import LiveFeed
from skyway_gateway.live.sources import Deliveries, Drones, World
from skyway_gateway.notifications.delivery_events import EventListeners, EventRecorder
from skyway_gateway.notifications.fair_slots import FairSlots, SlotLimits
from skyway_gateway.notifications.post_webhook import Targets, WebhookPost
from skyway_gateway.notifications.secret_vault import SecretVault
from skyway_gateway.notifications.send_webhooks import WebhookSender
from skyway_gateway.notifications.webhook_store import WebhookQuota
from skyway_gateway.parts import SERVICE, Backend, Parts
from skyway_gateway.places.geocoder import Geocoder, NameGeocoder
from skyway_gateway.places.http_geocoder import HttpGeocoder
from skyway_gateway.places.locate import Locator
from skyway_gateway.places.serve import PlaceServer
from skyway_gateway.places.station_map import StationMap
from skyway_gateway.proofs.upload_links import UPLOAD_PATHS, UploadLinks
from skyway_gateway.quotes.make_quote import HoldLimits
from skyway_gateway.quotes.store import keep_network
from skyway_gateway.sandbox.both_compositions import BothCompositions
from skyway_gateway.sandbox.fleets import SandboxRegistry
from skyway_gateway.sandbox.network import sandbox_stations
from skyway_gateway.sandbox.outcomes import outcome_of
from skyway_gateway.sandbox.sandbox_composition import SandboxComposition
from skyway_gateway.settings import GatewaySettings
from skyway_gateway.short_wait import ShortWait
from skyway_gateway.tables import outbox, replicas
from skyway_gateway.tracking.pages import TrackingPages
from skyway_gateway.tracking_links import TRACKING_PATHS, TrackingLinks

if TYPE_CHECKING:
    from skyway_gateway.proofs.photo_store import PhotoStore

#: Quotes and problems of one tenant that are planned at the same time.
_QUOTES_PER_TENANT: Final = 2
_COMPOSITIONS_PER_TENANT: Final = 1
#: Reports of one tenant that are read at the same time.
_REPORTS_PER_TENANT: Final = 2

#: Addresses that are looked up at the same time, and those of one tenant.
_GEOCODED_AT_ONCE: Final = 8
_GEOCODED_OF_TENANT: Final = 3

#: Streams of tracking pages of one delivery that may be open.
_FOLLOWERS_OF_A_DELIVERY: Final = 20

#: Test events of one customer that may be on their way at the same time.
_TRIALS_AT_ONCE: Final = 4


def build_parts(
    settings: GatewaySettings,
    *,
    clients: Mapping[str, ServiceClient],
    anchor: AnchoredClock,
    clock: FleetClock,
) -> Parts:
    """The parts with these clients and this clock; nothing is opened."""
    db = Database(settings.database_url, outbox=outbox)
    own_id = f"{SERVICE}-{secrets.token_hex(8)}"
    registry = RestRegistry(clients["registry"])
    servers = CellClients(clients["composition"], settings.cells, settings.closed_networks)
    networks = NetworkLearner(stations_from(servers.of), keep=partial(keep_network, db))
    find = NetworkFinder(servers, networks.cached, db)
    composition = RoutedComposition(servers, find)
    listeners, notifications, targets = (
        EventListeners(),
        Wake(),
        Targets(settings.webhook_allow_networks),
    )
    post, vault = WebhookPost(targets), SecretVault(settings.secrets_dir)
    events = EventRecorder(clock=clock, mint=mint, listeners=listeners, webhooks=notifications)
    cached_keys, queued = CachedKeys(db, clock), Wake()
    services = ServiceGate(settings.secrets_dir, allowed=("composition",))
    meters = _meters(settings)
    sandbox = _sandbox(db, meters, settings, clock)
    public_url = str(settings.public_url)
    links = TrackingLinks(settings.secrets_dir, public_url)
    kept = timedelta(days=settings.proof_days)
    proofs = ProofAcceptance(db, clock, kept, SandboxComposition(db, clock, mint))
    streams = Slots("STREAMS", settings.streams_per_tenant)
    cached_sessions = CachedKeys(db, clock, session_store.shown)
    all_keys = AllKeys(cached_keys, cached_sessions, DroneKeys(registry), KeysInUse(db, clock))
    refused_logins = RefusedLogins(db, clock, mint)
    return Parts(
        db=db,
        membership=Membership(
            ReplicaStore(db, replicas, open_rows=OPEN_ROWS), own_id=own_id, clock=clock
        ),
        clock=clock,
        anchor=anchor,
        clients=clients,
        registry=registry,
        composition=composition,
        servers=servers,
        find=find,
        networks=networks,
        places=_places(settings, networks.cached, composition, meters, clock),
        sandbox=sandbox,
        cached_keys=cached_keys,
        cached_sessions=cached_sessions,
        login_codes=LoginCodes(db, clock, public_url),
        base_map=BaseMap(settings.console_map),
        small_world=SmallWorld(settings.small_world_file),
        metrics_gate=MetricsGate(settings.secrets_dir),
        entrance=KeyEntrance(
            all_keys,
            services,
            meters,
            open_calls(),
            refused_logins,
            # A page of the console is more than a hundred files: ten each would be too dear.
            open_paths=(TRACKING_PATHS, UPLOAD_PATHS, CONSOLE_PATH, BASE_MAP_PATH),
            code_calls=("POST /v1/sessions",),
        ),
        refused_logins=refused_logins,
        tenant_limit=TenantLimit(settings.composition_stations),
        meters=meters,
        services=services,
        keys=Keys(
            db,
            cached=cached_keys,
            accounts=registry,
            secrets_dir=settings.secrets_dir,
            clock=clock,
            mint=mint,
            most_per_subject=settings.keys_per_subject,
        ),
        listeners=listeners,
        writer=DeliveryWriter(db, events, DeliveryCache(), clock),
        targets=targets,
        post=post,
        vault=vault,
        sender=WebhookSender(
            db, post, vault, notifications, clock, mint, FairSlots(_slot_limits(settings))
        ),
        booking=BookingLoop(queued, claimant=mint("bkr"), most=settings.bookings_at_once),
        horizon=timedelta(hours=settings.booking_horizon_h),
        hold_limits=HoldLimits(settings.hold_s, settings.held_quotes_per_customer),
        quota=DeliveryQuota(
            db,
            DeliveryLimits(
                settings.live_deliveries_per_customer, settings.scheduled_deliveries_per_customer
            ),
        ),
        personal_kept=timedelta(days=settings.personal_data_days),
        proofs=proofs,
        photos=Photos(db, clock, _photo_store(settings), proofs),
        uploads=UploadLinks(settings.secrets_dir),
        webhook_quota=WebhookQuota(db, settings.webhooks_per_customer),
        streams=streams,
        quoting=FairQueue(
            "QUOTES",
            at_once=settings.quotes_at_once,
            per_tenant=_QUOTES_PER_TENANT,
            most_waiting=settings.plans_waiting_per_tenant,
        ),
        composing=FairQueue(
            "COMPOSITIONS",
            at_once=settings.compositions_at_once,
            per_tenant=_COMPOSITIONS_PER_TENANT,
            most_waiting=settings.plans_waiting_per_tenant,
        ),
        reporting=FairQueue(
            "REPORTS",
            at_once=settings.reports_at_once,
            per_tenant=_REPORTS_PER_TENANT,
            most_waiting=settings.plans_waiting_per_tenant,
        ),
        trials=Slots("WEBHOOK_TESTS", _TRIALS_AT_ONCE),
        stream_usage=StreamUsage(streams),
        drone_usage=DroneUsage(registry),
        waker=Waker(db, clock, networks.cached, queued),
        forecast=LatenessForecast(db, clock),
        links=links,
        pages=TrackingPages(db, links, BothCompositions(composition, sandbox.composition), clock),
        followers=Slots("FOLLOWERS", _FOLLOWERS_OF_A_DELIVERY),
        live=LiveFeed(
            (
                Deliveries(db),
                World(servers.every, db),
                Drones(clients["registry"]),
            ),
            most_views=settings.live_views_per_tenant,
            now=clock.now,
        ),
    )


def _places(
    settings: GatewaySettings,
    networks: CachedNetworks,
    composition: Composition,
    meters: Meters,
    clock: FleetClock,
) -> PlaceServer:
    stations, url = StationMap(networks), settings.geocoder_url
    geocoder = NameGeocoder(stations) if url is None else HttpGeocoder(url, clock)
    return _place_server(geocoder, stations, composition, meters, settings)


def _sandbox(db: Database, meters: Meters, settings: GatewaySettings, clock: FleetClock) -> Backend:
    """The world of test accounts: its addresses are the names of its own stations."""
    networks, composition = CachedNetworks(), SandboxComposition(db, clock, mint)
    networks.put(sandbox_stations())
    stations = StationMap(networks)
    places = _place_server(NameGeocoder(stations), stations, composition, meters, settings)
    return Backend(SandboxRegistry(), composition, networks, places, outcome_of)


def _place_server(
    geocoder: Geocoder,
    stations: StationMap,
    composition: Composition,
    meters: Meters,
    settings: GatewaySettings,
) -> PlaceServer:
    turns = FairQueue(
        "GEOCODING",
        at_once=_GEOCODED_AT_ONCE,
        per_tenant=_GEOCODED_OF_TENANT,
        most_waiting=settings.plans_waiting_per_tenant,
    )
    locator = Locator(geocoder, turns, meters.tenants)
    return PlaceServer(locator, stations, composition, ShortWait())


def _photo_store(settings: GatewaySettings) -> "PhotoStore | None":
    if settings.proof_store is None:
        return None
    # Imported here: its library takes 4 MiB, which only photos need.
    from skyway_gateway.proofs.photo_store import PhotoStore

    return PhotoStore(settings.proof_store)


def _slot_limits(settings: GatewaySettings) -> SlotLimits:
    return SlotLimits(settings.webhook_slots, settings.webhook_slots_per_customer)


def _meters(settings: GatewaySettings) -> Meters:
    tenants = Budget("TENANT_REQUESTS", settings.requests_per_s, settings.requests_burst)
    refusals = Budget("TENANT_REFUSALS", settings.refusals_per_s, settings.refusals_burst)
    addresses = Budget(
        "ADDRESS_REQUESTS", settings.address_requests_per_s, settings.address_requests_burst
    )
    return Meters(Meter(tenants), Meter(refusals), Meter(addresses))


def running_parts(settings: GatewaySettings) -> Parts:
    """The parts as they run: with the services and the clock of these settings."""
    identity = ServiceIdentity(SERVICE, settings.secrets_dir)
    clock = load_clock(settings.clock_file)
    clients = {
        "registry": ServiceClient("registry", settings.registry_url, identity),
        "composition": ServiceClient("composition", settings.composition_url, identity),
    }
    return build_parts(settings, clients=clients, anchor=clock, clock=clock)
