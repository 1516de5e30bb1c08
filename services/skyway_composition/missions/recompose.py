"""Re-composition: a drone that stands and waits gets a new revision of its mission.

A step failed, the drone refused a revision, or it lost its journal. The new problem begins where
the drone stands, with the charge it has: deliver what is on board (or still at the pickup), then
home. Pads that lay ahead in the old plan are given up in the transaction that reserves the new.
"""

import logging
from dataclasses import dataclass, replace
from typing import Final

from skyway.contracts.flight_step import FlightStep
from skyway.delivery.plan import PickUp
from skyway.ids import DroneId, PackageId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.database import Database
from skyway.runtime.errors import Taken
from skyway.runtime.loops import Wake
from skyway.runtime.minting import Mint
from skyway.units import moment_to_ms
from skyway_composition.links.link import DroneLink
from skyway_composition.missions import store
from skyway_composition.missions.custody import Held, delivered, on_board
from skyway_composition.missions.dispatch import dispatch
from skyway_composition.missions.ending import abort
from skyway_composition.missions.instruct import StepTerms, flight_steps, wait_there
from skyway_composition.missions.record import MissionRecord, Stuck
from skyway_composition.missions.report import report
from skyway_composition.missions.revision import next_revision
from skyway_composition.missions.watch import Watch
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.networks.store import share_version
from skyway_composition.pads.store import free, reserve
from skyway_composition.planning.problem_for import Load, Standing, delivery_problem, onward_problem
from skyway_composition.planning.round_trip import NOTHING_TO_DELIVER, NoTrip, round_trip, way_home
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.trip import Trip
from skyway_composition.planning.world import World

log = logging.getLogger(__name__)

#: A mission that needs more revisions than this is going nowhere. Our own choice.
_MOST_REVISIONS: Final = 20

#: Wall time until a plan is looked for again when there was none.
_RETRY_MS: Final = 2_000


