"""Saves a better order or a shared trip: all its calendars in one transaction, or nothing."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from skyway.contracts.mission import Mission
from skyway.ids import DroneId, MissionId, ProviderId
from skyway.runtime.sql.database import Tx
from skyway_composition.calendar.commit import Snapshot
from skyway_composition.context import Context
from skyway_composition.missions.mission.custody_store import begin_at_pickup
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.share import Share
from skyway_composition.missions.mission.share_views import mission_of
from skyway_composition.missions.mission.standby import (
    end_standby_before,
    restore_pads,
    restore_standby,
)
from skyway_composition.missions.mission.step_store import replace_steps
from skyway_composition.missions.mission.store import save_request
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, report_left
from skyway_composition.missions.queue import store
from skyway_composition.missions.queue.dispatching.fleet import Calendar, Fleet, Moments
from skyway_composition.missions.queue.dispatching.merger import Merge
from skyway_composition.missions.queue.dispatching.plan_orders import Judgement, judge
from skyway_composition.missions.queue.move_queued import give_back_pads, move
from skyway_composition.missions.queue.plan_queue import Moved
from skyway_composition.pads.store import lock_stations
from skyway_composition.planning.world import World


@dataclass(frozen=True, slots=True)
class BetterOrder:
    """New plans for the waiting missions of a fleet, and the fleet as it was when they were made.

    `moved` has an entry for each drone of the fleet. The guests of `merges` are in no entry.
    """

    fleet: Fleet
    world: World
    times: Moments
    moved: Mapping[DroneId, Sequence[Moved]]
    merges: tuple[Merge, ...] = ()

    @property
    def changes(self) -> list[tuple[MissionRecord, MissionRecord]]:
        """Each mission with its packages before and after, without those that end as guests."""
        known = (*self.fleet.waiting, *(each.host for each in self.merges))
        before = {each.mission_id: each for each in known}
        after = [each.record for moved in self.moved.values() for each in moved]
        return [(before[each.mission_id], each) for each in after]

    @property
    def has_exchanges(self) -> bool:
        """Whether a mission changes its provider."""
        return any(
            before.mission.provider_id != after.mission.provider_id
            for before, after in self.changes
        )

    @property
    def refusing(self) -> frozenset[DroneId]:
        """The drones that may not fly a mission as it is planned now."""
        drones, network = self.fleet.calendars, self.world.skyway.network
        return frozenset(
            after.drone_id
            for before, after in self.changes
            if not self.fleet.may_fly(
                before, drones[after.drone_id].candidate, after.mission.plan, network=network
            )
        )

    def judged(self, *, tolerance_s: float = 0.0, of: ProviderId | None = None) -> Judgement:
        """The judgement on all its missions, or on those that a provider had until now."""
        guests = [guest for each in self.merges for guest in each.guests]
        return judge(
            (each for each in self.changes if of in (None, each[0].mission.provider_id)),
            tolerance_s=tolerance_s,
            guests=[each for each in guests if of in (None, each.mission.provider_id)],
        )

    @property
    def seen(self) -> Snapshot:
        """What the new plans depend on."""
        calendars = self.fleet.calendars.items()
        return Snapshot(self.world.present, {key: each.version for key, each in calendars})

    @property
    def first_start_ms(self) -> int:
        """The start of the first mission that gets a new plan."""
        return min(each.record.start.at_ms for moved in self.moved.values() for each in moved)


async def adopt(context: Context, tx: Tx, better: BetterOrder) -> None:
    """Save the new plans and report them.

    Raises
    ------
    WorldChanged
        A calendar or the network has changed since the plans were made.
    RowRefused
        Another mission, or a held offer, has one of the pads now.
    """
    fleet, drone_ids, times = better.fleet, sorted(better.fleet.calendars), better.times
    work = await MissionUnitOfWork.lock_as_seen(context, tx, better.seen)
    await work.change_calendars(drone_ids)
    all_moved = [each for moved in better.moved.values() for each in moved]
    # All in one order, because each mission locks its own stations later.
    await lock_stations(tx, [pad for each in all_moved for pad in each.trip.booked_pads])
    waiting = {each.mission_id: each for each in fleet.waiting}
    await give_back_pads(tx, [*waiting.values()])
    for merge in better.merges:
        waiting[merge.host.mission_id] = merge.host
        await _end_guests(work, merge)
    for drone_id in drone_ids:
        calendar, moved = fleet.calendars[drone_id], better.moved[drone_id]
        await _save(work, calendar, moved, waiting, better.world, times=times)
    for drone_id in drone_ids:
        await restore_pads(tx, drone_id)
        waited = fleet.calendars[drone_id].waiting
        # The drone's last mission may be followed by none now: its standby is planned again.
        if waited and not better.moved[drone_id]:
            await restore_standby(work, waited[-1])


async def _end_guests(work: MissionUnitOfWork, merge: Merge) -> None:
    """Make guests of the missions whose packages the host carries; they have no pads any more.

    A guest keeps the id under which the gateway knows the mission, and the numbers of its reports.
    """
    tx, host = work.tx, merge.host
    await save_request(tx, host)
    await store.save_promises(tx, host)
    shares = {each.mission_id: each for each in host.shares}
    for guest in merge.guests:
        report_left(work, guest)
        await work.custody.give(guest.mission_id, to=host.mission_id)
        await replace_steps(tx, guest.mission_id, (), first_step=1, revision=1)
        await store.delete_mission(tx, guest.mission_id)
        store.add_guest(tx, host, shares[guest.mission_id])


async def _save(
    work: MissionUnitOfWork,
    calendar: Calendar,
    moved: Sequence[Moved],
    waiting: Mapping[MissionId, MissionRecord],
    world: World,
    *,
    times: Moments,
) -> None:
    """Save the new missions of one drone, after those that it keeps."""
    if moved and calendar.kept:
        until_ms = moved[0].record.start.at_ms - times.hand_over_ms
        await end_standby_before(work.tx, calendar.kept[-1].mission_id, until_ms)
    before = [] if calendar.live is None else [calendar.live.mission_id]
    before += [each.mission_id for each in calendar.kept]
    for each in moved:
        mission_id = each.record.mission_id
        await move(work, each, world.skyway, earlier=waiting[mission_id], before=before)
        before.append(mission_id)


@dataclass(frozen=True, slots=True)
class JoinedTrip:
    """A shared trip: the new calendar of a drone, whose waiting mission carries a guest too."""

    better: BetterOrder
    guest: Share

    @property
    def record(self) -> MissionRecord:
        """The host's mission with the packages of all its deliveries, as it is planned now."""
        return next(
            each.record
            for moved in self.better.moved.values()
            for each in moved
            if self.guest in each.record.shares
        )

    @property
    def first_start_ms(self) -> int:
        """The start of the first mission that gets a new plan; then it is too late to join."""
        return self.better.first_start_ms

    @property
    def host_before(self) -> MissionRecord:
        """The host's mission as it was before the guest joined."""
        waiting = self.better.fleet.waiting
        return next(each for each in waiting if each.mission_id == self.record.mission_id)

    async def join(self, context: Context, tx: Tx) -> Mission:
        """Save the shared trip; returns the guest's mission.

        The caller has locked or added the guest's delivery.

        Raises
        ------
        WorldChanged
            The calendar of the host's drone or the network has changed.
        RowRefused
            Another mission, or a held offer, has one of the pads now.
        """
        await adopt(context, tx, self.better)
        record = self.record
        promised = self.host_before.promises
        new = [each for each in record.mission.packages if each.package_id in self.guest.packages]
        record = replace(record, promised=(*promised.values(), *new))
        await save_request(tx, record)
        await store.save_promises(tx, record)
        store.add_guest(tx, record, self.guest)
        begin_at_pickup(tx, record, self.guest.packages)
        return mission_of(record, self.guest)
