"""Composition as an app: its routes, what it opens and closes, and its loops."""

import re
from collections.abc import AsyncIterator, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from fastapi import FastAPI, Request

from skyway.cells import NETWORK_HEADER
from skyway.contracts.weather import ForecastDocument
from skyway.ids import NetworkId
from skyway.runtime.http.app import (
    Lifespan,
    Readiness,
    create_app,
    nothing_to_open,
    nothing_to_wait_for,
)
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.entrance import ServiceEntrance
from skyway.runtime.http.identity import ServiceIdentity
from skyway.runtime.http.metrics_routes import figures_routes, metrics_routes, readiness_gauges
from skyway.runtime.loops import Loops
from skyway.runtime.metrics import GaugeSource
from skyway.runtime.mqtt.client import MqttClient
from skyway.runtime.peer_secrets import read_secret
from skyway.runtime.signing.cloud_key_file import read_signing_key
from skyway.runtime.signing.seal import CloudSeal
from skyway.runtime.sql.migrations import migrate
from skyway_composition.alarm_routes import (
    alarm_routes,
    business_alarm_routes,
    drone_alarm_routes,
)
from skyway_composition.closures.routes import area_routes, place_routes, span_routes
from skyway_composition.gauges import CompositionGauges
from skyway_composition.links.renewal_routes import renewal_routes
from skyway_composition.live.routes import live_routes
from skyway_composition.missions.booking.routes import booking_routes
from skyway_composition.missions.following.quarantine_routes import quarantine_routes
from skyway_composition.missions.interventions.routes import intervention_routes
from skyway_composition.missions.schedule.routes import schedule_routes
from skyway_composition.missions.tracking_routes import tracking_routes
from skyway_composition.networks.change_weather import WeatherChanges
from skyway_composition.networks.routes import (
    network_routes,
    service_status_routes,
    weather_routes,
)
from skyway_composition.networks.station_routes import station_check_routes, station_routes
from skyway_composition.own_cells import OwnCells
from skyway_composition.pads.routes import pad_routes
from skyway_composition.parts import SERVICE, Parts, parts_of, registry_client
from skyway_composition.planning.routes import (
    CompositionProblem,
    ProblemReader,
    composition_routes,
    quote_routes,
)
from skyway_composition.retention.forget_routes import Forgetting, forget_routes
from skyway_composition.retention.prune import start_pruning
from skyway_composition.settings import CompositionSettings
from skyway_composition.statistics.routes import mission_statistics_routes, statistics_routes
from skyway_composition.work import Work

PACKAGE: Final = "skyway_composition"

_OF_A_NETWORK: Final = re.compile(r"/(?:v1|internal)/networks/([^/]+)")


@dataclass(frozen=True, slots=True)
class CellEntrance:
    """Admits requests of other services if they are for this composition's own networks."""

    entrance: ServiceEntrance
    own: OwnCells

    async def __call__(self, request: Request) -> Mapping[str, str]:
        """Check the service's secret, and the network in the header and in the path."""
        headers = await self.entrance(request)
        found = _OF_A_NETWORK.match(request.scope["path"])
        for name in (request.headers.get(NETWORK_HEADER), found and found[1]):
            if name is not None:
                self.own.refuse_foreign(NetworkId(name))
        return headers


