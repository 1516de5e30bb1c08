"""The nearest station where a drone can land: open, and in reach above the reserve.

Also makes trips that fly to such a landing first, or end there.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from typing import Self

from skyway.delivery.plan import Deliver, Fly, PickUp, Plan, PlanStatus, Step
from skyway.drone.flight import flight_energy_j, flight_time_s
from skyway.drone.model import DroneModel
from skyway.ids import PackageId, StationId
from skyway.network.network import Network, Segment
from skyway.planner.pad_book import booked_until_ms
from skyway.planner.weather import STILL_AIR, Air, Weather
from skyway.scheduling.trip import NOTHING_TO_DELIVER, Trip
from skyway_composition.missions.replanning.remainder.anchor import Anchor
from skyway_composition.planning.world import ClosedAhead


@dataclass(frozen=True, slots=True)
class Landing:
    """Where a drone lands, after these flights; seconds count from the anchor's moment."""

    station_id: StationId
    at_s: float
    soc: float
    flights: tuple[Fly, ...] = ()

    def landed(self, model: DroneModel) -> Self:
        """The landing with its time and energy, added to the last flight as plans do."""
        at_s, soc = self.at_s + model.stop_s, self.soc - model.stop_j / model.battery_j
        *others, last = self.flights
        landing = last.model_copy(
            update={"end_s": at_s, "energy_j": last.energy_j + model.stop_j, "soc_end": soc}
        )
        return type(self)(self.station_id, at_s, soc, (*others, landing))


@dataclass(frozen=True, slots=True)
class LandingSearch:
    """Where a drone could land; `model` has the margin that flights are planned with.

    The clock of the weather shows seconds since 1970.
    """

    network: Network
    closed: ClosedAhead
    model: DroneModel
    load_kg: float
    weather: Weather | None = None

    def nearest(self, anchor: Anchor) -> Landing | None:
        """The landing with the smallest flight time from the anchor; None when none is in reach.

        A drone that can stand at the anchor stays there. Flights are followed in the order of
        their ends, so the first landing found is the soonest.
        """
        start = self.here(anchor)
        if not anchor.is_in_the_air:
            return start
        order = count()
        ahead = [(0.0, next(order), start)]
        seen: set[StationId] = set()
        while ahead:
            _, _, here = heappop(ahead)
            if here.station_id in seen:
                continue
            seen.add(here.station_id)
            if here.flights and self._is_safe(here.landed(self.model), anchor):
                return here.landed(self.model)
            for following in self._flown_on(here, anchor):
                heappush(ahead, (following.at_s, next(order), following))
        return None

    def here(self, anchor: Anchor) -> Landing:
        """The anchor itself, open or not."""
        return Landing(anchor.station_id, 0.0, anchor.soc)

    def _is_safe(self, landed: Landing, anchor: Anchor) -> bool:
        at_ms = anchor.at_ms + landed.at_s * 1000
        is_open = not self.closed.closes_landing(landed.station_id, at_ms)
        return is_open and landed.soc >= self.model.reserve_soc

    def _flown_on(self, here: Landing, anchor: Anchor) -> Iterator[Landing]:
        if here.station_id not in self.network.stations:
            return
        model, load_kg = self.model, self.load_kg
        for segment in self.network.segments_from(here.station_id):
            air = self._air(segment, anchor.at_ms / 1000 + here.at_s)
            if air.time_factor == math.inf:
                continue
            length_m = segment.length_m * air.time_factor
            at_s = here.at_s + flight_time_s(model, length_m=length_m, load_kg=load_kg)
            energy_j = flight_energy_j(model, length_m=length_m, load_kg=load_kg)
            energy_j *= air.energy_factor
            soc = here.soc - energy_j / model.battery_j
            is_closed = self.closed.closes_segment(
                segment.from_id,
                segment.to_id,
                start_ms=anchor.at_ms + here.at_s * 1000,
                end_ms=anchor.at_ms + at_s * 1000,
            )
            if is_closed or soc < model.reserve_soc:
                continue
            flight = Fly(
                from_id=segment.from_id,
                to_id=segment.to_id,
                start_s=here.at_s,
                end_s=at_s,
                load_kg=load_kg,
                energy_j=energy_j,
                soc_end=soc,
                time_factor=air.time_factor,
                energy_factor=air.energy_factor,
            )
            yield Landing(segment.to_id, at_s, soc, (*here.flights, flight))

    def _air(self, segment: Segment, at_s: float) -> Air:
        if self.weather is None:
            return STILL_AIR
        return self.weather.air_between(segment.from_id, segment.to_id, at_s=at_s)


