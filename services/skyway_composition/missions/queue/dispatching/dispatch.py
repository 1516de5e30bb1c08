"""The dispatcher: it reads a fleet, searches, plans exactly, judges, and adopts a better order."""

import asyncio
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final, Literal

from skyway.delivery.offer import Tariff
from skyway.dispatch.problem import MAX_DRONES
from skyway.ids import DroneId, MissionId, NetworkId, ProviderId
from skyway.runtime.errors import RowRefused
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.metrics import count, timed
from skyway.runtime.sql.database import Tx
from skyway_composition.calendar.attempts import Change, commit
from skyway_composition.context import Context
from skyway_composition.links.store import held_among, links_to
from skyway_composition.margins import ANOTHER_ORDER, HAND_OVER, REACHES
from skyway_composition.missions.queue import store
from skyway_composition.missions.queue.ask_registry import exchanging_tariffs, out_of_service
from skyway_composition.missions.queue.dispatching.adopt import BetterOrder, adopt
from skyway_composition.missions.queue.dispatching.fleet import (
    Fleet,
    Moments,
    Orders,
    fleet_of,
    free_to_take_off,
)
from skyway_composition.missions.queue.dispatching.fleet_problem import fleet_problem
from skyway_composition.missions.queue.dispatching.idle_drones import idle_drones
from skyway_composition.missions.queue.dispatching.merger import (
    MergedOrder,
    may_merge,
    merged_order,
)
from skyway_composition.missions.queue.dispatching.plan_orders import NoOrder, plan_orders
from skyway_composition.missions.queue.dispatching.search_process import (
    Search,
    SearchFailed,
    SearchProcess,
)
from skyway_composition.missions.queue.plan_queue import has_promise_to_make
from skyway_composition.pads.store import booked_everywhere
from skyway_composition.planning.world import World

log = logging.getLogger(__name__)

#: The most waiting missions of one search; a fleet with more keeps its order. Our own choice.
_MOST_WAITING: Final = 500

#: Why a fleet keeps its order: nothing to search for, the search has failed or found nothing
#: better, or its order has no exact plan (at present or at all), breaks a promise or an
#: agreed price, or saves too little.
NotBetter = Literal["unsearched", "failed", "kept", "no plan now", "no plan", "promise", "no gain"]

#: After these a search has been in vain. So many searches in vain, each with other random numbers,
#: are made until the calendars of the fleet change. Our own choice.
_IN_VAIN: Final = ("kept", "no plan", "promise", "no gain")
_MOST_IN_VAIN: Final = 4

#: How often an order is searched until each of its missions has a plan that breaks no promise. Our
#: own choice.
_MOST_SEARCHES: Final = 3


#: The drones of some providers in one network that are searched together.
Searched = tuple[NetworkId, *tuple[ProviderId, ...]]


@dataclass(frozen=True, slots=True)
class NoGain:
    """Why an order is not better, and because of which drones; the others may have a better one."""

    why: NotBetter
    drone_ids: frozenset[DroneId] = frozenset()


@dataclass(frozen=True, slots=True)
class DispatchTerms:
    """How often the dispatcher looks, how long it searches, and how late a promise may get.

    Wall seconds, processor seconds and fleet seconds. With `every_s` 0 there is no dispatcher.
    """

    every_s: float
    budget_s: float
    tolerance_s: float


