"""The registry as an app: its routes, the things it opens and closes, and its loops."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import Final, Never

from fastapi import FastAPI

from skyway.runtime.http.app import (
    Lifespan,
    Readiness,
    create_app,
    nothing_to_open,
    nothing_to_wait_for,
)
from skyway.runtime.http.entrance import ServiceEntrance
from skyway.runtime.http.metrics_routes import figures_routes, metrics_routes, readiness_gauges
from skyway.runtime.idempotency_store import sweep
from skyway.runtime.loops import Loops, always, repeat
from skyway.runtime.metrics import GaugeSource
from skyway.runtime.mqtt.client import MqttClient
from skyway.runtime.peer_secrets import read_secret
from skyway.runtime.replicas.membership import LeaderStep, Membership
from skyway.runtime.sql.migrations import migrate
from skyway_provider_registry.candidates.routes import candidate_routes, service_state_routes
from skyway_provider_registry.context import Context
from skyway_provider_registry.enrolment.routes import (
    drone_key_routes,
    drone_signature_routes,
    enrolment_routes,
)
from skyway_provider_registry.enrolment.signing_store import StoredKeys
from skyway_provider_registry.fleets.all_drones_routes import (
    all_drones_routes,
    live_routes,
    quota_routes,
)
from skyway_provider_registry.fleets.announce_business import BusinessAnnouncer
from skyway_provider_registry.fleets.announce_renewals import CompositionNotice, RenewalAnnouncer
from skyway_provider_registry.fleets.credential_routes import credential_routes
from skyway_provider_registry.fleets.drone_model_routes import drone_model_routes
from skyway_provider_registry.fleets.routes import (
    fleet_routes,
    fleet_statistics_routes,
    registration_routes,
)
from skyway_provider_registry.fleets.upkeep_routes import (
    battery_routes,
    installation_routes,
    maintenance_routes,
)
from skyway_provider_registry.gauges import RegistryGauges
from skyway_provider_registry.parts import SERVICE, Parts, parts_in_life
from skyway_provider_registry.presence.announce_alarms import AlarmAnnouncer
from skyway_provider_registry.presence.follow import PRESENCE_TOPICS, PresenceFollower
from skyway_provider_registry.presence.routes import presence_routes
from skyway_provider_registry.providers.routes import provider_routes
from skyway_provider_registry.settings import RegistrySettings
from skyway_provider_registry.telemetry.keep_telemetry import KeepTimes, TelemetryRecorder, Thinning
from skyway_provider_registry.telemetry.routes import TelemetryGeoJson, telemetry_routes

PACKAGE: Final = "skyway_provider_registry"

#: Seconds of wall time between two checks that the password file is written and was read.
_PASSWORDS_EVERY_S: Final = 1.0
_SWEEP_EVERY_S: Final = 600.0
#: Seconds of wall time between two looks for settings with which drones get no deliveries.
_BUSINESS_EVERY_S: Final = 60.0
#: Seconds of wall time between two transactions of the messages of drones.
_PRESENCE_EVERY_S: Final = 0.5
#: Seconds of wall time between two transactions of telemetry, and between two rounds of thinning.
_TELEMETRY_EVERY_S: Final = 1.0
_THINNING_EVERY_S: Final = 600.0
#: The longest wait for drones of a replica that is gone, seconds of wall time; then it waits again.
_LONGEST_WAIT_S: Final = 60.0


def registry_app(parts: Parts, *, lifespan: Lifespan, readiness: Readiness) -> FastAPI:
    """The routes of all rooms; the lifespan opens the parts."""
    db, gate, clock = parts.db, parts.gate, parts.clock
    context = Context(db, gate, clock, parts.mint)
    stations, password_file = parts.stations, parts.password_file
    return create_app(
        service=SERVICE,
        title="Skyway provider registry",
        description="Providers, drone models, fleets, presence, candidates.",
        models=(TelemetryGeoJson,),
        # Paths are matched in this order: first the routes that every delivery calls.
        routers=[
            candidate_routes(context, view=parts.fleet_view),
            presence_routes(context),
            provider_routes(context, stations=stations),
            drone_model_routes(context),
            registration_routes(
                context,
                stations=stations,
                password_file=password_file,
                limit=parts.drone_limit,
                cloud_keys=parts.cloud_keys,
            ),
            fleet_routes(
                context, stations=stations, password_file=password_file, servers=parts.servers
            ),
            all_drones_routes(context),
            service_state_routes(context),
            fleet_statistics_routes(context),
            credential_routes(context, password_file=password_file, issuer=parts.issuer),
            drone_key_routes(context, password_file=password_file),
            drone_signature_routes(context, keys=StoredKeys(db, clock)),
            enrolment_routes(context, password_file=password_file),
            battery_routes(context),
            installation_routes(context),
            maintenance_routes(context),
            quota_routes(context, limit=parts.drone_limit),
            live_routes(context),
            telemetry_routes(context),
            metrics_routes(gate=parts.metrics_gate, gauges=parts.gauges),
            figures_routes(gate=gate, gauges=parts.gauges),
        ],
        entrance=ServiceEntrance(gate),
        lifespan=lifespan,
        readiness=readiness,
    )


def build_app(settings: RegistrySettings) -> FastAPI:
    """The registry of these settings; the lifespan of the app opens everything."""
    parts = parts_in_life(settings)
    servers, membership = parts.servers, parts.membership

    async def on_connected() -> None:
        membership.set_listening(True)

    mqtt = MqttClient(
        settings.mqtt_url,
        client_id=membership.own_id,
        user_name=SERVICE,
        password=read_secret(settings.secrets_dir, f"mqtt_{SERVICE}"),
        tls=settings.mqtt_tls,
        on_connected=on_connected,
    )

    recorder = TelemetryRecorder(parts.db, parts.clock)
    keep_times = KeepTimes(
        samples_for=timedelta(hours=settings.telemetry_raw_hours),
        minutes_for=timedelta(days=settings.telemetry_days),
    )

    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
        parts.cloud_keys.read()  # without them no drone could be registered
        await migrate(settings.database_url, PACKAGE)
        async with parts.db, membership, servers, mqtt, Loops() as loops:
            membership.start(loops)
            loops.start("listening", _notice_lost_connections(mqtt, membership))
            gained = partial(_read_gained_drones, mqtt, membership)
            loops.start("gained drones", repeat("gained drones", gained, every_s=1.0))
            # First of all: without its accounts the broker refuses everybody, this service too.
            await parts.password_file.refresh()
            follower = PresenceFollower(
                mqtt.batches(*PRESENCE_TOPICS, doorkeeper=parts.signatures),
                db=parts.db,
                clock=parts.clock,
                pause_s=_PRESENCE_EVERY_S,
                listener=recorder.accept,
                place_of=partial(parts.networks.cached.position_if_connected, to=()),
            )
            parts.signatures.start(loops)
            loops.start("presence", repeat("presence", follower.step, every_s=1.0))
            loops.start("networks", parts.networks.run(mqtt))
            recording = repeat(
                "telemetry", recorder.step, every_s=_TELEMETRY_EVERY_S, wake=recorder.wake
            )
            loops.start("telemetry", recording)
            loops.start(
                "password file",
                repeat("password file", parts.password_file.step, every_s=_PASSWORDS_EVERY_S),
            )
            _start_leading(loops, parts, keep_times)
            yield

    async def readiness() -> dict[str, bool]:
        return {"database": await parts.db.is_answering(), "mqtt": mqtt.is_connected}

    inboxes = GaugeSource("mqtt", mqtt.gauges, kept_s=0.0)
    members = GaugeSource("replicas", membership.gauges, kept_s=0.0)
    own = RegistryGauges(parts.db, parts.clock, recorder, settings.broker_password_file)
    parts.gauges.show(readiness_gauges(readiness), *own.sources(), inboxes, members)
    return registry_app(parts, lifespan=lifespan, readiness=readiness)


def openapi_app() -> FastAPI:
    """The registry's routes for its OpenAPI document; it opens nothing."""
    nowhere = Path("not-opened")
    settings = RegistrySettings(
        database_url=f"sqlite:///{nowhere}",
        mqtt_url="mqtt://not-opened",
        secrets_dir=nowhere,
        broker_password_file=nowhere,
    )

    parts = parts_in_life(settings)
    return registry_app(parts, lifespan=nothing_to_open, readiness=nothing_to_wait_for)