def leaving_behind(landing: Landing, package_ids: frozenset[PackageId], *, start_ms: int) -> Trip:
    """A trip that flies to this landing, leaves the load there, and ends."""
    end_s = landing.at_s
    left: tuple[Step, ...] = ()
    if package_ids:
        left = (
            Deliver(
                station_id=landing.station_id,
                package_ids=tuple(sorted(package_ids)),
                start_s=end_s,
                end_s=end_s,
            ),
        )
    plan = _flown_first(
        landing, Plan(status=PlanStatus.FEASIBLE, delivery_time_s=0.0, energy_j=0.0, flight_s=0.0)
    )
    plan = plan.model_copy(update={"steps": (*plan.steps, *left)})
    return Trip(
        start_ms=start_ms,
        plan=plan,
        home_start_ms=start_ms + booked_until_ms(end_s),
        home_plan=NOTHING_TO_DELIVER,
        home_recharge=None,
    )


def by_way_of(landing: Landing, trip: Trip, *, start_ms: int) -> Trip:
    """A trip that flies to this landing first and then flies the given trip."""
    return Trip(
        start_ms=start_ms,
        plan=_flown_first(landing, trip.plan, gap_s=(trip.start_ms - start_ms) / 1000),
        home_start_ms=trip.home_start_ms,
        home_plan=trip.home_plan,
        home_recharge=trip.home_recharge,
        pad_gap_ms=trip.pad_gap_ms,
    )


def staying(plan: Plan, *, start_ms: int, pad_gap_ms: int) -> Trip:
    """A trip that flies this plan with everything on board and hands nothing over."""
    flown = tuple(each for each in plan.steps if not isinstance(each, PickUp | Deliver))
    return Trip(
        start_ms=start_ms,
        plan=plan.model_copy(update={"steps": flown, "deliveries": ()}),
        home_start_ms=start_ms + booked_until_ms(plan.delivery_time_s or 0.0),
        home_plan=NOTHING_TO_DELIVER,
        home_recharge=None,
        pad_gap_ms=pad_gap_ms,
    )


def begins_with_flight(trip: Trip) -> bool:
    """Whether a trip begins with a flight, without a wait or a recharge before it."""
    first = next((each for each in trip.steps() if each.step.kind != "PICK_UP"), None)
    return first is not None and isinstance(first.step, Fly) and first.start_ms <= trip.start_ms


def _flown_first(landing: Landing, plan: Plan, *, gap_s: float | None = None) -> Plan:
    """The plan with the flights to a landing before it; its own seconds count from `gap_s` on."""
    later_s = landing.at_s if gap_s is None else gap_s
    steps = tuple(_later(step, later_s) for step in plan.steps)
    deliveries = tuple(
        each.model_copy(update={"delivered_s": each.delivered_s + later_s})
        for each in plan.deliveries
    )
    flown_s = sum(flight.end_s - flight.start_s for flight in landing.flights)
    return plan.model_copy(
        update={
            "steps": (*landing.flights, *steps),
            "deliveries": deliveries,
            "delivery_time_s": (plan.delivery_time_s or 0.0) + later_s,
            "lower_bound_s": None,
            "flight_s": (plan.flight_s or 0.0) + flown_s,
            "energy_j": (plan.energy_j or 0.0) + sum(each.energy_j for each in landing.flights),
        }
    )


def _later(step: Step, by_s: float) -> Step:
    return step.model_copy(update={"start_s": step.start_s + by_s, "end_s": step.end_s + by_s})
