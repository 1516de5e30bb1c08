"""The gateway as an app: its routes, what it opens and closes, and its loops."""

from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Final

from fastapi import FastAPI
from starlette.middleware import Middleware

from skyway.runtime.http.app import (
    Lifespan,
    Readiness,
    create_app,
    nothing_to_open,
    nothing_to_wait_for,
)
from skyway.runtime.http.metrics_routes import metrics_routes, readiness_gauges
from skyway.runtime.loops import Loops
from skyway.runtime.metrics import GaugeSource
from skyway.runtime.minting import mint
from skyway.runtime.mqtt.client import MqttClient
from skyway.runtime.peer_secrets import read_secret
from skyway.runtime.signing.cloud_key_file import read_signing_key
from skyway.runtime.signing.seal import CloudSeal
from skyway.runtime.sql.migrations import migrate
from skyway_gateway.access.audit_trail import AuditTrail
from skyway_gateway.access.routes import audit_routes, key_routes, limit_routes
from skyway_gateway.access.session_routes import session_link_routes, session_routes
from skyway_gateway.access.usage import ViewUsage
from skyway_gateway.build_parts import running_parts
from skyway_gateway.console.page_routes import console_routes
from skyway_gateway.console.system_routes import system_routes
from skyway_gateway.context import Context
from skyway_gateway.deliveries.booking.queue_store import free_claims
from skyway_gateway.deliveries.proving.routes import proof_routes, upload_routes
from skyway_gateway.deliveries.reading.routes import (
    earnings_routes,
    reading_routes,
    statistics_routes,
)
from skyway_gateway.deliveries.requests.routes import (
    delivery_routes,
    report_routes,
    shedding,
)
from skyway_gateway.forward.cell_routes import ForwardToCells
from skyway_gateway.forward.document import stored_document, whole_document
from skyway_gateway.forward.routes import forward_routes, provider_routes
from skyway_gateway.gauges import GatewayGauges
from skyway_gateway.ledger.routes import ledger_routes
from skyway_gateway.live.routes import live_routes
from skyway_gateway.notifications.delivery_events import EventStream
from skyway_gateway.notifications.fleet_time import publish_clock
from skyway_gateway.notifications.routes import (
    clock_routes,
    secret_routes,
    webhook_calls,
    webhook_routes,
    with_event_examples,
)
from skyway_gateway.notifications.seal_secrets import seal_secrets
from skyway_gateway.parts import SERVICE, Parts
from skyway_gateway.places.routes import place_routes
from skyway_gateway.quotes.routes import quote_routes
from skyway_gateway.quotes.store import read_networks
from skyway_gateway.settings import GatewaySettings
from skyway_gateway.tracking.branding_routes import branding_routes
from skyway_gateway.tracking.routes import link_routes, page_routes
from skyway_gateway.work import start_work

PACKAGE: Final = "skyway_gateway"