@dataclass(frozen=True, slots=True)
class Recomposer:
    """Finds new plans for drones that wait for one; `pads_changed` is woken after each."""

    db: Database
    networks: PreparedNetworks
    solver: SolverPool
    clock: FleetClock
    mint: Mint
    claimant: str
    pads_changed: Wake

    async def step(self) -> bool:
        """Plan for a few drones that wait; True when there may be more."""
        drone_ids = await store.claim_stuck(self.db, self.clock, self.claimant)
        for drone_id in drone_ids:
            await self.recompose(drone_id)
        return bool(drone_ids)

    async def recompose(self, drone_id: DroneId) -> None:
        """Give this drone a new revision; without a plan try again later, or give up."""
        async with self.db.write() as tx:
            watch = await Watch.over([drone_id], tx=tx, clock=self.clock, mint=self.mint)
            record = watch.missions.get(drone_id)
            held = {} if record is None else await _held(watch, record)
        if record is None or record.stuck is None:
            return
        if record.mission.revision >= _MOST_REVISIONS:
            detail = f"{record.mission.revision} revisions led nowhere; the last: {record.stuck}"
            await self._give_up(record, code=record.stuck.code, detail=detail)
            return
        world = await self._look(record)
        trip = await self._plan(world, record, record.stuck, held)
        if isinstance(trip, Trip):
            await self._take_or_retry(world, record, trip, held)
        elif trip.is_temporary:
            await self._retry_later(record)
        else:
            await self._give_up(record, code=trip.code, detail=trip.detail)

    async def _look(self, record: MissionRecord) -> World:
        skyway = await self.networks.current(record.network_id)
        return await World.of(
            skyway,
            self.db,
            after_ms=moment_to_ms(self.clock.now()),
            without_mission_id=record.mission_id,
        )

    async def _plan(
        self,
        world: World,
        record: MissionRecord,
        stuck: Stuck,
        held: dict[PackageId, Held],
    ) -> Trip | NoTrip:
        """Deliver what is on board, or fetch what still lies at the pickup, then fly home."""
        if stuck.station_id not in world.skyway.network.stations:
            detail = f"the drone stands at {stuck.station_id!r}, which is no longer in the network"
            return NoTrip("DESTINATION_UNREACHABLE", detail, is_temporary=False)
        drone = Standing(record.candidate.model, stuck.soc, stuck.station_id)
        home_station_id = record.candidate.home_station_id
        start_ms = 1 + moment_to_ms(
            self.clock.now() + fleet_margin(self.clock, fleet_s=60, wall_s=2)
        )
        if stuck.soc < drone.model.reserve_soc:
            detail = f"charge {stuck.soc:.3f} is below the reserve {drone.model.reserve_soc}"
            return NoTrip("LOW_CHARGE", detail, is_temporary=False)
        carried = on_board(held)
        if carried:
            loads = [
                Load(package, package.destination.station_id)
                for package in record.packages(carried)
            ]
            problem = onward_problem(world, drone, loads=loads, start_ms=start_ms)
        elif len(delivered(held)) < len(record.request.packages):
            problem = delivery_problem(
                world,
                drone,
                pickup=record.request.pickup.station_id,
                packages=record.request.packages,
                start_ms=start_ms,
                latest_ms=None,
            )
        else:
            return await way_home(
                self.solver,
                world,
                NOTHING_TO_DELIVER,
                standing=drone,
                home_station_id=home_station_id,
                start_ms=start_ms,
            )
        return await round_trip(self.solver, world, problem, home_station_id=home_station_id)

    async def _take_or_retry(
        self, world: World, planned: MissionRecord, trip: Trip, held: dict[PackageId, Held]
    ) -> None:
        try:
            await self._take(world, planned, trip, held)
        except Taken as taken:
            log.info("pad taken", extra={"mission_id": planned.mission_id, "by": taken.constraint})
            await self._retry_later(planned)

    async def _take(
        self, world: World, planned: MissionRecord, trip: Trip, held: dict[PackageId, Held]
    ) -> None:
        """Replace what is left of the mission by this trip, unless things have changed."""
        async with self.db.write() as tx:
            version = await share_version(tx, world.skyway.network_id)
            watch = await Watch.over([planned.drone_id], tx=tx, clock=self.clock, mint=self.mint)
            record = watch.missions.get(planned.drone_id)
            is_late = trip.start_ms < moment_to_ms(self.clock.now())
            is_outdated = version != world.skyway.version or is_late
            if record is None or is_outdated or not _waits_for(record, planned):
                await store.retry_stuck(tx, planned.mission_id, at_wall_ms=0)
                return
            steps = await self._steps(watch, record, world, trip, held)
            mission = next_revision(record.mission, trip)
            record = replace(record, mission=mission, stuck=None, told=None)
            await store.add_steps(tx, record.mission_id, steps, revision=record.mission.revision)
            await free(tx, record.mission_id)
            await reserve(tx, record.mission_id, trip.booked_pads)
            watch.links[record.drone_id] = await dispatch(
                tx,
                watch.courier,
                watch.links[record.drone_id],
                mission=mission,
                steps=steps,
                expires_at=watch.courier.expiry(),
            )
            record = report(
                tx,
                record,
                "REPLANNED",
                at=self.clock.now(),
                mint=self.mint,
                code=None if planned.stuck is None else planned.stuck.code,
                detail=None if planned.stuck is None else planned.stuck.detail,
                etas=mission.packages,
                mission=mission,
            )
            await watch.keep(record)
            await store.retry_stuck(tx, record.mission_id, at_wall_ms=0)
            tx.after_commit(self.pads_changed.set)

    async def _steps(
        self,
        watch: Watch,
        record: MissionRecord,
        world: World,
        trip: Trip,
        held: dict[PackageId, Held],
    ) -> tuple[FlightStep, ...]:
        """The new steps; what is on board is picked up only by a drone that has forgotten it."""
        known = await store.steps_of(watch.tx.connection, record.mission_id)
        begun = [each.step.step_id for each in known if each.status != "PLANNED"]
        last_step = max([*begun, 0 if record.stuck is None else record.stuck.last_step])
        knows_its_load = on_board(held) and not _has_forgotten_its_load(
            watch.links[record.drone_id], on_board(held)
        )
        placed = [
            each for each in trip.steps() if not (knows_its_load and isinstance(each.step, PickUp))
        ]
        if not placed and record.stuck is not None:
            # Home and charged: the drone still has to hear that nothing is left, to end it.
            return (wait_there(record.stuck.station_id, trip.start_ms, step_id=last_step + 1),)
        return flight_steps(
            world.skyway.network,
            placed,
            terms=StepTerms.of(record, world.skyway.settings),
            first_step=last_step + 1,
        )

    async def _retry_later(self, record: MissionRecord) -> None:
        async with self.db.write() as tx:
            at_wall_ms = moment_to_ms(self.clock.wall_now()) + _RETRY_MS
            await store.retry_stuck(tx, record.mission_id, at_wall_ms=at_wall_ms)

    async def _give_up(self, planned: MissionRecord, *, code: str, detail: str) -> None:
        async with self.db.write() as tx:
            watch = await Watch.over([planned.drone_id], tx=tx, clock=self.clock, mint=self.mint)
            record = watch.missions.get(planned.drone_id)
            if record is not None and record.mission_id == planned.mission_id:
                await abort(watch, record, at=self.clock.now(), code=code, detail=detail)
                tx.after_commit(self.pads_changed.set)


def _waits_for(record: MissionRecord, planned: MissionRecord) -> bool:
    """Whether the mission still waits, for the same reason, for the revision that was planned."""
    return (record.mission_id, record.mission.revision, record.stuck) == (
        planned.mission_id,
        planned.mission.revision,
        planned.stuck,
    )


def _has_forgotten_its_load(link: DroneLink, carried: frozenset[PackageId]) -> bool:
    """Whether the drone, of whose events none is missing, does not know of anything on board."""
    state = link.state
    if state is None or state.last_event_seq < link.last_event_seq:
        return False
    return carried.isdisjoint(state.package_ids)


async def _held(watch: Watch, record: MissionRecord) -> dict[PackageId, Held]:
    return await store.held_packages(watch.tx.connection, record.mission.delivery_id)
