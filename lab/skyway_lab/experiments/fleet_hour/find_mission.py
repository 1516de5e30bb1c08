"""Finds the mission that delivers a request first, by the exact planner and the services' rules."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple, Self

from skyway.delivery.plan import Deliver, Plan
from skyway.ids import PackageId, StationId
from skyway.network.network import Network
from skyway.planner.airspace import Airspace
from skyway.planner.compose import compose
from skyway.planner.hierarchy import Hierarchy
from skyway.planner.pad_book import PadBook
from skyway.planner.problem import DroneAtStart, PackageToDeliver, Problem
from skyway.scheduling.repositioning import expected_pickups
from skyway.scheduling.standby import (
    StandbyChoice,
    home_start_ms,
    run_search,
    search_standby,
    trip_by_way_home,
)
from skyway.scheduling.stays import Slot
from skyway.scheduling.trip import NoTrip, Trip, soc_after
from skyway_lab.experiments.fleet_hour.calendars import MODEL, PAD_GAP_MS, Calendars, HourMission
from skyway_lab.experiments.fleet_hour.cases import HourRequest

#: The services' defaults, seconds.
_LOADING_S: Final = 60.0
_DROPOFF_S: Final = 30.0

#: The most labels of one search: enough to prove nearly all plans, and the same on every machine.
_MOST_LABELS: Final = 100_000

#: The package that stands for an empty drone on its way, as in the services.
_NOTHING: Final = PackageId("home")


class _Delivery(NamedTuple):
    """A drone's plan for a request; the drone that delivers first wins, then the least energy."""

    delivered_ms: int
    energy_j: float
    drone: int
    slot: Slot
    plan: Plan
    pads: PadBook


@dataclass(frozen=True, slots=True)
class MissionFinder:
    """Finds missions on one network."""

    network: Network
    airspace: Airspace
    hierarchy: Hierarchy

    @classmethod
    def of(cls, network: Network) -> Self:
        """The finder for this network."""
        return cls(network, Airspace.of(network), Hierarchy.of(network))

    def first_mission(
        self, calendars: Calendars, request: HourRequest, *, now_ms: int
    ) -> HourMission | None:
        """The mission with the first delivery among all drones that can be booked now."""
        deliveries = sorted(self._deliveries(calendars, request, now_ms), key=lambda each: each[:3])
        for each in deliveries:
            home = calendars.case.homes[each.drone]
            choice = StandbyChoice(calendars.policy.standby, home)
            trip = self._with_standby(each, choice, calendars)
            if isinstance(trip, Trip):
                return HourMission.of(request, each.drone, each.slot, trip)
        return None

    def _deliveries(
        self, calendars: Calendars, request: HourRequest, now_ms: int
    ) -> Iterator[_Delivery]:
        for drone, slot in calendars.slots(now_ms):
            pads = calendars.pads_for(drone, now_ms=now_ms)
            problem = Problem(
                network=self.network,
                drone=DroneAtStart(model=MODEL, soc=slot.soc, station_id=slot.station_id),
                source=request.source,
                packages=request.packages,
                loading_s=_LOADING_S,
                dropoff_s=_DROPOFF_S,
                label_limit=_MOST_LABELS,
            )
            plan = self._compose(problem, pads.seen_from(slot.at_ms))
            if plan.is_flyable:
                delivered_ms = home_start_ms(plan, start_ms=slot.at_ms)
                yield _Delivery(delivered_ms, plan.energy_j or 0.0, drone, slot, plan, pads)

    def _with_standby(
        self, delivery: _Delivery, choice: StandbyChoice, calendars: Calendars
    ) -> Trip | NoTrip:
        plan, slot = delivery.plan, delivery.slot
        start = [each.station_id for each in plan.steps if isinstance(each, Deliver)][-1]
        if choice.standby == "NEXT_PICKUP":
            past = calendars.past_requests()
            pickups = expected_pickups(past, at_ms=delivery.delivered_ms)
            waiting = calendars.waiting(delivery.drone)
            choice = choice.near(pickups, self.network, start=start, waiting=waiting)
        drone = DroneAtStart(model=MODEL, soc=soc_after(plan, slot.soc), station_id=start)
        booked = delivery.pads.seen_from(delivery.delivered_ms)

        def trip_to(end: StationId) -> Trip | NoTrip:
            problem = Problem(
                network=self.network,
                drone=drone,
                source=start,
                packages=(PackageToDeliver(package_id=_NOTHING, mass_kg=0.0, destination=end),),
                finish="stay",
                label_limit=_MOST_LABELS,
            )
            return trip_by_way_home(
                plan,
                problem,
                self._compose(problem, booked),
                start_ms=slot.at_ms,
                booked=booked,
                pad_gap_ms=PAD_GAP_MS,
            )

        return run_search(search_standby(choice, self.network, start=start, drone=drone), trip_to)

    def _compose(self, problem: Problem, booked: PadBook) -> Plan:
        return compose(problem, airspace=self.airspace, hierarchy=self.hierarchy, booked=booked)