def gateway_app(parts: Parts, *, lifespan: Lifespan, readiness: Readiness) -> FastAPI:
    """The app with the routes of all rooms; the lifespan opens the parts."""
    db, clock, keys = parts.db, parts.clock, parts.keys
    context = Context(db, clock, mint)
    return create_app(
        service=SERVICE,
        title="Skyway",
        description="Have packages delivered by drones. Customers request deliveries and follow "
        "them, providers register their drones, operators publish networks and watch over "
        "missions. Each call carries an API key: `Authorization: Bearer sk_...`. Moments are RFC "
        "3339 UTC, quantities are in SI units, prices in minor units of their currency.",
        # A request is compared with each route in this order: the busiest routes come first.
        routers=[
            delivery_routes(
                acceptances=parts.acceptances,
                canceller=parts.canceller,
                changers=parts.changers,
            ),
            report_routes(gate=parts.services, applier=parts.applier),
            quote_routes(context, makers=parts.quote_makers),
            place_routes(places=parts.places_of),
            reading_routes(
                context,
                composition=parts.flown_by,
                stream=EventStream(db, parts.listeners),
                slots=parts.streams,
            ),
            earnings_routes(context, reporting=parts.reporting),
            live_routes(feed=parts.live, slots=parts.streams, meters=parts.meters),
            proof_routes(db, proofs=parts.proofs, photos=parts.photos),
            upload_routes(photos=parts.photos, uploads=parts.uploads, meters=parts.meters),
            link_routes(context, links=parts.links),
            branding_routes(context),
            page_routes(
                pages=parts.pages,
                feed=parts.live,
                slots=parts.followers,
                meters=parts.meters,
                proofs=parts.proofs,
                photos=parts.photos,
            ),
            webhook_routes(
                context,
                targets=parts.targets,
                quota=parts.webhook_quota,
                trials=parts.trials,
                vault=parts.vault,
                sender=parts.sender,
            ),
            secret_routes(context, vault=parts.vault),
            session_routes(context, cached=parts.cached_sessions, codes=parts.login_codes),
            session_link_routes(context, codes=parts.login_codes),
            key_routes(context, keys=keys),
            clock_routes(anchor=parts.anchor),
            provider_routes(context, registry=parts.clients["registry"], keys=keys),
            ledger_routes(context, reporting=parts.reporting),
            statistics_routes(context, reporting=parts.reporting, forecast=parts.forecast),
            audit_routes(context),
            limit_routes(
                meters=parts.meters,
                counters=(
                    parts.quota,
                    parts.webhook_quota,
                    parts.keys,
                    parts.stream_usage,
                    ViewUsage(parts.live),
                    parts.drone_usage,
                ),
            ),
            forward_routes(
                registry=parts.clients["registry"],
                to_cells=ForwardToCells(parts.servers, parts.find),
                changes=parts.waker,
                meters=parts.meters,
                planning=parts.composing,
                reporting=parts.reporting,
                tenant_limit=parts.tenant_limit,
            ),
            metrics_routes(gate=parts.metrics_gate, gauges=parts.gauges),
            console_routes(base_map=parts.base_map),
            system_routes(
                context,
                clients=parts.all_clients,
                gauges=parts.gauges,
                small_world=parts.small_world,
            ),
        ],
        lifespan=lifespan,
        readiness=readiness,
        entrance=shedding(parts.entrance, parts.booking, parts.membership),
        middleware=[Middleware(AuditTrail, db=db, clock=clock, mint=mint)],
        webhooks=webhook_calls(),
        publish=lambda own: whole_document(with_event_examples(own), stored_document()),
    )


def build_app(settings: GatewaySettings) -> FastAPI:
    """The gateway as it runs; the app's lifespan opens everything."""
    parts = running_parts(settings)
    parts.vault.require_keys()

    async def on_connected() -> None:
        parts.membership.set_listening(True)
        await publish_clock(mqtt, parts.anchor, mint)

    mqtt = MqttClient(
        settings.mqtt_url,
        client_id=parts.membership.own_id,
        user_name=SERVICE,
        password=read_secret(settings.secrets_dir, f"mqtt_{SERVICE}"),
        tls=settings.mqtt_tls,
        on_connected=on_connected,
        seal=CloudSeal(read_signing_key(settings.secrets_dir, SERVICE)),
    )

    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
        await migrate(settings.database_url, PACKAGE)
        async with AsyncExitStack() as opened:
            await opened.enter_async_context(parts.db)
            await opened.enter_async_context(parts.membership)
            await take_over(parts)
            await opened.enter_async_context(parts.clients["registry"])
            await opened.enter_async_context(parts.servers)
            await opened.enter_async_context(parts.post)
            opened.push_async_callback(parts.places.locator.geocoder.close)
            await opened.enter_async_context(mqtt)
            loops = await opened.enter_async_context(Loops())
            start_work(loops, parts, mqtt, settings)
            yield

    async def readiness() -> dict[str, bool]:
        return {"database": await parts.db.is_answering(), "mqtt": mqtt.is_connected}

    inboxes = GaugeSource("mqtt", mqtt.gauges, kept_s=0.0)
    members = GaugeSource("replicas", parts.membership.gauges, kept_s=0.0)
    own = (*GatewayGauges(parts).sources(), inboxes, members)
    parts.gauges.show(readiness_gauges(readiness), *own)
    return gateway_app(parts, lifespan=lifespan, readiness=readiness)


def openapi_app() -> FastAPI:
    """The gateway's routes for its OpenAPI document; nothing in it can be opened."""
    nowhere = Path("not-opened")
    settings = GatewaySettings(
        database_url=f"sqlite:///{nowhere}", mqtt_url="mqtt://not-opened", secrets_dir=nowhere
    )

    return gateway_app(
        running_parts(settings), lifespan=nothing_to_open, readiness=nothing_to_wait_for
    )


async def take_over(parts: Parts) -> None:
    """Prepare for the start: first keys, secrets, known networks, claims of dead processes."""
    await parts.keys.make_first_keys()
    await seal_secrets(parts.db, parts.vault, at=parts.clock.wall_now())
    for stations in await read_networks(parts.db):
        parts.networks.cached.put_outdated(stations)
    if parts.db.dialect == "sqlite":
        async with parts.db.write() as tx:
            await free_claims(tx)
