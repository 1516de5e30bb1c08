"""The remainder of a mission: the best plan from its anchor on, or how it ends without a plan.

The planner tries in this order:

1. Deliver all packages at their present aims.
2. Send packages whose station is closed to their alternative, or back to the pickup.
3. Bring all packages back to the pickup.
4. Leave them where the drone can land soonest.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace

from skyway.delivery.request import DeliveryRequest, Package, Place
from skyway.drone.model import DroneModel
from skyway.errors import InvalidProblem
from skyway.ids import PackageId, StationId
from skyway.planner.problem import Problem
from skyway.scheduling.standby import StandbyChoice, fitted, standby_for
from skyway.scheduling.stays import Slot
from skyway.scheduling.trip import NOTHING_TO_DELIVER, NoTrip, Trip
from skyway_composition.missions.mission.record import CALLED_HOME, Aim, MissionRecord, Trouble
from skyway_composition.missions.replanning.remainder.anchor import Anchor
from skyway_composition.missions.replanning.remainder.landing import (
    LandingSearch,
    begins_with_flight,
    by_way_of,
    leaving_behind,
    staying,
)
from skyway_composition.missions.replanning.situation import Situation
from skyway_composition.planning.find_trip import round_trip, way_home, without_missed_window
from skyway_composition.planning.problem_for import (
    AimedPackage,
    Standing,
    delivery_problem,
    landing_problem,
    onward_problem,
    with_margin,
)
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.world import ClosedAhead, World


@dataclass(frozen=True, slots=True)
class Remainder:
    """What a mission does from its anchor on, and where its packages go.

    `given_up` is the reason why the packages are left where the drone can land.
    """

    trip: Trip
    aims: tuple[Aim, ...]
    given_up: str | None = None


@dataclass(frozen=True, slots=True)
class RemainderPlanner:
    """Plans the remainder of one mission, in one world.

    `ready` is where, when and with what charge the drone begins its next mission, if it has one.
    `energy_margin` is the share of energy that the plan adds.
    """

    solver: SolverPool
    world: World
    situation: Situation
    closed: ClosedAhead
    energy_margin: float
    ready: Slot | None = None

    @property
    def record(self) -> MissionRecord:
        """The mission."""
        return self.situation.record

    @property
    def model(self) -> DroneModel:
        """The drone's model with the margin that flights are planned with."""
        return with_margin(self.situation.model, self.energy_margin)

    async def plan(self, anchor: Anchor, trouble: Trouble) -> Remainder | NoTrip:
        """The remainder from this anchor; NoTrip when the drone should stay where it is.

        A drone in the air that must stand before it can continue lands elsewhere first.
        """
        found = await self._plan_standing(anchor, trouble)
        is_temporary = isinstance(found, NoTrip) and found.is_temporary
        if not anchor.is_in_the_air or is_temporary:
            return found
        if isinstance(found, Remainder) and begins_with_flight(found.trip):
            return found
        landing = self._landings(anchor).nearest(anchor)
        if landing is None:
            detail = f"no open station is in reach of {anchor.station_id!r} above the reserve"
            return NoTrip("OUT_OF_RANGE", detail, is_temporary=False)
        landed = replace(
            anchor,
            station_id=landing.station_id,
            at_ms=anchor.at_ms + round(landing.at_s * 1000),
            soc=landing.soc,
            is_in_the_air=False,
        )
        onward = await self._plan_standing(landed, trouble)
        if not isinstance(onward, Remainder) and trouble.land_at is not None:
            # The drone cannot reach the station of the diversion: it waits here for a command.
            waiting = trouble.model_copy(update={"land_at": landing.station_id})
            onward = await self._plan_standing(landed, waiting)
        if isinstance(onward, Remainder):
            trip = by_way_of(landing, onward.trip, start_ms=anchor.at_ms)
            return replace(onward, trip=trip)
        trip = leaving_behind(landing, anchor.carried, start_ms=anchor.at_ms)
        return Remainder(trip, self.record.aims, given_up=onward.code)

    def leave_here(self, anchor: Anchor, *, code: str) -> Remainder:
        """Leave everything at the anchor, even if the station is closed."""
        here = self._landings(anchor).here(anchor)
        trip = leaving_behind(here, anchor.carried, start_ms=anchor.at_ms)
        return Remainder(trip, self.record.aims, given_up=code)

    def _landings(self, anchor: Anchor) -> LandingSearch:
        masses_kg = self.situation.masses_kg
        load_kg = sum(masses_kg[each] for each in anchor.carried)
        known = self.world.conditions.weather
        if known is not None and not known.counts_from(anchor.at_ms):
            known = None
        return LandingSearch(
            self.world.skyway.network,
            self.closed,
            self.model,
            load_kg,
            None if known is None else known.of_model(self.model, self.world.use_deviation),
        )

    async def _plan_standing(self, anchor: Anchor, trouble: Trouble) -> Remainder | NoTrip:
        """The remainder of a drone that can stand at the anchor."""
        nowhere = self._nowhere(anchor)
        if nowhere is not None:
            return nowhere
        if trouble.land_at is not None:
            trip = await self._trip_to(anchor, trouble.land_at)
            return Remainder(trip, self.record.aims) if isinstance(trip, Trip) else trip
        first: NoTrip | None = None
        for aims in aims_to_try(self.record, anchor.carried, self.closed):
            found = await self._trip(anchor, aims, trouble)
            if isinstance(found, Trip):
                return Remainder(found, aims)
            if found.is_temporary:
                return found
            first = first or found
        return first or NoTrip("NO_PLAN_FOUND", "nothing was tried", is_temporary=True)

    def _nowhere(self, anchor: Anchor) -> NoTrip | None:
        """Why no plan can begin at the anchor; None when one can."""
        if anchor.station_id not in self.world.skyway.network.stations:
            detail = f"the drone stands at {anchor.station_id!r}, which is no longer in the network"
            return NoTrip("DESTINATION_UNREACHABLE", detail, is_temporary=False)
        return None

    async def _trip(self, anchor: Anchor, aims: tuple[Aim, ...], trouble: Trouble) -> Trip | NoTrip:
        """A trip that delivers the load, or fetches it at the pickup first, and then stands by.

        The standby leads to the start of the drone's next mission if the drone can be ready there.
        """
        standby = StandbyChoice.of(self.record.candidate)
        if trouble.code == CALLED_HOME:
            return await self._trip_and_standby(anchor, aims, trouble, standby.at_home())
        if self.ready is not None and self.ready.at_ms > anchor.at_ms:
            onward = standby_for(self.ready)
            trip = await self._trip_and_standby(anchor, aims, trouble, onward)
            if isinstance(trip, Trip):
                soc = self._standing(anchor).soc
                in_time = fitted(trip, soc=soc, ready=self.ready)
                if in_time is not None:
                    return in_time
        return await self._trip_and_standby(anchor, aims, trouble, standby)

    async def _trip_and_standby(
        self, anchor: Anchor, aims: tuple[Aim, ...], trouble: Trouble, standby: StandbyChoice
    ) -> Trip | NoTrip:
        record, start_ms = self.record, anchor.at_ms
        drone = self._standing(anchor)
        if not anchor.carried and (anchor.has_loaded or trouble.code == CALLED_HOME):
            return await way_home(
                self.solver,
                self.world,
                NOTHING_TO_DELIVER,
                standing=drone,
                standby=standby,
                start_ms=start_ms,
            )
        aimed = replace(record, aims=aims)
        try:
            problem = self._problem(aimed, drone, anchor)
        except InvalidProblem:
            # A newer version of the network has hand-overs that are longer than the window.
            problem = self._problem(_without_ends(aimed), drone, anchor)
        while True:
            trip = await round_trip(self.solver, self.world, problem, standby=standby)
            # A window that cannot be met any more loses its end: its package comes late.
            later = without_missed_window(problem, trip) if isinstance(trip, NoTrip) else None
            if later is None:
                return trip
            problem = later

    def _problem(self, aimed: MissionRecord, drone: Standing, anchor: Anchor) -> Problem:
        if anchor.carried:
            loads = [
                AimedPackage(each, aimed.aim_of(each)) for each in aimed.packages(anchor.carried)
            ]
            return onward_problem(self.world, drone, loads=loads, start_ms=anchor.at_ms)
        return delivery_problem(
            self.world, drone, request=_as_aimed(aimed), start_ms=anchor.at_ms, latest_ms=None
        )

    async def _trip_to(self, anchor: Anchor, station_id: StationId) -> Trip | NoTrip:
        """A trip to a station with everything on board, to stand there."""
        if station_id not in self.world.skyway.network.stations:
            detail = f"station {station_id!r} is not in this network"
            return NoTrip("DESTINATION_UNREACHABLE", detail, is_temporary=False)
        problem = landing_problem(
            self.world,
            self._standing(anchor),
            packages=self.record.packages(anchor.carried),
            station_id=station_id,
            start_ms=anchor.at_ms,
        )
        plan = await self.solver.compose_in(self.world, problem)
        if not plan.is_flyable:
            code = "NO_PLAN_FOUND" if plan.infeasibility is None else plan.infeasibility.code
            detail = f"no way to {station_id!r} from {anchor.station_id!r}"
            return NoTrip(code, detail, is_temporary=plan.infeasibility is None)
        # The way home from there is planned once an operator resumes the drone.
        gap_ms = round(self.world.skyway.settings.pad_gap_s * 1000)
        return staying(plan, start_ms=anchor.at_ms, pad_gap_ms=gap_ms)

    def _standing(self, anchor: Anchor) -> Standing:
        """The drone at the anchor; a drone below its reserve charges there first."""
        model = self.situation.model
        soc = max(anchor.soc, model.reserve_soc)
        return Standing(model, soc, anchor.station_id, self.energy_margin)


