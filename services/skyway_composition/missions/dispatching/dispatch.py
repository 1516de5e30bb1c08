"""Runs the dispatcher: it looks for a better order of what waits, and adopts it whole."""

import logging
from dataclasses import dataclass, field
from typing import Final

from skyway.contracts.drones import (
    MOST_DRONES,
    OUT_OF_SERVICE,
    OutOfServiceAnswer,
    OutOfServiceQuery,
)
from skyway.ids import DroneId, NetworkId, ProviderId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.errors import RowRefused
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.loops import Wake
from skyway.runtime.metrics import count, timed
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database
from skyway.scheduling.trip import NoTrip
from skyway.units import moment_to_ms
from skyway_composition.links.store import held_among, links_to
from skyway_composition.missions.dispatching import store
from skyway_composition.missions.dispatching.adopt import BetterOrder, adopt
from skyway_composition.missions.dispatching.fleet import Fleet, Orders, Times, fleet_of
from skyway_composition.missions.dispatching.fleet_problem import fleet_problem
from skyway_composition.missions.dispatching.judgement import Judgement, judge
from skyway_composition.missions.dispatching.plan_orders import plan_orders
from skyway_composition.missions.dispatching.search_process import (
    Search,
    SearchFailed,
    SearchProcess,
)
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.pads.store import booked_everywhere
from skyway_composition.planning.availability import hand_over_time_ms
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.world import World

log = logging.getLogger(__name__)

#: Until a new plan is saved and a drone is reached, beside the search: fleet seconds, wall seconds.
_SETTLED_S: Final = (120.0, 3.0)
#: The same once a plan is made.
_REACH_S: Final = (5.0, 1.0)

#: The most waiting missions of one search; a fleet with more keeps its order. Our own choice.
_MOST_WAITING: Final = 500

#: What a run may end with, for the metric.
OUTCOMES: Final = (
    "adopted",
    "kept",
    "no plan",
    "promise",
    "no gain",
    "outdated",
    "taken",
    "failed",
)


#: Outcomes that may be better when more standbys make room.
_FOR_PADS: Final = ("no plan", "promise", "no gain")


@dataclass(frozen=True, slots=True)
class DispatchTerms:
    """How often the dispatcher looks, how long it searches, and how late a promise may get.

    Wall seconds, processor seconds and fleet seconds. With `every_s` 0 there is no dispatcher.
    """

    every_s: float
    budget_s: float
    tolerance_s: float


