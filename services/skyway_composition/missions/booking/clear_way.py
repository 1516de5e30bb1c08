"""Finds a sooner delivery that only the standbys of other drones prevent, and makes them give way.

The standby of a QUEUED mission is planned again, and changes in the transaction that books. The
drone of a mission that was sent is asked, and may answer within a short time. Standbys give way to
a service, never to another standby.
"""

import asyncio
from collections.abc import Awaitable, Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

from skyway.contracts.flight_step import DeliverStep, PickUpStep, ReturnStep
from skyway.contracts.mission import BookMissions
from skyway.contracts.quote import KeepOffer
from skyway.delivery.plan import Recharge, Wait
from skyway.ids import DroneId, MissionId
from skyway.runtime.sql.database import Tx
from skyway.scheduling.giving_way import WORTH_MS, YieldingStandby, widened
from skyway.scheduling.trip import NOTHING_TO_DELIVER, BookedPad, Trip
from skyway_composition.context import Context
from skyway_composition.margins import GIVES_WAY_LONGER, REACHES
from skyway_composition.missions.booking.standby_store import unanswered, yielding_standbys
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.standby import (
    restore_pads,
    standby_steps,
    trip_with_other_standby,
    with_standby_of,
)
from skyway_composition.missions.mission.step_store import replace_steps, steps_of
from skyway_composition.missions.replanning.give_way import StandbyRequests
from skyway_composition.pads.store import hold
from skyway_composition.planning.offer import Limits, Offer, Offers
from skyway_composition.planning.world import World


@dataclass(frozen=True, slots=True)
class MovedStandby:
    """A QUEUED mission as it was read, the last of its drone, and its trip with another standby."""

    standby: YieldingStandby
    record: MissionRecord
    trip: Trip

    @property
    def calendar_version(self) -> int:
        """The number of its drone's calendar when the standby was found."""
        return self.standby.calendar_version

    @property
    def drone_id(self) -> DroneId:
        """The drone of the mission."""
        return self.record.drone_id

    @property
    def pads(self) -> tuple[BookedPad, ...]:
        """The pads that the mission holds before or after."""
        return (*self.standby.pads, *self.trip.booked_pads)


async def move_standbys(tx: Tx, moves: Iterable[MovedStandby], world: World) -> None:
    """Give these missions their new standbys.

    The links of their drones, with unchanged calendars, and the stations of their pads are locked.

    Raises
    ------
    RowRefused
        Another mission holds one of the pads.
    """
    for each in moves:
        await _move(tx, each, world)


async def _move(tx: Tx, moved: MovedStandby, world: World) -> None:
    record, trip = moved.record, moved.trip
    steps = [each.step for each in await steps_of(tx.connection, record.mission_id)]
    first_step = 1 + max(
        each.step_id for each in steps if isinstance(each, PickUpStep | DeliverStep | ReturnStep)
    )
    replacement = standby_steps(record, trip, world, first_step=first_step)
    await replace_steps(tx, record.mission_id, replacement, first_step=first_step, revision=1)
    await hold(tx, record.mission_id, trip.booked_pads)
    mission = with_standby_of(record.mission, trip, revision=1)
    await store.save_all(tx, [record.with_mission(mission)])
    await restore_pads(tx, record.drone_id)


#: How long a booking waits for the answers of drones, and how often it looks, seconds of wall time.
#: Bookings behind it wait too. Our own choice.
_ANSWERS_WITHIN_S: Final = 1.0
_LOOKS_EVERY_S: Final = 0.05

#: A request without an offer or deadline is looked at this far ahead.
_HORIZON_MS: Final = 24 * 3600 * 1000

#: Searches of one booking; then it books what is free. Our own choice.
_MOST_SEARCHES: Final = 3

#: Stands for the mission of the offer that is being planned: its pads count as reserved.
_UNBOOKED_MISSION: Final = MissionId("")

#: Plans the offers of a booking in a world, within limits.
PlanOffers = Callable[[World, Limits], Awaitable[Offers]]

#: Lets this many seconds of wall time pass.
Pause = Callable[[float], Awaitable[None]]


@dataclass(frozen=True, slots=True)
class Blocked:
    """A booking whose best offer may have to wait for standbys. `best` is None without an offer."""

    asked: BookMissions | KeepOffer
    world: World
    begins_ms: int
    limits: Limits
    offers: Offers

    @property
    def best(self) -> Offer | None:
        """The best offer among the pads that are free."""
        return self.offers.ranked[0] if self.offers.ranked else None

    @property
    def may_be_sooner(self) -> bool:
        """Whether free pads can help: the offer charges or waits, or there is none for now."""
        if not isinstance(self.asked, BookMissions):
            return False
        if self.best is None:
            return any(each.is_temporary for each in self.offers.reasons)
        is_whole = self.best.packages == len(self.asked.request.packages)
        return is_whole and any(
            isinstance(step, Recharge | Wait)
            for part in self.best.parts
            for step in part.trip.plan.steps
        )

    @property
    def until_ms(self) -> int:
        """Until when standbys may be in its way."""
        if self.best is not None:
            return _served_ms(self.best)
        latest_ms = self.limits.latest_ms
        return self.begins_ms + _HORIZON_MS if latest_ms is None else latest_ms

    @property
    def sooner(self) -> Limits:
        """The limits of an offer for which standbys give way."""
        if self.best is None:
            return self.limits
        sooner_ms = _served_ms(self.best) - WORTH_MS
        latest_ms = self.limits.latest_ms
        return replace(
            self.limits,
            latest_ms=sooner_ms if latest_ms is None else min(latest_ms, sooner_ms),
            is_whole=True,
        )


