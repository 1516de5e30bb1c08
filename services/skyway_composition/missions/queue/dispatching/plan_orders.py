"""Plans the missions of a fleet in another order, with the exact planner and real pads.

First the services, in the order of their starts, each around the pads of the services before. Then
the standby of each drone's last mission, around the pads of all services.
"""

import heapq
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from skyway.delivery.plan import Plan
from skyway.errors import InvalidProblem
from skyway.ids import DroneId, MissionId, PackageId
from skyway.planner.problem import Problem
from skyway.runtime.errors import ServiceUnavailable
from skyway.scheduling.standby import StandbyChoice, home_start_ms
from skyway.scheduling.stays import Slot, slot_after
from skyway.scheduling.trip import (
    NOTHING_TO_DELIVER,
    BookedPad,
    NoTrip,
    Trip,
    no_plan,
    shortened_trip,
)
from skyway_composition.context import Context
from skyway_composition.missions.mission.from_trip import flown_by, replanned_in_queue
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.queue.dispatching.fleet import Calendar, Fleet, Moments, Orders
from skyway_composition.missions.queue.plan_queue import (
    Moved,
    deadline_ms,
    etas_ms,
    latest_ms,
    problem_of,
    with_promises,
)
from skyway_composition.planning.find_trip import way_home
from skyway_composition.planning.problem_for import Standing
from skyway_composition.planning.world import World

#: What it costs to give a mission to another drone, in seconds of one delivery. The same is the
#: least that a change must save. Our own choice: plans that people look at should seldom change.
MOVE_S: Final = 60.0

#: What a kWh costs, in seconds of one delivery. Our own choice: a flight that a merge saves (about
#: 0.1 kWh) is worth a little more than `MOVE_S`. Flights charge a kWh in about four hours.
ENERGY_S_PER_KWH: Final = 1_000.0

_J_PER_KWH: Final = 3.6e6


@dataclass(frozen=True, slots=True)
class Judgement:
    """What a change saves, and how many missions move.

    `saved_s` are seconds of a STANDARD delivery, and `saved_j` joules of flights; each is negative
    if the change costs some. A mission moves to another drone, or its packages to another mission.
    `late` are the drones that would deliver later than allowed.
    """

    saved_s: float
    saved_j: float
    moves: int
    late: frozenset[DroneId]

    @property
    def is_better(self) -> bool:
        """Whether the change saves more than its price, and keeps all promises."""
        saved_s = self.saved_s + ENERGY_S_PER_KWH * self.saved_j / _J_PER_KWH
        return not self.late and saved_s > MOVE_S * max(1, self.moves)


def judge(
    changes: Iterable[tuple[MissionRecord, MissionRecord]],
    *,
    tolerance_s: float,
    guests: Sequence[MissionRecord] = (),
) -> Judgement:
    """The judgement on missions that change from the first to the second record of each pair.

    The `guests` end, because other missions carry their packages.
    """
    saved_s, moves, late = 0.0, len(guests), set[DroneId]()
    saved_j = sum(_energy_j(each) for each in guests)
    for before, after in changes:
        earlier, later = etas_ms(before), etas_ms(after)
        latest = latest_ms(before, tolerance_s=tolerance_s)
        # Packages that join the mission have no promise yet.
        if any(later[package_id] > at_ms for package_id, at_ms in latest.items()):
            late.add(after.drone_id)
        saved_ms = _ends_ms(before, earlier) - _ends_ms(before, later)
        saved_s += before.request.weight * saved_ms / 1000
        saved_j += _energy_j(before) - _energy_j(after)
        moves += before.drone_id != after.drone_id
    return Judgement(saved_s, saved_j, moves, frozenset(late))


def _energy_j(record: MissionRecord) -> float:
    """The energy of the flights until the last hand-over."""
    return record.mission.plan.energy_j or 0.0


def _ends_ms(record: MissionRecord, etas_ms: Mapping[PackageId, int]) -> int:
    """The sum of the last arrivals of the deliveries that the mission flies for."""
    own = {each.package_id for each in record.mission.packages}
    shares = [own & {*each.packages} for each in record.shares] or [own]
    return sum(max(etas_ms[each] for each in share) for share in shares if share)


_TOO_LATE: Final = NoTrip(
    "NO_PLAN_FOUND", "planning lasted until missions of the order could begin", is_temporary=True
)

