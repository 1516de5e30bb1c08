"""The one place where composition is put together."""

import secrets
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from fastapi import FastAPI

from skyway.contracts.mission_reports import MANY_MISSION_REPORTS, MISSION_REPORTS
from skyway.runtime.clock import FleetClock, load_clock
from skyway.runtime.http.app import (
    Lifespan,
    Readiness,
    body_limits,
    create_app,
    nothing_to_open,
    nothing_to_wait_for,
)
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.identity import ServiceGate, ServiceIdentity, read_secret
from skyway.runtime.loops import Loops, Wake, repeat
from skyway.runtime.minting import Mint, mint
from skyway.runtime.mqtt.client import MqttClient
from skyway.runtime.outbox.mqtt_sender import MqttSender
from skyway.runtime.outbox.report_sender import ReportSender
from skyway.runtime.sql.database import Database
from skyway.runtime.sql.migrations import migrate
from skyway_composition.alarms.routes import alarm_routes
from skyway_composition.closures.closing import Closings
from skyway_composition.closures.routes import closure_routes
from skyway_composition.missions.affected.impact import MissionImpact
from skyway_composition.missions.affected.stops_watch import StopsWatch
from skyway_composition.missions.book import Bookings
from skyway_composition.missions.follow import Follower
from skyway_composition.missions.hands.cancel import Cancellations
from skyway_composition.missions.hands.commands import Commands
from skyway_composition.missions.hands.loading import Loadings
from skyway_composition.missions.hands.loading_watch import LoadingWatch
from skyway_composition.missions.hands.routes import hand_routes
from skyway_composition.missions.recompose import Recomposer
from skyway_composition.missions.recomposing.occupied_pads import OccupiedPads
from skyway_composition.missions.routes import mission_routes
from skyway_composition.missions.sweeps.lagging import Lagging
from skyway_composition.missions.sweeps.overdue import Overdue
from skyway_composition.networks.airspace.routes import airspace_routes
from skyway_composition.networks.announce import NetworkVersions
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.networks.routes import NETWORK_LIMIT_BYTES, network_routes
from skyway_composition.networks.stations.routes import station_check_routes, station_routes
from skyway_composition.pads.routes import pad_routes
from skyway_composition.pads.taken.station_states import StationStates
from skyway_composition.planning.known_network import KnownNetworks
from skyway_composition.planning.quotes import Quotes
from skyway_composition.planning.routes import (
    COMPOSITION_LIMIT_BYTES,
    composition_routes,
    quote_routes,
)
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.settings import CompositionSettings
from skyway_composition.statistics.now.routes import mission_statistics_routes
from skyway_composition.statistics.routes import statistics_routes
from skyway_composition.tables import outbox

SERVICE: Final = "composition"
PACKAGE: Final = "skyway_composition"

#: Seconds of wall time between two looks of a loop that nothing has woken.
_LOOK_EVERY_S: Final = 1.0

#: How far the event loop itself searches for a booking's plan: a millisecond or two as a rule, 20
#: at most among odd requests at 1,000 stations. Inquiries ask for many plans in a row, so never.
_LABELS_AT_ONCE: Final = 2_048


@dataclass(frozen=True, slots=True)
class Parts:
    """What the rooms are made of; `Wake`s tell one room's loop what another has done."""

    db: Database
    gate: ServiceGate
    clock: FleetClock
    mint: Mint
    networks: PreparedNetworks
    solver: SolverPool
    #: Plans that are only asked for; no booking waits behind them.
    inquiries: SolverPool
    published: Wake
    stuck: Wake

    @property
    def bookings(self) -> Bookings:
        """Books missions."""
        return Bookings(self.db, self.networks, self.solver, self.clock, self.mint)

    @property
    def quotes(self) -> Quotes:
        """Answers what could be offered."""
        return Quotes(self.db, self.networks, self.inquiries, self.clock, self.bookings.busy_among)

    @property
    def impact(self) -> MissionImpact:
        """Strikes the missions that fly by what is closed or taken away."""
        return MissionImpact(self.clock, self.mint, self.stuck)

    @property
    def closings(self) -> Closings:
        """Makes and lifts closures."""
        return Closings(self.db, self.networks, self.impact, self.clock, self.mint)


def composition_app(parts: Parts, *, lifespan: Lifespan, readiness: Readiness) -> FastAPI:
    """All rooms' routes on these parts, which the lifespan opens."""
    db, gate, clock, networks = parts.db, parts.gate, parts.clock, parts.networks
    known = KnownNetworks(db, networks, clock)
    hands = (db, clock, parts.mint, parts.stuck)
    return create_app(
        service=SERVICE,
        title="Skyway composition",
        description="What is flown: networks, pads, planning, missions.",
        # A path is looked for in their order: first what every delivery asks for.
        routers=[
            mission_routes(db=db, gate=gate, bookings=parts.bookings),
            network_routes(
                db=db,
                gate=gate,
                networks=networks,
                clock=clock,
                published=parts.published,
                impact=parts.impact,
            ),
            station_routes(db=db, gate=gate, networks=networks, clock=clock),
            airspace_routes(gate=gate, networks=networks),
            station_check_routes(db=db, gate=gate, networks=networks),
            pad_routes(db=db, gate=gate, clock=clock),
            statistics_routes(db=db, gate=gate, clock=clock),
            mission_statistics_routes(db=db, gate=gate, clock=clock),
            composition_routes(gate=gate, known=known, solver=parts.inquiries),
            quote_routes(gate=gate, quotes=parts.quotes),
            hand_routes(
                gate=gate,
                loadings=Loadings(*hands),
                commands=Commands(*hands),
                cancellations=Cancellations(*hands),
            ),
            closure_routes(gate=gate, closings=parts.closings),
            alarm_routes(db=db, gate=gate, clock=clock),
        ],
        lifespan=lifespan,
        readiness=readiness,
        body_limit=body_limits(
            {
                "PUT /v1/networks/{network_id}": NETWORK_LIMIT_BYTES,
                "POST /v1/compositions": COMPOSITION_LIMIT_BYTES,
            }
        ),
    )


