"""Estimates of all trips of a fleet problem, as if every pad were free.

Estimates are lower bounds: they take the shortest paths, charge at the fastest rate of the curve,
and never wait for a closure to end. The order search and the bound of the whole plan use them.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from skyway.dispatch.planned_trip import Pool
from skyway.dispatch.pools import Sharing, pickups_of
from skyway.dispatch.problem import FleetProblem, FleetRequest
from skyway.dispatch.stop_orders import MOST_ORDERED, StopOrders, Stops, orders_of
from skyway.drone.charging import fastest_s_per_soc, model_on_pad
from skyway.drone.flight import flight_power_w, speed_mps
from skyway.drone.model import DroneModel
from skyway.ids import StationId
from skyway.network.network import Network
from skyway.planner.kernels.fleet_trips import NEED, SECONDS, estimate_trip
from skyway.planner.kernels.memory import Floats, Longs
from skyway.planner.kernels.ways import lengths_from
from skyway.planner.trip_terms import to_pad_m
from skyway.scheduling.stays import Slot
from skyway.units import LOAD_TOLERANCE_KG

#: Seconds and joules of a flight that is not possible. Sums and differences need a finite number.
OUT_OF_REACH: Final = 1e12


@dataclass(frozen=True, slots=True)
class TripEstimate:
    """One trip of one model, from the moment at the pickup to the last hand-over.

    Parameters
    ----------
    ends
        Places where the trip may end.
    least
        ``(ends, 3)``: for each end the least seconds, the least need and the least joules. They may
        belong to different orders.
    best, best_end
        Seconds, need and joules of the order with the least need, and the place where it ends.
    early_s
        For each member of the pool: how long before the end of that order it is served.
    """

    ends: Longs
    least: Floats
    best: Floats
    best_end: int
    early_s: tuple[float, ...]


class Estimates:
    """Distances between the places of a problem, and estimates of trips of each model."""

    def __init__(
        self,
        problem: FleetProblem,
        models: Sequence[DroneModel],
        *,
        sharing: Sharing,
        may_fly: Callable[[int, Pool], bool] = lambda _kind, _pool: True,
    ) -> None:
        self._problem = problem
        self._sharing = sharing
        self._may_fly = may_fly
        self.models = models
        self.places = _places(problem)
        self.place_of: Mapping[StationId, int] = {
            each: number for number, each in enumerate(self.places)
        }
        self.apart_m = _apart_m(problem.network, self.places)
        # No pad of the network charges faster than the strongest.
        strongest_w = problem.network.pad_powers.steps_w[0]
        self.s_per_j = [
            fastest_s_per_soc(model_on_pad(each, strongest_w)) / each.battery_j for each in models
        ]
        self._approaches = [self._flights(kind, self.apart_m) for kind in range(len(models))]
        self._detours_m = [self._detour_m(each) for each in models]
        self._escapes_s = [self._escape_s(each) for each in range(len(models))]
        self._source_of: dict[Pool, StationId] = {}
        self._found: dict[tuple[StationId, int, Pool], TripEstimate] = {}

    def approach(self, kind: int) -> Floats:
        """``(places, places, 3)``: seconds, need and joules of the empty flight."""
        return self._approaches[kind]

    def _flights(self, kind: int, apart_m: Floats) -> Floats:
        """Seconds, need and joules of empty flights of these lengths."""
        model = self.models[kind]
        s_per_m = 1.0 / model.speed_empty_mps
        is_apart = apart_m > 0
        seconds = apart_m * s_per_m + np.where(is_apart, model.stop_s, 0.0)
        joules = apart_m * s_per_m * model.power_empty_w
        joules += np.where(is_apart, model.stop_j, 0.0)
        approach = np.stack([seconds, seconds + joules * self.s_per_j[kind], joules], axis=-1)
        return np.minimum(approach, OUT_OF_REACH)

    def detour(self, kind: int) -> Floats:
        """The same as `approach`, if the drone passes a pad on its way."""
        return self._flights(kind, self._detours_m[kind])

    def _detour_m(self, model: DroneModel) -> Floats:
        """``(places, places)``: metres between places if the drone passes a pad that fits it."""
        network = self._problem.network.fitting(model.connector)
        pads = np.flatnonzero(network.columns.pads > 0)
        rows = np.array([network.row_of[each] for each in self.places], np.int64)
        there_m, back_m = (
            np.array(
                [
                    lengths_from(
                        way.offsets, way.station, way.length_m, row, pads, len(network.stations)
                    )
                    for row in rows
                ]
            )
            for way in (network.outgoing, network.incoming)
        )
        detour_m = (there_m[:, None] + back_m).min(axis=2, initial=np.inf)
        # Sums in another order differ by less than a millimetre.
        return np.where(detour_m <= self.apart_m + 1e-3, self.apart_m, detour_m)

    def _escape_s(self, kind: int) -> Floats:
        model, network = self.models[kind], self._problem.network
        away_m = to_pad_m(network.fitting(model.connector))
        j_per_m = model.power_empty_w / model.speed_empty_mps
        own_m = away_m[[network.row_of[each] for each in self.places]]
        return np.minimum(own_m * j_per_m * self.s_per_j[kind], OUT_OF_REACH)

    def pickups(self, pool: Pool) -> tuple[StationId, ...]:
        """The stations where the trip of these requests may be loaded."""
        return pickups_of([self._problem.requests[each] for each in pool])

    def source(self, pool: Pool) -> StationId:
        """The tried pickup from which the first model serves these requests soonest."""
        if pool not in self._source_of:
            pickups = self._sharing.pickups(pool)
            self._source_of[pool] = min(
                pickups, key=lambda each: float(self.trip_from(each, 0, pool).best[SECONDS])
            )
        return self._source_of[pool]

    def trip(self, kind: int, pool: Pool) -> TripEstimate:
        """The estimate of the trip that serves these requests from `source`."""
        return self.trip_from(self.source(pool), kind, pool)

    def trip_from(self, source: StationId, kind: int, pool: Pool) -> TripEstimate:
        """The estimate of the trip that serves these requests from this pickup."""
        key = (source, kind, pool)
        found = self._found.get(key)
        if found is None:
            found = self._found[key] = self._estimated(source, kind, pool)
        return found

    def soonest(self, kind: int, pool: Pool) -> list[tuple[float, float]]:
        """For each member: seconds and need from the pickup to its last hand-over, if it is first.

        No order of the destinations serves the member sooner.
        """
        problem, model = self._problem, self.models[kind]
        requests = [problem.requests[each] for each in pool]
        here = self.place_of[self.source(pool)]
        load_kg = sum(each.mass_kg for each in requests)
        if not _can_lift(model, load_kg) or not self._may_fly(kind, pool):
            return [(OUT_OF_REACH, OUT_OF_REACH)] * len(pool)
        pace, power_w = 1.0 / speed_mps(model, load_kg), flight_power_w(model, load_kg)
        found = []
        for each in requests:
            away_m = max(
                float(self.apart_m[here, self.place_of[one.destination]]) for one in each.packages
            )
            flight_s = away_m * pace
            flown_j = flight_s * power_w
            seconds = problem.loading_s + problem.dropoff_s + flight_s
            if away_m > 0:
                seconds, flown_j = seconds + model.stop_s, flown_j + model.stop_j
            need = seconds + flown_j * self.s_per_j[kind]
            found.append((min(seconds, OUT_OF_REACH), min(need, OUT_OF_REACH)))
        return found

    def credit_s(self, kind: int, soc: float) -> float:
        """The part of the need that this charge covers until the reserve is reached."""
        model = self.models[kind]
        return (soc - model.reserve_soc) * model.battery_j * self.s_per_j[kind]

    def least_s_from(self, source: StationId, kind: int, pool: Pool, *, start: Slot) -> float:
        """The least seconds of a trip that is loaded at this pickup."""
        trip = self.trip_from(source, kind, pool)
        approach = self._approaches[kind][self.place_of[start.station_id], self.place_of[source]]
        seconds, need, _ = approach
        credit_s = self.credit_s(kind, start.soc)
        least = trip.least.min(axis=0)
        return float(max(seconds + least[SECONDS], need + least[NEED] - credit_s))

    def orders(self, source: StationId, kind: int, pool: Pool) -> StopOrders:
        """The orders in which a trip from this pickup may serve these requests.

        With many destinations all orders with the same end become one. It has the least seconds and
        needs of them all. It serves the members with this end then, and each other member as soon
        as a trip that carries its packages alone.
        """
        requests = [self._problem.requests[each] for each in pool]
        masses, loading_s = self._after_loading(source, requests)
        places = [self.place_of[each] for each in masses]
        here = self.place_of[source]
        if len(places) > MOST_ORDERED or not self._may_fly(kind, pool):
            trip = self.trip_from(source, kind, pool)
            alone = [
                self.trip_from(source, kind, (each,)).least[:, :2].min(axis=0) for each in pool
            ]
            last = [[self.place_of[one.destination] for one in each.packages] for each in requests]
            is_last = np.array([np.isin(trip.ends, each) for each in last]).T
            served = np.where(is_last[..., None], trip.least[:, None, :2], np.array(alone))
            ready_s = np.repeat(self._escapes_s[kind][here], len(trip.ends))
            return StopOrders(trip.ends, trip.least, served, ready_s)
        if not places:
            least, served = (
                np.array([[loading_s, loading_s, 0.0]]),
                np.full((1, len(pool), 2), loading_s),
            )
            return StopOrders(np.array([here]), least, served, self._escapes_s[kind][[here]])
        model, number_of = self.models[kind], {each: number for number, each in enumerate(masses)}
        ends = [{one.destination for one in each.packages} for each in requests]
        stops = Stops(
            np.array(places, np.int64),
            [[number_of[one] for one in each if one in number_of] for each in ends],
            self.apart_m[np.ix_([*places, here], places)],
            self._detours_m[kind][np.ix_([*places, here], places)],
            *_rates(model, list(masses.values())),
            np.array([self._problem.dropoff_s + model.stop_s, model.stop_j]),
            self._escapes_s[kind][[*places, here]],
        )
        return orders_of(stops, loading_s=loading_s, s_per_j=self.s_per_j[kind])

    def _after_loading(
        self, source: StationId, requests: Sequence[FleetRequest]
    ) -> tuple[dict[StationId, float], float]:
        """The mass for each destination but the pickup, and how long the drone is at the pickup."""
        masses = _masses_by_destination(requests)
        if masses.pop(source, None) is None:
            return masses, self._problem.loading_s
        return masses, self._problem.loading_s + self._problem.dropoff_s

    def _estimated(self, source: StationId, kind: int, pool: Pool) -> TripEstimate:
        problem, model = self._problem, self.models[kind]
        requests = [problem.requests[each] for each in pool]
        if not self._may_fly(kind, pool):
            here, never = self.place_of[source], np.full(3, OUT_OF_REACH)
            return TripEstimate(np.array([here]), never[None, :], never, here, (0.0,) * len(pool))
        masses, loading_s = self._after_loading(source, requests)
        rows = np.array([self.place_of[each] for each in masses], np.int64)
        if not len(rows):
            both = np.array([loading_s, loading_s, 0.0])
            here = self.place_of[source]
            zeros = (0.0,) * len(pool)
            return TripEstimate(np.array([here]), both[None, :], both, here, zeros)
        least, best, served_s = np.empty((len(rows), 3)), np.empty(3), np.empty(len(rows))
        s_per_m, j_per_m = _rates(model, list(masses.values()))
        from_rows = np.append(rows, self.place_of[source])
        end = estimate_trip(
            self.apart_m[np.ix_(from_rows, rows)],
            s_per_m,
            j_per_m,
            np.array([problem.dropoff_s + model.stop_s, model.stop_j]),
            self.s_per_j[kind],
            least,
            best,
            served_s,
        )
        least[:, SECONDS] += loading_s
        least[:, NEED] += loading_s
        np.minimum(least, OUT_OF_REACH, out=least)
        early_s = tuple(
            _early_s(each, dict(zip(masses, served_s, strict=True))) for each in requests
        )
        best += np.array([loading_s, loading_s, 0.0])
        best = np.minimum(best, OUT_OF_REACH)
        return TripEstimate(rows, least, best, int(rows[end]), early_s)


def _early_s(request: FleetRequest, served_s: Mapping[StationId, float]) -> float:
    last_s = max(served_s.get(each.destination, 0.0) for each in request.packages)
    return max(served_s.values()) - last_s


def _masses_by_destination(requests: Iterable[FleetRequest]) -> dict[StationId, float]:
    masses: dict[StationId, float] = {}
    for request in requests:
        for each in request.packages:
            masses[each.destination] = masses.get(each.destination, 0.0) + each.mass_kg
    return masses


def _rates(model: DroneModel, masses_kg: Sequence[float]) -> tuple[Floats, Floats]:
    """Seconds and joules per metre by the set of destinations that are served."""
    s_per_m, j_per_m = [], []
    for served in range(1 << len(masses_kg)):
        load_kg = math.fsum(
            mass for number, mass in enumerate(masses_kg) if not served >> number & 1
        )
        pace = 1.0 / speed_mps(model, load_kg) if _can_lift(model, load_kg) else OUT_OF_REACH
        s_per_m.append(pace)
        j_per_m.append(pace * flight_power_w(model, load_kg))
    return np.array(s_per_m), np.array(j_per_m)


def _can_lift(model: DroneModel, load_kg: float) -> bool:
    return load_kg <= model.max_payload_kg + LOAD_TOLERANCE_KG


def _places(problem: FleetProblem) -> tuple[StationId, ...]:
    """Every station where a drone is free, or where packages are picked up or handed over."""
    found = dict.fromkeys(each.station_id for each in problem.drones)
    for request in problem.requests:
        found.update(dict.fromkeys((request.source, *request.pickups)))
        found.update(dict.fromkeys(each.destination for each in request.packages))
    return tuple(found)


def _apart_m(network: Network, places: Sequence[StationId]) -> Floats:
    rows = np.array([network.row_of[each] for each in places], np.int64)
    away = network.outgoing
    count = len(network.stations)
    return np.array(
        [lengths_from(away.offsets, away.station, away.length_m, row, rows, count) for row in rows]
    )