def _without_ends(record: MissionRecord) -> MissionRecord:
    """The mission as if no window of its request had an end."""
    request = record.request
    packages = tuple(each.model_copy(update={"latest_at": None}) for each in request.packages)
    open_ended = {"packages": packages, "latest_pickup_at": None}
    return replace(record, request=request.model_copy(update=open_ended))


def _as_aimed(record: MissionRecord) -> DeliveryRequest:
    """The mission's request with the present aim of each package as its destination.

    A package that was loaded although it was cancelled is returned at the pickup. A package that
    goes elsewhere has no window.
    """
    packages = tuple(_aimed_at(each, record.aim_of(each)) for each in record.request.packages)
    return record.request.model_copy(update={"packages": packages})


def _aimed_at(package: Package, station_id: StationId) -> Package:
    if station_id == package.destination.station_id:
        return package
    elsewhere = {"destination": Place(station_id=station_id)}
    return package.model_copy(update={**elsewhere, "not_before_at": None, "latest_at": None})


def aims_to_try(
    record: MissionRecord, carried: frozenset[PackageId], closed: ClosedAhead
) -> Iterator[tuple[Aim, ...]]:
    """The aims to try: the present ones; without stations closed for good; all to the pickup."""
    yield record.aims
    if not carried:
        return
    on_board = record.packages(carried)
    hopeless = [each for each in on_board if closed.is_closed_for_good(record.aim_of(each))]
    turned = with_changed_aims(record.aims, [_instead(record, each, closed) for each in hopeless])
    if hopeless:
        yield turned
    returned = with_changed_aims(record.aims, [back_to_pickup(record, each) for each in on_board])
    if returned not in (record.aims, turned):
        yield returned


