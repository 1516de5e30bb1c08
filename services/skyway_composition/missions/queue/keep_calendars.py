"""Looks after the calendars of drones: every QUEUED mission begins, moves, or is given up.

Provisional promises of QUEUED missions become firm in time.

The QUEUED missions of a drone out of service are given up, so that other drones fly them. The
registry knows which drones are in maintenance, and which providers are suspended.

One step looks at each drone whose next mission may begin, no longer fits, or was planned for a
network that has changed since. The transaction that changes a calendar locks the drone's link, and
checks again what was planned with.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from skyway.delivery.qos import QoS
from skyway.ids import DroneId
from skyway.runtime.errors import RowRefused
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.sql.database import Tx
from skyway.scheduling.stays import Slot
from skyway.units import NEVER_MS
from skyway_composition.calendar.attempts import Change, commit
from skyway_composition.calendar.commit import Snapshot
from skyway_composition.context import Context
from skyway_composition.margins import HAND_OVER, PLANS_QUEUE, REACHES, WAITS_FOR_DRONE
from skyway_composition.missions.mission.end import refuse
from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.mission.standby import restore_pads
from skyway_composition.missions.mission.store import queued_of_drone
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.queue import store
from skyway_composition.missions.queue.ask_registry import out_of_service
from skyway_composition.missions.queue.move_queued import (
    drop,
    give_back_pads,
    make_firm,
    move,
    send_next,
    shorten_standby,
)
from skyway_composition.missions.queue.plan_queue import (
    Dropped,
    GiveUp,
    Leave,
    Moved,
    PlanAgain,
    QueuePlanner,
    Send,
    Shorten,
    Times,
    decide,
    has_promise_to_make,
)
from skyway_composition.networks.prepared import PreparedNetwork
from skyway_composition.networks.store import share_current
from skyway_composition.planning.availability import send_ahead_ms
from skyway_composition.planning.world import World

log = logging.getLogger(__name__)

#: A drone's next plan gets this many times the time of its last plan, but at most this many times
#: the usual time. Our own choice.
_TIMES_THE_LAST_PLAN: Final = 2
_MOST_TIMES_THE_USUAL: Final = 32

_NO_PLAN: Final = "its drone has had no plan for it for too long"


@dataclass(frozen=True, slots=True)
class _Calendar:
    """A drone's live mission and its QUEUED missions in order, as read in one transaction."""

    drone_id: DroneId
    version: int
    before: MissionRecord | None
    queued: tuple[MissionRecord, ...]


