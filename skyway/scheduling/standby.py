"""Where a drone goes and charges after its last hand-over.

A standby may be at home, where the drone stands, at a parking station, or near the next pickup. The
search says to which station a trip is to be planned next. Its caller plans the trip and answers
with it. So the same search serves a service, which awaits its planner, and an experiment.
"""

from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np

from skyway.contracts.candidate import Candidate, Standby
from skyway.delivery.plan import Plan, Recharge
from skyway.drone.charging import model_on_pad, recharge_time_s
from skyway.drone.model import DroneModel
from skyway.ids import DroneId, ProviderId, StationId
from skyway.network.columns import Rows
from skyway.network.great_circle import distances_m
from skyway.network.network import Network
from skyway.planner.pad_book import PadBook, booked_until_ms
from skyway.planner.pad_calendar import PadCalendar
from skyway.planner.problem import DroneAtStart, Problem
from skyway.scheduling.repositioning import places_to_wait
from skyway.scheduling.stays import Slot, stay_to_begin_at, stays_of_standby
from skyway.scheduling.trip import NoTrip, Trip, no_plan, shortened_trip, soc_after
from skyway.units import CHARGE_TOLERANCE

#: How many near stations with pads are tried. Our own choice.
_MOST_ENDS: Final = 3

#: A drone goes near the next pickup only if its pad there is free so soon after it has landed,
#: seconds: ten minutes. Our own choice.
_LONGEST_PAD_WAIT_S: Final = 600.0

#: How many near parking stations are compared by their plans. Our own choice.
_MOST_PARKING: Final = 3


@dataclass(frozen=True, slots=True)
class StandbyChoice:
    """A drone's standby setting, and its home station.

    With NEXT_PICKUP it has the `drone` and its provider, whose requests say where the next pickup
    is expected, and then the `places` that are worth the way, the best first.
    """

    standby: Standby
    home_station_id: StationId
    drone: tuple[ProviderId, DroneId] | None = None
    places: tuple[StationId, ...] = ()

    @classmethod
    def of(cls, candidate: Candidate) -> Self:
        """The choice of a candidate."""
        seeks = candidate.standby == "NEXT_PICKUP"
        drone = (candidate.provider_id, candidate.drone_id) if seeks else None
        return cls(candidate.standby, candidate.home_station_id, drone)

    def at_home(self) -> Self:
        """The choice of a drone that an operator calls home."""
        return replace(self, standby="HOME", drone=None)

    def near(
        self,
        pickups: Mapping[StationId, float],
        network: Network,
        *,
        start: StationId,
        waiting: Mapping[StationId, int],
    ) -> Self:
        """The choice with its places near the next pickups; as HOME if no pickup is expected.

        The arguments are those of `places_to_wait`. If no place is worth the way, the drone stays.
        """
        otherwise = next(self.in_turn(network, start), None)
        if not pickups or otherwise is None:
            return self.at_home()
        places = places_to_wait(network, pickups, waiting=waiting, start=start, otherwise=otherwise)
        return replace(self, places=places)

    def is_home(self, station_id: StationId) -> bool:
        """Whether the drone flies home, and this is its home; a home may have no pads."""
        return self.standby == "HOME" and station_id == self.home_station_id

    def to_compare(self, network: Network, start: StationId) -> Iterator[StationId]:
        """The ends of which the best plan wins: the nearest parking stations, for PARKING."""
        if self.standby == "PARKING":
            parking = np.array(sorted(network.columns.parking), np.int32)
            yield from _nearest(network, start, among=parking, most=_MOST_PARKING)

    def in_turn(self, network: Network, start: StationId) -> Iterator[StationId]:
        """The ends of which the first possible one counts: home, and the nearest with pads.

        Home comes first for HOME, and last otherwise. A drone that stands at a station with pads
        is nearest to that station.
        """
        has_home = self.home_station_id in network.row_of
        if has_home and self.standby == "HOME":
            yield self.home_station_id
        with_pads = np.flatnonzero(network.columns.pads > 0).astype(np.int32)
        yield from _nearest(network, start, among=with_pads, most=_MOST_ENDS)
        if has_home and self.standby != "HOME":
            yield self.home_station_id


def _nearest(network: Network, start: StationId, *, among: Rows, most: int) -> Iterator[StationId]:
    """The nearest of the stations in these rows, by the great circle."""
    columns = network.columns
    here = np.full(len(among), network.row_of[start])
    away_m = distances_m(
        (columns.longitude_deg[here], columns.longitude_deg[among]),
        (columns.latitude_deg[here], columns.latitude_deg[among]),
    )
    nearest = among[np.argsort(away_m, kind="stable")[:most]]
    yield from (columns.station_ids[row] for row in nearest.tolist())


def standby_for(ready: Slot) -> StandbyChoice:
    """The standby of a drone that must be ready there: it flies there and charges."""
    return StandbyChoice("HOME", ready.station_id)


#: Yields the station of each standby to try, takes the trip to it, and returns the best trip.
StandbySearch = Generator[StationId, Trip | NoTrip, Trip | NoTrip]