@dataclass(frozen=True, slots=True)
class ClearedWay:
    """An offer that can be booked together with new standbys of QUEUED missions.

    Without an offer, drones have been asked: plan again with the pads that are free now.
    """

    offer: Offer | None = None
    moves: tuple[MovedStandby, ...] = ()


@dataclass(slots=True)
class WaySearch:
    """Clears the way of one booking; drones are asked once."""

    context: Context
    pause: Pause = asyncio.sleep
    _has_asked: bool = False
    _searches: int = 0

    async def clear(self, blocked: Blocked, plan: PlanOffers) -> ClearedWay | None:
        """How a sooner offer can be booked; None if there is no way, or no standby prevents it."""
        if self._searches >= _MOST_SEARCHES or not blocked.may_be_sooner:
            return None
        standbys = await self._standbys(blocked)
        if not standbys:
            return None
        self._searches += 1
        gap_ms = round(blocked.world.skyway.settings.pad_gap_s * 1000)
        from_ms = self.context.now_ms + REACHES.ms(self.context.clock)
        kept = {
            each.mission_id: each.kept_pads(not_before_ms=from_ms, gap_ms=gap_ms)
            for each in standbys
        }
        sooner = await plan(blocked.world.instead(kept), blocked.sooner)
        if not sooner.ranked:
            return None
        best = sooner.ranked[0]
        needed = _service_pads(best)
        own = {part.candidate.drone_id for part in best.parts}
        in_the_way = [
            each for each in standbys if each.drone_id not in own and each.is_in_the_way(needed)
        ]
        free_longer = widened(needed, by_ms=GIVES_WAY_LONGER.ms(self.context.clock))
        to_ask = [each for each in in_the_way if each.is_sent]
        if to_ask:
            return await self._ask(to_ask, free_longer)
        return await self._move(blocked, plan, in_the_way, free_longer)

    async def _standbys(self, blocked: Blocked) -> list[YieldingStandby]:
        holders = blocked.world.pads.holders(from_ms=blocked.begins_ms, until_ms=blocked.until_ms)
        if not holders:
            return []
        async with self.context.db.read() as connection:
            found = await yielding_standbys(connection, holders, now_ms=self.context.now_ms)
        return [each for each in found if not (each.is_sent and self._has_asked)]

    async def _ask(
        self, standbys: Sequence[YieldingStandby], needed: Sequence[BookedPad]
    ) -> ClearedWay | None:
        """Ask these drones one after the other, and wait for their answers."""
        self._has_asked = True
        requests = StandbyRequests(self.context)
        asked = [each.mission_id for each in standbys if await requests.ask(each, needed)]
        if not asked:
            return None
        for _ in range(round(_ANSWERS_WITHIN_S / _LOOKS_EVERY_S)):
            await self.pause(_LOOKS_EVERY_S)
            async with self.context.db.read() as connection:
                if not await unanswered(connection, asked):
                    break
        return ClearedWay()

    async def _move(
        self,
        blocked: Blocked,
        plan: PlanOffers,
        standbys: Sequence[YieldingStandby],
        needed: Sequence[BookedPad],
    ) -> ClearedWay | None:
        """Plan other standbys of QUEUED missions, and then the offer beside them."""
        moves: list[MovedStandby] = []
        for each in standbys:
            pads = {_UNBOOKED_MISSION: needed, **_pads_after(moves)}
            world = blocked.world.instead(pads).without([each.mission_id])
            moved = await self._moved(each, world)
            if moved is None:
                return None
            moves.append(moved)
        if not moves:
            return None
        offers = await plan(blocked.world.instead(_pads_after(moves)), blocked.sooner)
        moving = {each.standby.drone_id for each in moves}
        # A drone whose standby moves is free at another time and place: its offers do not hold.
        others = [
            offer
            for offer in offers.ranked
            if moving.isdisjoint(part.candidate.drone_id for part in offer.parts)
        ]
        return ClearedWay(others[0], tuple(moves)) if others else None

    async def _moved(self, standby: YieldingStandby, world: World) -> MovedStandby | None:
        async with self.context.db.read() as connection:
            record = await store.get(connection, standby.mission_id, provider_id=None)
        if record is None or record.planned_in != world.present or not record.stays:
            return None
        trip = await trip_with_other_standby(self.context.solver, world, record)
        return MovedStandby(standby, record, trip) if isinstance(trip, Trip) else None


def _served_ms(offer: Offer) -> int:
    """The planned end of an offer's last hand-over."""
    return offer.begins_ms + round(offer.values.time_s * 1000)


def _service_pads(offer: Offer) -> tuple[BookedPad, ...]:
    """The pads that an offer needs until its last hand-overs, without its own standbys."""
    return tuple(
        pad
        for part in offer.parts
        for pad in replace(part.trip, home_plan=NOTHING_TO_DELIVER, home_recharge=None).booked_pads
    )


def _pads_after(moves: Sequence[MovedStandby]) -> dict[MissionId, tuple[BookedPad, ...]]:
    return {each.record.mission_id: each.trip.booked_pads for each in moves}