@dataclass(frozen=True, slots=True)
class Calendars:
    """Keeps the calendars of all drones.

    A plan for an idle drone gets more time when the drone's last plan took long, so that a slow
    machine sends its missions too.
    """

    context: Context
    #: By how much another plan may deliver after a promise, fleet seconds.
    tolerance_s: float
    #: How long the last plan for each drone took, fleet milliseconds.
    _last_plan_took_ms: dict[DroneId, int] = field(default_factory=dict)

    async def step(self) -> bool:
        """Look at the drones whose next mission needs something; True when one has changed."""
        times = self._times()
        async with self.context.db.read() as connection:
            drone_ids = await store.drones_to_look_at(
                connection,
                now_ms=times.now_ms,
                soon_ms=times.now_ms + times.send_ahead_ms,
                hand_over_ms=times.hand_over_ms,
                overdue_ms=times.now_ms - times.longest_wait_ms,
            )
        is_changed, failures = False, []
        for drone_id in drone_ids:
            try:
                is_changed |= await self.look_at(drone_id)
            except RowRefused as taken:
                log.info("pad taken", extra={"drone_id": drone_id, "by": taken.constraint})
            except Exception as error:  # noqa: BLE001 - one calendar must not stop the others
                failures.append(error)
        if failures:
            raise ExceptionGroup("calendars not kept", failures)
        return is_changed

    async def look_at(self, drone_id: DroneId) -> bool:
        """Do what the drone's next mission needs; True if its calendar needs another look."""
        async with self.context.db.read() as connection:
            seen = await queued_of_drone(connection, drone_id)
        if not seen:
            return False
        async with self.context.db.write() as tx:
            # I11: the world cannot change before the end of a transaction that sends a mission.
            present = await share_current(tx, seen[0].network_id)
            work = await MissionUnitOfWork.lock(self.context, tx, [drone_id])
            calendar = await _read(work, drone_id)
            if not calendar.queued or calendar.queued[0].network_id != seen[0].network_id:
                return True
            following = calendar.queued[0]
            now_ms = self.context.now_ms
            due = [each for each in calendar.queued if has_promise_to_make(each, now_ms=now_ms)]
            for each in due:
                await make_firm(work, each)
            if due:
                return True
            decision = decide(
                following,
                before=calendar.before,
                link=work.links.get(drone_id),
                is_planned_in_this_world=following.planned_in == present,
                times=self._times(drone_id),
            )
            match decision:
                case Send():
                    await send_next(work, following)
                case Shorten(until_ms=until_ms) if calendar.before is not None:
                    await shorten_standby(work, calendar.before, until_ms=until_ms)
                case GiveUp(detail=detail):
                    tx.after_commit(self.context.dispatches.set)
                    await refuse(work, following, _not_free(detail))
                case PlanAgain(slot=slot):
                    pass
                case Shorten() | Leave():
                    return False
        if isinstance(decision, PlanAgain):
            return await self._plan_again(calendar, slot)
        # The mission behind a mission that was given up is the next one now.
        return isinstance(decision, GiveUp)

    async def _plan_again(self, calendar: _Calendar, slot: Slot) -> bool:
        first, began_ms = calendar.queued[0], self.context.now_ms
        skyway = await self.context.networks.current(first.network_id)
        world = await World.of(skyway, self.context.db, after_ms=self.context.now_ms)
        own = [each for each in (calendar.before, *calendar.queued) if each is not None]
        world = world.without([each.mission_id for each in own])
        planner = QueuePlanner(self.context, world, self.tolerance_s)
        changed = await planner.plan(calendar.queued, slot)
        is_hopeless = not changed and self._times().is_overdue(first)
        if not changed and not is_hopeless:
            return False
        seen = Snapshot(world.present, {calendar.drone_id: calendar.version})

        async def write(tx: Tx) -> None:
            work = await MissionUnitOfWork.lock_as_seen(self.context, tx, seen)
            tx.after_commit(self.context.dispatches.set)
            if is_hopeless:
                await refuse(work, first, _not_free(_NO_PLAN))
                return
            await _apply(work, calendar, changed, skyway)
            self._last_plan_took_ms[calendar.drone_id] = self.context.now_ms - began_ms
            if calendar.before is None:
                await self._send_if_in_time(work, calendar.drone_id)

        # The missions may begin later than planned: then they are planned again.
        lost = await commit(self.context, Change(NEVER_MS, write))
        if isinstance(lost, RowRefused):
            raise lost
        return True

    async def _send_if_in_time(self, work: MissionUnitOfWork, drone_id: DroneId) -> None:
        """Send the next mission with its new plan: at the next look it may be too late."""
        following = next(iter(await queued_of_drone(work.tx.connection, drone_id)), None)
        if following is None:
            return
        times = self._times(drone_id)
        decision = decide(
            following,
            before=None,
            link=work.links.get(drone_id),
            is_planned_in_this_world=True,
            # With more time to plan, the plan begins later than missions are usually sent.
            times=replace(
                times,
                send_ahead_ms=max(times.send_ahead_ms, times.plan_ms),
                send_waiting_ms=max(times.send_waiting_ms, times.plan_ms),
            ),
        )
        if isinstance(decision, Send):
            await send_next(work, following)

    def _times(self, drone_id: DroneId | None = None) -> Times:
        """The present times; for a drone, with the time that its plans need."""
        usual_ms, reach_ms = PLANS_QUEUE.ms(self.context.clock), REACHES.ms(self.context.clock)
        took_ms = 0 if drone_id is None else self._last_plan_took_ms.get(drone_id, 0)
        needed_ms = reach_ms + _TIMES_THE_LAST_PLAN * took_ms
        return Times(
            now_ms=self.context.now_ms,
            reach_ms=reach_ms,
            plan_ms=max(usual_ms, min(needed_ms, _MOST_TIMES_THE_USUAL * usual_ms)),
            hand_over_ms=HAND_OVER.ms(self.context.clock),
            send_ahead_ms=send_ahead_ms(self.context.clock),
            send_waiting_ms=send_ahead_ms(
                self.context.clock, QoS(pooling=True, pooling_wait_s=1.0)
            ),
            longest_wait_ms=WAITS_FOR_DRONE.ms(self.context.clock),
        )


async def _read(work: MissionUnitOfWork, drone_id: DroneId) -> _Calendar:
    queued = await queued_of_drone(work.tx.connection, drone_id)
    version = work.links[drone_id].calendar_version
    return _Calendar(drone_id, version, work.missions.get(drone_id), tuple(queued))


async def _apply(
    work: MissionUnitOfWork,
    calendar: _Calendar,
    changed: Sequence[Moved | Dropped],
    skyway: PreparedNetwork,
) -> None:
    await give_back_pads(work.tx, [each.record for each in changed])
    earlier = {each.mission_id: each for each in calendar.queued}
    before = [] if calendar.before is None else [calendar.before.mission_id]
    for each in changed:
        mission_id = each.record.mission_id
        if isinstance(each, Dropped):
            await drop(work, each)
        else:
            await move(work, each, skyway, earlier=earlier[mission_id], before=before)
            before.append(mission_id)
    await restore_pads(work.tx, calendar.drone_id)


@dataclass(frozen=True, slots=True)
class WithdrawnDrones:
    """Looks after the calendars of drones that were taken out of service."""

    context: Context
    registry: ServiceClient

    async def step(self) -> bool:
        """Step of a loop: ask about all drones with QUEUED missions. Always False.

        Raises
        ------
        ServiceUnavailable
            The registry is away; calendars stay as they are.
        """
        async with self.context.db.read() as connection:
            drone_ids = await store.drones_with_queue(connection)
        for drone_id in (await out_of_service(self.registry, drone_ids)).drone_ids:
            while await self._give_up_last(drone_id):
                pass
        return False

    async def _give_up_last(self, drone_id: DroneId) -> bool:
        """Give up the drone's last QUEUED mission; returns whether there was one."""
        async with self.context.db.read() as connection:
            seen = await queued_of_drone(connection, drone_id)
        if not seen:
            return False
        async with self.context.db.write() as tx:
            # Every transaction that changes a calendar locks the network first, then the drone.
            await share_current(tx, seen[-1].network_id)
            work = await MissionUnitOfWork.lock(self.context, tx, [drone_id])
            queued = await queued_of_drone(tx.connection, drone_id)
            if queued:
                await refuse(work, queued[-1], _not_free("its drone is out of service"))
        return True


def _not_free(detail: str) -> Trouble:
    return Trouble(code="DRONE_NOT_FREE", detail=detail)
