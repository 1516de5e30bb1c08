"""Joins a waiting mission: the new calendar of its drone and the guest's rows, all or nothing."""

from dataclasses import dataclass, replace

from skyway.contracts.mission import Mission
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms
from skyway_composition.calendar.commit import WorldChanged
from skyway_composition.context import Context
from skyway_composition.missions.mission.custody_store import Custodian, Held, begin_custody
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.share import Share
from skyway_composition.missions.mission.share_views import mission_of
from skyway_composition.missions.mission.store import save_request
from skyway_composition.missions.queue.dispatching import store
from skyway_composition.missions.queue.dispatching.adopt import BetterOrder, adopt
from skyway_composition.missions.queue.dispatching.merger import promises_of


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
            The host could start by now, or its drone's calendar or the network has changed.
        RowRefused
            Another mission, or a held offer, has one of the pads now.
        """
        if self.better.first_start_ms < context.now_ms:
            raise WorldChanged
        await adopt(context, tx, self.better)
        record = self.record
        promised = promises_of(self.host_before)
        new = [each for each in record.mission.packages if each.package_id in self.guest.packages]
        record = replace(record, promised=(*promised.values(), *new))
        await save_request(tx, record)
        await store.save_promises(tx, record)
        store.add_guest(tx, record, self.guest)
        pickup = Custodian("STATION", record.request.pickup.station_id)
        rows = [Held(each, 1, pickup) for each in self.guest.packages]
        begin_custody(tx, record, rows, at_ms=moment_to_ms(record.mission.start_at))
        return mission_of(record, self.guest)