def composition_app(parts: Parts, *, lifespan: Lifespan, readiness: Readiness) -> FastAPI:
    """The routes of all folders, on parts that the lifespan opens."""
    db, gate, clock, networks = parts.db, parts.gate, parts.clock, parts.networks
    problems = ProblemReader(db, networks, clock)
    return create_app(
        service=SERVICE,
        title="Skyway composition",
        description="What is flown: networks, pads, planning, missions.",
        models=(CompositionProblem, ForecastDocument),
        # Paths are matched in this order, so the routes of every delivery come first.
        routers=[
            booking_routes(
                gate=gate,
                bookings=parts.bookings,
                keeper=parts.keeper,
                no_shows=parts.no_shows,
            ),
            tracking_routes(db=db, gate=gate),
            schedule_routes(db=db, gate=gate, clock=clock),
            network_routes(
                db=db,
                gate=gate,
                networks=networks,
                clock=clock,
                published=parts.published,
                impact=parts.impact,
            ),
            weather_routes(
                gate=gate,
                changes=WeatherChanges(db, networks, parts.impact, clock, parts.calendars),
            ),
            station_routes(db=db, gate=gate, networks=networks, clock=clock),
            service_status_routes(
                db=db,
                gate=gate,
                networks=networks,
                clock=clock,
                count_drones=parts.count_drones,
            ),
            station_check_routes(db=db, gate=gate, networks=networks, clock=clock),
            pad_routes(db=db, gate=gate, clock=clock),
            live_routes(db=db, gate=gate, clock=clock),
            statistics_routes(db=db, gate=gate, clock=clock),
            mission_statistics_routes(db=db, gate=gate, clock=clock),
            composition_routes(
                gate=gate,
                problems=problems,
                solver=parts.problems,
                rights=parts.rights,
                reading=parts.reading,
            ),
            quote_routes(gate=gate, quotes=parts.quotes, no_shows=parts.no_shows),
            forget_routes(gate=gate, forgetting=Forgetting(db, clock)),
            intervention_routes(gate=gate, context=parts.context, foresight=parts.foresight),
            place_routes(gate=gate, closings=parts.closings),
            area_routes(gate=gate, closings=parts.closings),
            span_routes(gate=gate, closings=parts.closings),
            alarm_routes(db=db, gate=gate, clock=clock),
            drone_alarm_routes(db=db, gate=gate, mint=parts.mint),
            business_alarm_routes(db=db, gate=gate, clock=clock, mint=parts.mint),
            renewal_routes(db=db, gate=gate),
            quarantine_routes(db=db, gate=gate, replays=parts.replays),
            metrics_routes(gate=parts.metrics_gate, gauges=parts.gauges),
            figures_routes(gate=gate, gauges=parts.gauges),
        ],
        entrance=CellEntrance(ServiceEntrance(gate), parts.own_cells),
        lifespan=lifespan,
        readiness=readiness,
    )


def build_app(settings: CompositionSettings) -> FastAPI:
    """The app of the running service; its lifespan opens everything."""
    registry = registry_client(settings)
    parts = parts_of(settings, registry)
    identity = ServiceIdentity(SERVICE, settings.secrets_dir)
    gateway = ServiceClient("gateway", settings.gateway_url, identity)

    async def on_connected() -> None:
        await work.greet()

    mqtt = MqttClient(
        settings.mqtt_url,
        client_id=parts.membership.own_id,
        user_name=SERVICE,
        password=read_secret(settings.secrets_dir, f"mqtt_{SERVICE}"),
        tls=settings.mqtt_tls,
        on_connected=on_connected,
        seal=CloudSeal(read_signing_key(settings.secrets_dir, SERVICE)),
    )
    clients = {"gateway": gateway, "registry": registry}
    work = Work(parts, mqtt=mqtt, clients=clients)

    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
        await migrate(settings.database_url, PACKAGE)
        async with parts.db, AsyncExitStack() as opened:
            await parts.own_cells.read_database(parts.db)
            for each in (
                parts.membership,
                parts.solver,
                parts.inquiries,
                parts.problems,
                parts.search,
                gateway,
                registry,
                mqtt,
            ):
                await opened.enter_async_context(each)
            loops = await opened.enter_async_context(Loops())
            if parts.db.dialect != "sqlite":  # another replica may follow the drones
                parts.solver.needed.set()
            loops.start("warm", parts.solver.warm_when_needed())
            work.start(loops)
            start_pruning(loops, parts.membership, parts.db, parts.clock, settings)
            yield

    async def readiness() -> dict[str, bool]:
        return {
            "database": await parts.db.is_answering(),
            "mqtt": mqtt.is_connected,
            "planner": parts.solver.is_compiled,
        }

    inboxes = GaugeSource("mqtt", mqtt.gauges, kept_s=0.0)
    members = GaugeSource("replicas", parts.membership.gauges, kept_s=0.0)
    own = (*CompositionGauges(parts).sources(), inboxes, members)
    parts.gauges.show(readiness_gauges(readiness), *own)
    return composition_app(parts, lifespan=lifespan, readiness=readiness)


def openapi_app() -> FastAPI:
    """The app for the OpenAPI document; none of its parts can be opened."""
    nowhere = Path("not-opened")
    settings = CompositionSettings(
        database_url=f"sqlite:///{nowhere}", mqtt_url="mqtt://not-opened", secrets_dir=nowhere
    )

    return composition_app(
        parts_of(settings, registry_client(settings)),
        lifespan=nothing_to_open,
        readiness=nothing_to_wait_for,
    )