class Work:
    """What composition does besides answering: it sends, follows, re-composes, sweeps, tells."""

    def __init__(
        self, parts: Parts, *, mqtt: MqttClient, clients: Mapping[str, ServiceClient], replica: str
    ) -> None:
        db, clock, mint = parts.db, parts.clock, parts.mint
        self._parts = parts
        self._instructions = MqttSender(db, mqtt, clock)
        self._reports = ReportSender(
            db, clients, clock, together={MISSION_REPORTS: MANY_MISSION_REPORTS}
        )
        self._follower = Follower(db, mqtt, clock=clock, mint=mint, stuck=parts.stuck)
        self._overdue = Overdue(db, clock, mint)
        self._lagging = Lagging(db, parts.networks, clock, mint, parts.stuck)
        self._recomposer = Recomposer(
            db, parts.networks, parts.solver, clock, mint, replica, OccupiedPads(parts.closings)
        )
        self._loading_watch = LoadingWatch(db, parts.networks, clock, mint)
        self._stops_watch = StopsWatch(db, parts.closings, clock)
        self._station_states = StationStates(db, mqtt, clock, mint)
        self._network_versions = NetworkVersions(db, mqtt, clock, mint)

    async def greet(self) -> None:
        """After every connect: tell what the broker has forgotten, ask for what we missed."""
        self._station_states.forget()
        self._network_versions.forget()
        self._parts.published.set()
        await self._follower.ask_live_drones()

    def start(self, loops: Loops) -> None:
        """Do all of it until the loops end."""
        loops.start("instructions", self._instructions.run())
        loops.start("reports", self._reports.run())
        loops.start("follow", self._follower.run())
        for name, step, wake in (
            ("recompose", self._recomposer.step, self._parts.stuck),
            ("overdue", self._overdue.step, Wake()),
            ("lagging", self._lagging.step, Wake()),
            ("loading", self._loading_watch.step, Wake()),
            ("ground stops", self._stops_watch.step, Wake()),
            ("station states", self._station_states.step, Wake()),
            ("network versions", self._network_versions.step, self._parts.published),
        ):
            loops.start(name, repeat(name, step, every_s=_LOOK_EVERY_S, wake=wake))


def build_app(settings: CompositionSettings) -> FastAPI:
    """Composition as it runs; everything is opened by the app's lifespan."""
    parts = _parts(settings)
    replica = f"{SERVICE}-{secrets.token_hex(8)}"
    identity = ServiceIdentity(SERVICE, settings.secrets_dir)
    gateway = ServiceClient("gateway", settings.gateway_url, identity)
    registry = ServiceClient("registry", settings.registry_url, identity)

    async def on_connected() -> None:
        await work.greet()

    mqtt = MqttClient(
        settings.mqtt_url,
        client_id=replica,
        user_name=SERVICE,
        password=read_secret(settings.secrets_dir, f"mqtt_{SERVICE}"),
        on_connected=on_connected,
    )
    clients = {"gateway": gateway, "registry": registry}
    work = Work(parts, mqtt=mqtt, clients=clients, replica=replica)

    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
        await migrate(settings.database_url, PACKAGE)
        async with (
            parts.db,
            parts.solver,
            parts.inquiries,
            gateway,
            registry,
            mqtt,
            Loops() as loops,
        ):
            loops.start("warm", parts.solver.warm())
            work.start(loops)
            yield

    async def readiness() -> dict[str, bool]:
        return {
            "database": await parts.db.is_answering(),
            "mqtt": mqtt.is_connected,
            "planner": parts.solver.is_warm,
        }

    return composition_app(parts, lifespan=lifespan, readiness=readiness)


def openapi_app() -> FastAPI:
    """Composition's routes for its OpenAPI document; nothing in it can be opened."""
    nowhere = Path("not-opened")
    settings = CompositionSettings(
        database_url=f"sqlite:///{nowhere}", mqtt_url="mqtt://not-opened", secrets_dir=nowhere
    )

    return composition_app(
        _parts(settings), lifespan=nothing_to_open, readiness=nothing_to_wait_for
    )


def _parts(settings: CompositionSettings) -> Parts:
    db = Database(settings.database_url, outbox=outbox)
    return Parts(
        db=db,
        gate=ServiceGate(settings.secrets_dir, allowed=("gateway", "registry")),
        clock=load_clock(settings.clock_file),
        mint=mint,
        networks=PreparedNetworks(db),
        solver=_pool(settings, labels_at_once=_LABELS_AT_ONCE),
        inquiries=_pool(settings, labels_at_once=0),
        published=Wake(),
        stuck=Wake(),
    )


def _pool(settings: CompositionSettings, *, labels_at_once: int) -> SolverPool:
    return SolverPool(
        threads=settings.solver_threads,
        time_limit_s=settings.solver_time_limit_s,
        labels_at_once=labels_at_once,
    )