@dataclass(frozen=True, slots=True)
class OrderFinder:
    """Finds better orders.

    A fleet that was searched in vain several times waits until its calendars or idle drones change.
    """

    context: Context
    search: SearchProcess
    registry: ServiceClient
    terms: DispatchTerms
    #: The most waiting missions of providers that are searched together.
    most_together: int = _MOST_WAITING
    #: The orders for which none was better, and how often they were searched.
    _in_vain: dict[Searched, tuple[Orders, int]] = field(default_factory=dict)

    async def fleets(self) -> list[Searched]:
        """The networks and providers in which missions may move; all others are forgotten.

        Providers that exchange deliveries in a network with `joint_dispatch` are searched together,
        unless too many missions wait for one search.
        """
        async with self.context.db.read() as connection:
            found = await store.waiting_fleets(connection, after_ms=self._times().last_kept_ms)
        fleets: dict[Searched, None] = {}
        for network_id, waiting in found.items():
            exchanging = await self._exchanging(network_id)
            if sum(waiting.get(each, 0) for each in exchanging) > self.most_together:
                exchanging = {}
            for provider_id in waiting:
                together = sorted(exchanging) if provider_id in exchanging else [provider_id]
                fleets[network_id, *together] = None
        for gone in self._in_vain.keys() - fleets.keys():
            del self._in_vain[gone]
        return [*fleets]

    async def _exchanging(self, network_id: NetworkId) -> Mapping[ProviderId, Tariff]:
        """The tariffs of the providers whose drones are planned together in a network."""
        skyway = await self.context.networks.current(network_id)
        return await exchanging_tariffs(self.registry) if skyway.settings.joint_dispatch else {}

    async def find(
        self, network_id: NetworkId, *provider_ids: ProviderId
    ) -> BetterOrder | NotBetter:
        """A better order of the missions that wait in these providers' calendars, or why none."""
        times = self._times()
        skyway = await self.context.networks.current(network_id)
        world = await World.of(skyway, self.context.db, after_ms=times.now_ms)
        fleet = await self._fleet(network_id, provider_ids, times)
        if len(provider_ids) > 1:
            fleet = replace(fleet, tariffs=await self._exchanging(network_id))
        fleet = free_to_take_off(fleet, world, times)
        # Calendars of an earlier network or closure are planned again first, and promises that have
        # to be firm by now become firm, without this search.
        has_promises = any(has_promise_to_make(each, now_ms=times.now_ms) for each in fleet.waiting)
        if not _has_waiting(fleet) or has_promises or not fleet.is_planned_in(world.present):
            return "unsearched"
        idle = await idle_drones(self.context, self.registry, fleet, world, times)
        calendars = {**fleet.calendars, **free_to_take_off(idle, world, times).calendars}
        fleet = replace(fleet, calendars=calendars).only([*calendars][:MAX_DRONES])
        orders, in_vain = self._in_vain.get((network_id, *provider_ids), (None, 0))
        if orders != fleet.orders:
            in_vain = 0
        if in_vain == _MOST_IN_VAIN or not _can_improve(fleet):
            return "unsearched"
        found = await self._better(fleet, world, times)
        if found in _IN_VAIN:
            self._in_vain[network_id, *provider_ids] = fleet.orders, in_vain + 1
        return found

    async def _better(self, fleet: Fleet, world: World, times: Moments) -> BetterOrder | NotBetter:
        """A better order of this fleet, or why none."""
        pools, outcome = True, None
        for _ in range(_MOST_SEARCHES):
            order = await self._searched_order(fleet, world, times, pools=pools)
            if order is None:
                return "failed"
            found = await self._planned(fleet, order, world, times)
            if isinstance(found, BetterOrder):
                return found
            # What has no plan now may have one later, so the fleet is searched again then.
            outcome = outcome if outcome == "no plan now" else found.why
            if order.merges:
                # An order without new shared trips may be better than the present one.
                pools = False
                continue
            # The drones that break the order keep their calendars in the next search.
            fleet = fleet.only(fleet.calendars.keys() - found.drone_ids)
            if not found.drone_ids or not _can_improve(fleet):
                break
        return outcome or "kept"

    async def _fleet(
        self, network_id: NetworkId, provider_ids: Sequence[ProviderId], times: Moments
    ) -> Fleet:
        async with self.context.db.read() as connection:
            found = await store.open_missions_of(connection, network_id, provider_ids)
            drone_ids = sorted(found.versions)
            held = await held_among(connection, drone_ids, now_ms=times.now_ms)
            links = await links_to(connection, drone_ids)
        fleet = fleet_of(found.records, links, versions=found.versions, left_out=held, times=times)
        if not _has_waiting(fleet):
            return fleet
        # All other drones keep the missions that they have, and get no others.
        fleet = fleet.only([*fleet.calendars][:MAX_DRONES])
        withdrawn = await out_of_service(self.registry, fleet.calendars)
        return fleet.only(fleet.calendars.keys() - {*withdrawn.drone_ids, *withdrawn.due_drone_ids})

    async def _searched_order(
        self, fleet: Fleet, world: World, times: Moments, *, pools: bool
    ) -> MergedOrder | None:
        """The order that the search proposes, with shared trips if `pools`; None if it fails."""
        skyway = world.skyway
        async with self.context.db.read() as connection:
            held = await booked_everywhere(connection, skyway.network_id, moment_ms=times.now_ms)
        fields = fleet_problem(
            fleet,
            world,
            held=held,
            times=times,
            tolerance_s=self.terms.tolerance_s,
            may_merge=await self._may_merge(fleet) if pools else (),
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
        if not found.is_complete:
            return MergedOrder(fleet.orders)
        return merged_order(fleet, found.orders, found.shared)

    async def _may_merge(self, fleet: Fleet) -> frozenset[MissionId]:
        """The waiting missions that may share a trip with others, if there are some."""
        found = {
            each.mission_id: each.mission.delivery_id for each in fleet.waiting if may_merge(each)
        }
        if len(found) < 2:
            return frozenset()
        async with self.context.db.read() as connection:
            split = await store.with_several_trips(connection, {*found.values()})
        return frozenset(each for each, of in found.items() if of not in split)

    async def _planned(
        self, fleet: Fleet, order: MergedOrder, world: World, times: Moments
    ) -> BetterOrder | NoGain:
        """The order with exact plans, if it is better."""
        changed = order.changed_from(fleet)
        if not changed:
            return NoGain("kept")
        if refusing := await self._refusing(fleet, order.orders):
            return NoGain("no plan", refusing)
        found = await self._judged(fleet.only(changed), order, world, times)
        others = {each.drone_id for each in fleet.waiting} - changed
        if not isinstance(found, BetterOrder) and others:
            # The standbys of all other drones make room for the services too.
            found = await self._judged(fleet.only(changed | others), order, world, times)
        return found

    async def _judged(
        self, affected: Fleet, order: MergedOrder, world: World, times: Moments
    ) -> BetterOrder | NoGain:
        """The order of these drones with exact plans, if it is better."""
        hosts = [each.host for each in order.merges]
        moved = await plan_orders(
            self.context,
            world,
            affected,
            order.orders,
            instead=hosts,
            times=times,
            tolerance_s=self.terms.tolerance_s,
        )
        if isinstance(moved, NoOrder):
            reason = moved.reason
            about = {"code": reason.code, "detail": reason.detail}
            log.info("better order has no plan", extra=about)
            return NoGain("no plan now" if reason.is_temporary else "no plan", moved.drone_ids)
        better = BetterOrder(affected, world, times, moved, order.merges)
        judgement = better.judged(tolerance_s=self.terms.tolerance_s)
        if broken := judgement.late | better.refusing:
            return NoGain("promise", broken)
        return better if judgement.is_better else NoGain("no gain")

    async def _refusing(self, fleet: Fleet, orders: Orders) -> frozenset[DroneId]:
        """The drones that would get a mission whose delivery they have refused."""
        again = {
            each.mission_id: each.mission.delivery_id
            for each in fleet.waiting
            if each.mission.attempt > 1
        }
        if not again:
            return frozenset()
        async with self.context.db.read() as connection:
            refusals = await store.refusals_of(connection, {*again.values()})
        return frozenset(
            drone_id
            for drone_id, order in orders.items()
            if any((again.get(each), drone_id) in refusals for each in order)
        )

    def _times(self) -> Moments:
        now_ms = self.context.now_ms
        ahead_ms = ANOTHER_ORDER.ms(self.context.clock, more_wall_s=2 * self.terms.budget_s)
        return Moments(now_ms, now_ms + ahead_ms, HAND_OVER.ms(self.context.clock))


def _has_waiting(fleet: Fleet) -> bool:
    """Whether missions wait, and not too many for one search."""
    return 1 <= len(fleet.waiting) <= _MOST_WAITING


def _can_improve(fleet: Fleet) -> bool:
    """Whether there is something to exchange."""
    return _has_waiting(fleet) and (len(fleet.waiting) > 1 or len(fleet.calendars) > 1)


@dataclass(frozen=True, slots=True)
class Dispatcher:
    """Exchanges what waits between the drones of a fleet, if the fleet then delivers earlier.

    After an adoption it wakes `calendars`.
    """

    context: Context
    finder: OrderFinder

    async def step(self) -> bool:
        """Step of a loop: look at each fleet once. Always False.

        With many fleets it rests between them, so that searches leave the processors to bookings.
        """
        failures = []
        for fleet in await self.finder.fleets():
            await asyncio.sleep(self.finder.search.rest_s)
            try:
                await self.look_at(*fleet)
            except Exception as error:  # noqa: BLE001 - one fleet must not stop the others
                failures.append(error)
        if failures:
            raise ExceptionGroup("fleets not dispatched", failures)
        return False

    async def look_at(self, network_id: NetworkId, *provider_ids: ProviderId) -> str:
        """Find a better order for one fleet and adopt it; returns the outcome."""
        with timed("skyway_dispatch_duration_seconds", "time of a look at one fleet"):
            found = await self.finder.find(network_id, *provider_ids)
            outcome = await self.adopt(found) if isinstance(found, BetterOrder) else found
        if outcome != "unsearched":
            count("skyway_dispatch_runs", "searches for a better order", outcome=outcome)
        return outcome

    async def adopt(self, better: BetterOrder) -> str:
        """Save a better order, if nothing has changed since; returns the outcome."""
        if better.has_exchanges:
            # A provider may have changed its rule or its tariff, or may be suspended now.
            tariffs = await exchanging_tariffs(self.finder.registry)
            if tariffs != better.fleet.tariffs:
                return "outdated"
        latest_ms = better.first_start_ms - REACHES.ms(self.context.clock)
        lost = await commit(self.context, Change(latest_ms, partial(self._write, better=better)))
        if isinstance(lost, RowRefused):
            log.info("a pad of a better order was taken", extra={"by": lost.constraint})
            return "taken"
        if lost is not None:
            return "outdated"
        judgement = better.judged()
        self.context.calendars.set()
        about = "seconds by which adopted orders deliver earlier"
        count("skyway_dispatch_saved_seconds", about, max(0.0, judgement.saved_s))
        guests = sum(len(each.guests) for each in better.merges)
        if guests:
            about = "deliveries that joined the mission of another one"
            count("skyway_shared_trips", about, guests)
        log.info(
            "better order adopted",
            extra={
                "missions": len(better.fleet.waiting),
                "moves": judgement.moves,
                "guests": guests,
                "saved_s": round(judgement.saved_s),
                "saved_j": round(judgement.saved_j),
            },
        )
        return "adopted"

    async def _write(self, tx: Tx, *, better: BetterOrder) -> None:
        await adopt(self.context, tx, better)
        for provider_id in {before.mission.provider_id for before, _ in better.changes}:
            judgement = better.judged(of=provider_id)
            await store.note_better_order(
                tx,
                provider_id,
                moves=judgement.moves,
                saved_s=judgement.saved_s,
                at_ms=self.context.now_ms,
            )
