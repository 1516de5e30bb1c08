"""Gives QUEUED missions another standby in the transaction that books another drone's service."""

from collections.abc import Iterable
from dataclasses import dataclass

from skyway.contracts.flight_step import DeliverStep, PickUpStep, ReturnStep
from skyway.ids import DroneId
from skyway.runtime.sql.database import Tx
from skyway.scheduling.giving_way import YieldingStandby
from skyway.scheduling.trip import BookedPad, Trip
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.release_pads import restore_pads
from skyway_composition.missions.mission.standby import standby_steps, with_standby_of
from skyway_composition.missions.mission.step_store import replace_steps, steps_of
from skyway_composition.pads.store import hold
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
