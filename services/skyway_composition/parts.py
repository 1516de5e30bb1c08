"""The parts that composition's folders share; none of them is opened here."""

import secrets
from dataclasses import dataclass, field
from typing import Final

from skyway.runtime.clock import load_clock
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.identity import ServiceGate, ServiceIdentity
from skyway.runtime.http.metrics_routes import MetricsGate
from skyway.runtime.loops import Wake
from skyway.runtime.metrics import Gauges
from skyway.runtime.minting import mint
from skyway.runtime.mqtt.signature_check import SignatureCheck
from skyway.runtime.replicas.membership import Membership
from skyway.runtime.replicas.replica_store import ReplicaStore
from skyway.runtime.signing.key_book import KeyBook
from skyway.runtime.sql.database import Database
from skyway_composition.closures.close import Closings
from skyway_composition.context import Context
from skyway_composition.gauge_store import OPEN_ROWS
from skyway_composition.links.listening import Listening
from skyway_composition.links.registered_keys import RegisteredKeys
from skyway_composition.missions.booking.book import Bookings
from skyway_composition.missions.booking.keep_offer import OfferKeeper, Quotes
from skyway_composition.missions.booking.turns import Turns
from skyway_composition.missions.closure_impact.impact import MissionImpact
from skyway_composition.missions.following.follow import ReportHandler
from skyway_composition.missions.following.quarantine_routes import Replays
from skyway_composition.missions.queue.dispatching.dispatch import (
    Dispatcher,
    DispatchTerms,
    OrderFinder,
)
from skyway_composition.missions.queue.dispatching.find_host import HostFinder
from skyway_composition.missions.queue.dispatching.search_process import SearchProcess
from skyway_composition.missions.replanning.foresee import Foresight
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.networks.service_status import CountDrones, count_drones_at
from skyway_composition.own_cells import OwnCells
from skyway_composition.planning.no_show_store import NoShows
from skyway_composition.planning.routes import StrategyRights
from skyway_composition.planning.solver_pool import ReadingTurn, SolverPool
from skyway_composition.quarantine.set_aside import Quarantine
from skyway_composition.settings import CompositionSettings
from skyway_composition.tables import outbox, replicas

SERVICE: Final = "composition"

#: How many labels of a booking's search run on the event loop: usually one or two milliseconds, at
#: most 20 at 1,000 stations. Quotes need many plans in a row, so they always use threads.
_INLINE_LABELS: Final = 1_024


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts(Context):
    """The context of missions, and what else the folders share."""

    membership: Membership
    gate: ServiceGate
    metrics_gate: MetricsGate
    #: Composes quotes, so that no booking waits behind them.
    inquiries: SolverPool
    #: Composes the problems of POST /v1/compositions and of dry runs: no quote waits behind them.
    problems: SolverPool
    rights: StrategyRights
    listening: Listening
    quarantine: Quarantine
    keys: KeyBook
    signatures: SignatureCheck
    no_shows: NoShows
    own_cells: OwnCells
    count_drones: CountDrones
    dispatch_terms: DispatchTerms
    #: A network was published.
    published: Wake = field(default_factory=Wake)
    search: SearchProcess = field(default_factory=SearchProcess)
    gauges: Gauges = field(default_factory=Gauges)
    turns: Turns = field(default_factory=Turns)
    reading: ReadingTurn = field(default_factory=ReadingTurn)

    @property
    def context(self) -> Context:
        """What missions need of these parts."""
        return self

    @property
    def handler(self) -> ReportHandler:
        """Handles the messages of drones."""
        return ReportHandler(self, self.quarantine)

    @property
    def bookings(self) -> Bookings:
        """Books missions."""
        shared = HostFinder(self, self.dispatch_terms.tolerance_s)
        return Bookings(self, turns=self.turns, shared=shared)

    @property
    def quotes(self) -> Quotes:
        """Answers requests for quotes."""
        return Quotes(self.planning_with(self.inquiries))

    @property
    def keeper(self) -> OfferKeeper:
        """Keeps offers while they are accepted."""
        return OfferKeeper(self, self.turns)

    @property
    def replays(self) -> Replays:
        """Handles messages again that were set aside."""
        return Replays(self, self.handler, self.keys)

    @property
    def impact(self) -> MissionImpact:
        """Marks missions for replanning that use what is closed or removed."""
        return MissionImpact(self, self.foresight)

    @property
    def foresight(self) -> Foresight:
        """Plans for dry runs, behind no booking and no quote."""
        return Foresight(self.planning_with(self.problems))

    @property
    def closings(self) -> Closings:
        """Makes and lifts closures."""
        return Closings(self.db, self.networks, self.impact, self.clock, self.mint)

    def dispatcher(self, registry: ServiceClient) -> Dispatcher:
        """Plans what waits in calendars again, all together."""
        context = self.planning_with(self.problems)
        return Dispatcher(self, OrderFinder(context, self.search, registry, self.dispatch_terms))


def registry_client(settings: CompositionSettings) -> ServiceClient:
    """The client that asks the registry about drones."""
    identity = ServiceIdentity(SERVICE, settings.secrets_dir)
    return ServiceClient("registry", settings.registry_url, identity)


def parts_of(settings: CompositionSettings, registry: ServiceClient) -> Parts:
    """The parts for these settings."""
    db = Database(settings.database_url, outbox=outbox)
    clock = load_clock(settings.clock_file)
    own_id = f"{SERVICE}-{secrets.token_hex(8)}"
    membership = Membership(
        ReplicaStore(db, replicas, open_rows=OPEN_ROWS), own_id=own_id, clock=clock
    )
    listening = Listening(clock, membership)
    own_cells = OwnCells.of(settings)
    keys = KeyBook(RegisteredKeys(registry, own_cells), clock)
    quarantine = Quarantine(
        db, clock=clock, mint=mint, listening=listening, is_foreign=own_cells.is_foreign
    )
    return Parts(
        db=db,
        membership=membership,
        gate=ServiceGate(settings.secrets_dir, allowed=("gateway", "registry")),
        metrics_gate=MetricsGate(settings.secrets_dir),
        clock=clock,
        mint=mint,
        networks=PreparedNetworks(db, clock, own_cells),
        solver=_pool(settings, "missions", inline_labels=_INLINE_LABELS),
        inquiries=_pool(settings, "quotes", inline_labels=0),
        problems=_pool(settings, "problems", inline_labels=0),
        rights=StrategyRights.read(settings.strategies),
        listening=listening,
        quarantine=quarantine,
        keys=keys,
        signatures=SignatureCheck(keys, quarantine),
        no_shows=NoShows(db, clock),
        own_cells=own_cells,
        count_drones=count_drones_at(registry),
        dispatch_terms=DispatchTerms(
            every_s=settings.dispatch_every_s,
            budget_s=settings.dispatch_budget_s,
            tolerance_s=settings.dispatch_tolerance_s,
        ),
    )


def _pool(settings: CompositionSettings, name: str, *, inline_labels: int) -> SolverPool:
    return SolverPool(
        name=name,
        threads=settings.solver_threads,
        time_limit_s=settings.solver_time_limit_s,
        inline_labels=inline_labels,
    )