def _start_leading(loops: Loops, parts: Parts, keep_times: KeepTimes) -> None:
    """Start the loops that only the leader runs, for all replicas."""
    renewals = RenewalAnnouncer(parts.db, parts.clock, CompositionNotice(parts.servers))
    business = BusinessAnnouncer(parts.db, parts.stations, parts.servers)
    looks = parts.membership.looks
    for name, step, every_s, polls in (
        ("thinning", Thinning(parts.db, parts.clock, keep_times).step, _THINNING_EVERY_S, always),
        ("alarms", AlarmAnnouncer(parts.db, parts.servers).step, 1.0, looks),
        ("renewals", renewals.step, 1.0, looks),
        ("business", business.step, _BUSINESS_EVERY_S, looks),
        ("idempotency", partial(_sweep, parts), _SWEEP_EVERY_S, always),
    ):
        led = LeaderStep(parts.membership, step)
        loops.start(name, repeat(name, led, every_s=every_s, polls=polls))


async def _notice_lost_connections(mqtt: MqttClient, membership: Membership) -> Never:
    """Let other replicas own the drones while this one is not connected to the broker."""
    while True:
        await mqtt.wait_connected()
        await mqtt.wait_lost()
        membership.set_listening(False)


async def _read_gained_drones(mqtt: MqttClient, membership: Membership) -> bool:
    """Get retained messages again when another replica is gone; always True: it waits itself.

    No replica has stored what its drones sent in the last seconds. Telemetry is not retained.
    """
    if await membership.gained.wait(_LONGEST_WAIT_S):
        mqtt.subscribe_again()
    return True


async def _sweep(parts: Parts) -> bool:
    await sweep(parts.db, parts.clock)
    return False