_NO_PLACE: Final = NoTrip("BUSY", "a drone has no place for its mission", is_temporary=True)


@dataclass(frozen=True, slots=True)
class NoOrder:
    """Why an order has no plan, and the drones whose missions have none."""

    reason: NoTrip
    drone_ids: frozenset[DroneId] = frozenset()


@dataclass(slots=True)
class _Row:
    """The missions of one drone that are planned so far, and those that follow."""

    calendar: Calendar
    following: list[MissionRecord]
    planned: list[Moved] = field(default_factory=list)

    def slot(self, times: Moments, *, from_ms: int) -> Slot | None:
        """Where and when the next mission can begin, at `from_ms` or later."""
        if self.planned:
            stays = self.planned[-1].record.stays
            return slot_after(stays, not_before_ms=from_ms, hand_over_ms=times.hand_over_ms)
        return self.calendar.slot(not_before_ms=from_ms, times=times)


@dataclass(slots=True)
class OrderPlanner:
    """Plans an order in a world in which the waiting missions of the fleet have no pads."""

    context: Context
    world: World
    times: Moments
    tolerance_s: float
    _pads: dict[MissionId, Sequence[BookedPad]] = field(default_factory=dict)

    async def plan(
        self, fleet: Fleet, orders: Orders, *, instead: Iterable[MissionRecord]
    ) -> dict[DroneId, tuple[Moved, ...]] | NoOrder:
        """The missions of these drones with their new plans; why there is none for some mission.

        `orders` names waiting missions of the fleet, each at most once.
        """
        missions = {each.mission_id: each for each in (*fleet.waiting, *instead)}
        rows = {
            drone_id: _Row(calendar, [missions[each] for each in orders[drone_id]])
            for drone_id, calendar in fleet.calendars.items()
        }
        ready: list[tuple[int, DroneId]] = []
        for drone_id, row in rows.items():
            self._push(ready, drone_id, row)
        while ready:
            if self._is_too_late:
                return NoOrder(_TOO_LATE)
            _, drone_id = heapq.heappop(ready)
            reason = await self._add_next(rows[drone_id])
            if reason is not None:
                return NoOrder(reason, frozenset({drone_id}))
            self._push(ready, drone_id, rows[drone_id])
        if without := frozenset(drone_id for drone_id, row in rows.items() if row.following):
            return NoOrder(_NO_PLACE, without)
        last = [row for row in rows.values() if row.planned]
        for row in sorted(last, key=lambda each: each.planned[-1].record.served_ms):
            if self._is_too_late:
                return NoOrder(_TOO_LATE)
            reason = await self._add_standby(row)
            if reason is not None:
                return NoOrder(reason, frozenset({row.calendar.drone_id}))
        return {drone_id: tuple(row.planned) for drone_id, row in rows.items()}

    @property
    def _is_too_late(self) -> bool:
        """Whether missions that may move would have to be sent already."""
        return self.context.now_ms > self.times.settled_ms

    def _push(self, ready: list[tuple[int, DroneId]], drone_id: DroneId, row: _Row) -> None:
        if not row.following:
            return
        slot = row.slot(self.times, from_ms=row.following[0].earliest_ms)
        if slot is not None:
            heapq.heappush(ready, (slot.at_ms, drone_id))

    async def _add_next(self, row: _Row) -> NoTrip | None:
        """Plan the service of the drone's next mission; why there is none."""
        following = row.following.pop(0)
        from_ms = following.earliest_ms - self.times.hand_over_ms
        if row.planned and row.planned[-1].record.served_ms < from_ms:
            # The drone charges before this mission, so the standby is planned first.
            reason = await self._add_standby(row)
            if reason is not None:
                return reason
        record = flown_by(following, row.calendar.candidate)
        found = await self._service(row, record)
        if isinstance(found, NoTrip):
            return found
        plan, slot = found
        if row.planned:
            self._shorten_last(row, slot.at_ms - self.times.hand_over_ms)
        trip = Trip(
            start_ms=slot.at_ms,
            plan=plan,
            home_start_ms=home_start_ms(plan, start_ms=slot.at_ms),
            home_plan=NOTHING_TO_DELIVER,
            home_recharge=None,
            pad_gap_ms=round(self.world.skyway.settings.pad_gap_s * 1000),
        )
        self._add(row, record, trip, slot)
        return None

    async def _service(self, row: _Row, record: MissionRecord) -> tuple[Plan, Slot] | NoTrip:
        """The plan of the drone's next service, and where, when and with what charge it begins."""
        world, latest_ms = self._world_of(row), deadline_ms(record)
        reason = _NO_PLACE
        # A mission with windows may have to begin sooner than now planned.
        for from_ms in sorted({record.earliest_ms, record.allowed_from_ms}, reverse=True):
            slot = row.slot(self.times, from_ms=from_ms)
            if slot is None:
                continue
            problem = problem_of(world, record, slot, from_ms=0, latest_ms=latest_ms)
            plan = await self.context.solver.compose_in(world, problem)
            if plan.is_flyable:
                return await self._in_time(world, problem, plan, record, slot), slot
            reason = no_plan(plan)
        return reason

    async def _in_time(
        self, world: World, problem: Problem, plan: Plan, record: MissionRecord, slot: Slot
    ) -> Plan:
        """The earliest plan that keeps the promises of several packages; without one this plan."""
        due = with_promises(
            problem, plan, record, start_ms=slot.at_ms, tolerance_s=self.tolerance_s
        )
        kept = plan if due is None else await self.context.solver.compose_in(world, due)
        return kept if kept.is_flyable else plan

    async def _add_standby(self, row: _Row) -> NoTrip | None:
        """Plan the standby of the last mission that is planned; why there is none."""
        moved = row.planned.pop()
        record, served = moved.record, moved.record.stays[0]
        candidate = record.candidate
        trip = await way_home(
            self.context.solver,
            self._world_of(row, record.mission_id),
            moved.trip.plan,
            standing=Standing(candidate.planned_model, served.soc_from, served.station_id),
            standby=StandbyChoice.of(candidate),
            start_ms=moved.trip.start_ms,
        )
        if isinstance(trip, NoTrip):
            return trip
        self._add(row, record, trip, record.start)
        return None

    def _shorten_last(self, row: _Row, until_ms: int) -> None:
        """End the last standby when the next mission begins."""
        moved = row.planned.pop()
        self._add(row, moved.record, shortened_trip(moved.trip, until_ms), moved.record.start)

    def _add(self, row: _Row, record: MissionRecord, trip: Trip, slot: Slot) -> None:
        slot = replace(slot, at_ms=trip.start_ms)
        moved = replanned_in_queue(record, trip, slot, world=self.world)
        row.planned.append(Moved(moved, trip))
        self._pads[record.mission_id] = trip.booked_pads

    def _world_of(self, row: _Row, mission_id: MissionId | None = None) -> World:
        """The world with the pads of all planned missions, without those of this drone."""
        calendar = row.calendar
        own = [each.record.mission_id for each in row.planned]
        own += [each.mission_id for each in calendar.kept]
        own += [] if calendar.live is None else [calendar.live.mission_id]
        own += [] if mission_id is None else [mission_id]
        free = self.world.instead(self._pads).without(own)
        return free.for_drone(calendar.candidate.learned)


async def plan_orders(
    context: Context,
    world: World,
    fleet: Fleet,
    orders: Orders,
    *,
    times: Moments,
    tolerance_s: float,
    instead: Iterable[MissionRecord] = (),
) -> dict[DroneId, tuple[Moved, ...]] | NoOrder:
    """The fleet's missions in this order with their new plans; why some mission has none.

    No package comes later than its promise by more than `tolerance_s` if another order of a
    mission's stops, or other recharges, can avoid it.
    `instead` are missions of the fleet with other packages than now. Missions that the order leaves
    out have no pads. Planning stops when the first missions that may move could begin.
    """
    free = world.without([each.mission_id for each in fleet.waiting])
    try:
        planner = OrderPlanner(context, free, times, tolerance_s)
        return await planner.plan(fleet, orders, instead=instead)
    except InvalidProblem as error:
        # A newer version of the network has hand-overs that are longer than a window.
        return NoOrder(NoTrip("WINDOW_MISSED", str(error), is_temporary=False))
    except ServiceUnavailable as error:
        return NoOrder(NoTrip("NO_PLAN_FOUND", str(error), is_temporary=True))