def absent_aim(record: MissionRecord, package: Package) -> Aim:
    """Where a package goes when its recipient was absent; its alternative is tried once."""
    other = package.alternative
    if other is None or record.aim_of(package) != package.destination.station_id:
        return back_to_pickup(record, package)
    return Aim(package_id=package.package_id, station_id=other.station_id, kind="DELIVER")


def back_to_pickup(record: MissionRecord, package: Package) -> Aim:
    """The aim of a package that goes back to the pickup."""
    pickup = record.request.pickup.station_id
    return Aim(package_id=package.package_id, station_id=pickup, kind="RETURN")


def with_changed_aims(aims: tuple[Aim, ...], changed: Collection[Aim]) -> tuple[Aim, ...]:
    """The aims with the changed ones in place of earlier aims of the same packages."""
    ids = {each.package_id for each in changed}
    return (*(each for each in aims if each.package_id not in ids), *changed)


def turned_back(before: tuple[Aim, ...], after: tuple[Aim, ...]) -> tuple[PackageId, ...]:
    """The packages that go back to the pickup now and did not before."""
    returning = {each.package_id for each in before if each.kind == "RETURN"}
    return tuple(
        each.package_id
        for each in after
        if each.kind == "RETURN" and each.package_id not in returning
    )


def _instead(record: MissionRecord, package: Package, closed: ClosedAhead) -> Aim:
    other = package.alternative
    if other is None or closed.is_closed_for_good(other.station_id):
        return back_to_pickup(record, package)
    return Aim(package_id=package.package_id, station_id=other.station_id, kind="DELIVER")