def search_standby(
    choice: StandbyChoice, network: Network, *, start: StationId, drone: DroneAtStart
) -> StandbySearch:
    """Search for the best end that the drone reaches, and where it charges if one has a pad.

    `drone` is the drone at the end of its plan, which is at `start`.
    """
    network = network.fitting(drone.model.connector)
    for end in choice.places:
        trip = yield end
        if isinstance(trip, Trip) and _has_free_pad(trip, drone):
            return trip
    charged: list[Trip] = []
    for end in choice.to_compare(network, start):
        trip = yield end
        if isinstance(trip, Trip) and _is_charged(trip, drone):
            charged.append(trip)
    if charged:
        return min(charged, key=lambda each: each.released_ms)
    uncharged: Trip | None = None
    reason: NoTrip | None = None
    for end in choice.in_turn(network, start):
        trip = yield end
        if isinstance(trip, NoTrip):
            reason = reason or trip
        elif choice.is_home(end) or _is_charged(trip, drone):
            return trip
        else:
            uncharged = uncharged or trip
    detail = f"home station {choice.home_station_id!r} is not in this network, and no pad is near"
    return uncharged or reason or NoTrip("NO_WAY_HOME", detail, is_temporary=False)


def run_search(
    search: StandbySearch, trip_to: Callable[[StationId], Trip | NoTrip]
) -> Trip | NoTrip:
    """The result of a search, whose trips `trip_to` plans."""
    try:
        end = next(search)
        while True:
            end = search.send(trip_to(end))
    except StopIteration as found:
        trip: Trip | NoTrip = found.value
        return trip


def home_start_ms(plan: Plan, *, start_ms: int) -> int:
    """The moment from which the seconds of a standby count: the end of the plan before it."""
    return start_ms + booked_until_ms(plan.delivery_time_s or 0.0)


def trip_by_way_home(
    plan: Plan,
    problem: Problem,
    home_plan: Plan,
    *,
    start_ms: int,
    booked: PadBook,
    pad_gap_ms: int,
) -> Trip | NoTrip:
    """The trip of a plan that begins at `start_ms`, and of its standby.

    Parameters
    ----------
    problem, home_plan
        The flight to where the drone stands by, and its plan.
    booked
        The reservations of other drones, in seconds since the standby's start, beside those of the
        problem itself.
    """
    if not home_plan.is_flyable:
        reason = no_plan(home_plan)
        end = problem.packages[0].destination
        detail = f"from {problem.source!r} to {end!r}: {reason.detail}"
        return NoTrip("NO_WAY_HOME", detail, is_temporary=reason.is_temporary)
    return Trip(
        start_ms=start_ms,
        plan=plan,
        home_start_ms=home_start_ms(plan, start_ms=start_ms),
        home_plan=home_plan,
        home_recharge=_recharge_at_end(problem, home_plan, booked),
        pad_gap_ms=pad_gap_ms,
    )


def _is_charged(trip: Trip, drone: DroneAtStart) -> bool:
    """Whether the drone is charged to its top at the end of this trip."""
    if trip.home_recharge is not None:
        return True
    return _is_top(drone.model, soc_after(trip.home_plan, drone.soc))


def _has_free_pad(trip: Trip, drone: DroneAtStart) -> bool:
    """Whether the drone is charged at the end of this trip, and need not wait long for its pad."""
    arrived_s = trip.home_plan.delivery_time_s or 0.0
    recharge = trip.home_recharge
    is_soon = recharge is None or recharge.start_s <= arrived_s + _LONGEST_PAD_WAIT_S
    return is_soon and _is_charged(trip, drone)


def _is_top(model: DroneModel, soc: float) -> bool:
    return soc >= model.top_soc - CHARGE_TOLERANCE


def _recharge_at_end(problem: Problem, home_plan: Plan, booked: PadBook) -> Recharge | None:
    """The earliest session that charges the drone to its top; None if not needed or no pad."""
    model, station_id = problem.drone.model, problem.packages[0].destination
    soc = soc_after(home_plan, problem.drone.soc)
    if _is_top(model, soc):
        return None
    network = problem.network.fitting(model.connector)
    power_w = network.pad_powers.limited_w.get(station_id)
    duration_s = recharge_time_s(model_on_pad(model, power_w), soc, model.top_soc)
    arrived_s = home_plan.delivery_time_s or 0.0
    own = PadBook.of(problem.network, problem.pad_reservations)
    session = PadCalendar(network, [own, booked]).earliest_session(
        station_id, not_before_s=arrived_s, duration_s=duration_s
    )
    if session is None:
        return None
    return Recharge(
        station_id=station_id,
        pad=session.pad,
        start_s=session.start_s,
        end_s=session.start_s + duration_s,
        soc_start=soc,
        soc_end=model.top_soc,
        power_w=power_w,
    )


def fitted(trip: Trip, *, soc: float, ready: Slot) -> Trip | None:
    """The trip with its standby ended when the drone must be ready; None if it is not ready then.

    Parameters
    ----------
    trip
        A trip whose standby is that of `standby_for`.
    soc
        State of charge at its start, in [0, 1].
    ready
        Where, when and with what charge the drone must be ready.
    """
    stays = stays_of_standby(
        trip.plan,
        start_ms=trip.start_ms,
        soc=soc,
        home_plan=trip.home_plan,
        home_recharge=trip.home_recharge,
    )
    stay = stay_to_begin_at(stays, ready, not_left_before_ms=trip.start_ms)
    if stay is None:
        return None
    return shortened_trip(trip, ready.at_ms)