@dataclass(frozen=True, slots=True)
class Dispatcher:
    """Exchanges what waits between the drones of a provider, if the fleet then delivers earlier.

    A fleet whose calendars have not changed since the last search is not searched again.
    """

    db: Database
    networks: PreparedNetworks
    solver: SolverPool
    search: SearchProcess
    registry: ServiceClient
    clock: FleetClock
    mint: Mint
    terms: DispatchTerms
    calendars: Wake
    _searched: dict[tuple[NetworkId, ProviderId], Orders] = field(default_factory=dict)

    async def step(self) -> bool:
        """Step of a loop: look at each fleet once. Always False."""
        async with self.db.read() as connection:
            fleets = await store.waiting_fleets(connection)
        for gone in self._searched.keys() - {*fleets}:
            del self._searched[gone]
        for network_id, provider_id in fleets:
            await self.look_at(network_id, provider_id)
        return False

    async def look_at(self, network_id: NetworkId, provider_id: ProviderId) -> str | None:
        """Search a better order for one fleet and adopt it; the outcome, None without a search."""
        times = self._times()
        skyway = await self.networks.current(network_id)
        world = await World.of(skyway, self.db, after_ms=times.now_ms)
        fleet = await self._fleet(network_id, provider_id, times)
        if not _can_improve(fleet) or not fleet.is_planned_in(world.present):
            return None
        orders = fleet.orders
        if self._searched.get((network_id, provider_id)) == orders:
            return None
        self._searched[network_id, provider_id] = orders
        with timed("skyway_dispatch_duration_seconds", "time of a search for a better order"):
            outcome = await self._improve(fleet, world, times)
        _count(outcome)
        return outcome

    async def _fleet(self, network_id: NetworkId, provider_id: ProviderId, times: Times) -> Fleet:
        async with self.db.read() as connection:
            records = await store.open_missions_of(connection, network_id, provider_id)
            drone_ids = sorted({each.drone_id for each in records})
            held = await held_among(connection, drone_ids, now_ms=times.now_ms)
            links = await links_to(connection, drone_ids)
        fleet = fleet_of(records, links, left_out=held, times=times)
        if not _can_improve(fleet):
            return fleet
        # A drone that is withdrawn finishes its mission, and gets no other one.
        withdrawn = await self._withdrawn([*fleet.calendars])
        return fleet.only(fleet.calendars.keys() - withdrawn)

    async def _withdrawn(self, drone_ids: list[DroneId]) -> frozenset[DroneId]:
        asked = OutOfServiceQuery(drone_ids=tuple(drone_ids[:MOST_DRONES]))
        answer = await self.registry.call(
            "POST", OUT_OF_SERVICE, body=asked, answer=OutOfServiceAnswer
        )
        return frozenset((*answer.drone_ids, *drone_ids[MOST_DRONES:]))

    async def _improve(self, fleet: Fleet, world: World, times: Times) -> str:
        found = await self._found(fleet, world, times)
        if found is None:
            return "failed"
        changed = {each for each, order in found.items() if order != fleet.orders[each]}
        if not changed:
            return "kept"
        if await self._breaks_refusals(fleet, found):
            return "no plan"
        outcome = await self._try(fleet.only(changed), found, world, times)
        others = {each.drone_id for each in fleet.waiting} - changed
        if outcome in _FOR_PADS and others:
            # The standbys of all other drones make room for the services too.
            outcome = await self._try(fleet.only(changed | others), found, world, times)
        return outcome

    async def _try(self, affected: Fleet, orders: Orders, world: World, times: Times) -> str:
        """Plan the missions of these drones in this order, and adopt it if it is better."""
        moved = await plan_orders(self.solver, world, affected, orders, times=times)
        if isinstance(moved, NoTrip):
            log.info("better order has no plan", extra={"code": moved.code, "detail": moved.detail})
            return "no plan"
        waiting = {each.mission_id: each for each in affected.waiting}
        judgement = judge(
            (
                (waiting[one.record.mission_id], one.record)
                for each in moved.values()
                for one in each
            ),
            tolerance_s=self.terms.tolerance_s,
        )
        if not judgement.is_better:
            return "promise" if judgement.late else "no gain"
        return await self._adopt(BetterOrder(affected, world, moved), judgement, times)

    async def _found(self, fleet: Fleet, world: World, times: Times) -> Orders | None:
        """The order that the search proposes; None if it fails."""
        skyway = world.skyway
        async with self.db.read() as connection:
            held = await booked_everywhere(connection, skyway.network_id, moment_ms=times.now_ms)
        fields = fleet_problem(
            fleet, world, held=held, times=times, tolerance_s=self.terms.tolerance_s
        )
        search = Search(
            skyway.network_id, skyway.version, fields, self.terms.budget_s, seed=times.now_ms
        )
        try:
            found = await self.search.find(search, skyway.network)
        except SearchFailed as error:
            log.warning("search for a better order failed", extra={"reason": str(error)})
            return None
        about = "processor seconds of searches for a better order"
        count("skyway_dispatch_processor_seconds", about, found.processor_s)
        return found.orders if found.is_complete else fleet.orders

    async def _breaks_refusals(self, fleet: Fleet, orders: Orders) -> bool:
        """Whether a mission would go to a drone that has refused its delivery."""
        again = {
            each.mission_id: each.mission.delivery_id
            for each in fleet.waiting
            if each.mission.attempt > 1
        }
        if not again:
            return False
        async with self.db.read() as connection:
            refusals = await store.refusals_of(connection, {*again.values()})
        return any(
            (again[each], drone_id) in refusals
            for drone_id, order in orders.items()
            for each in order
            if each in again
        )

    async def _adopt(self, better: BetterOrder, judgement: Judgement, times: Times) -> str:
        reach_ms = moment_to_ms(self.clock.now()) + self._ms(_REACH_S)
        if better.first_start_ms < reach_ms:
            return "outdated"
        try:
            async with self.db.write() as tx:
                is_saved = await adopt(tx, better, times=times, clock=self.clock, mint=self.mint)
                if is_saved:
                    await store.note_better_order(
                        tx,
                        better.provider_id,
                        moves=judgement.moves,
                        saved_s=judgement.saved_s,
                        at_ms=reach_ms,
                    )
        except RowRefused as taken:
            log.info("better order taken", extra={"by": taken.constraint})
            return "taken"
        if not is_saved:
            return "outdated"
        self.calendars.set()
        about = "seconds by which adopted orders deliver earlier"
        count("skyway_dispatch_saved_seconds", about, judgement.saved_s)
        log.info(
            "better order adopted",
            extra={
                "missions": len(better.fleet.waiting),
                "moves": judgement.moves,
                "saved_s": round(judgement.saved_s),
            },
        )
        return "adopted"

    def _times(self) -> Times:
        fleet_s, wall_s = _SETTLED_S
        now_ms = moment_to_ms(self.clock.now())
        ahead_ms = self._ms((fleet_s, wall_s + 2 * self.terms.budget_s))
        return Times(now_ms, now_ms + ahead_ms, hand_over_time_ms(self.clock))

    def _ms(self, span: tuple[float, float]) -> int:
        fleet_s, wall_s = span
        margin = fleet_margin(self.clock, fleet_s=fleet_s, wall_s=wall_s)
        return round(margin.total_seconds() * 1000)


def _can_improve(fleet: Fleet) -> bool:
    """Whether there is something to exchange."""
    waiting = len(fleet.waiting)
    return 2 <= waiting <= _MOST_WAITING or (waiting == 1 and len(fleet.calendars) > 1)


def _count(outcome: str) -> None:
    count("skyway_dispatch_runs", "searches for a better order", outcome=outcome)
