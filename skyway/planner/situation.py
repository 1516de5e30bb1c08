"""A problem prepared for search: values that every strategy reads often, computed once."""

import heapq
import math
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from itertools import count

from skyway.drone.charging import model_on_pad
from skyway.drone.flight import flight_energy_j, flight_time_s
from skyway.drone.model import DroneModel
from skyway.errors import InvalidProblem
from skyway.ids import StationId
from skyway.network.network import Network, Segment
from skyway.planner.airspace import Airspace
from skyway.planner.closures import Closures
from skyway.planner.hierarchy import Hierarchy
from skyway.planner.pad_book import NO_RESERVATIONS, PadBook
from skyway.planner.pad_calendar import PadCalendar
from skyway.planner.problem import PackageToDeliver, Problem
from skyway.planner.weather import STILL_AIR, Air
from skyway.planner.windows import Windows


@dataclass(slots=True)
class Situation:
    """A problem, its closures and its pad calendar, with short names for its parts."""

    problem: Problem
    closures: Closures
    #: Reservations of pads: the problem's own, and the booked ones.
    books: tuple[PadBook, PadBook]
    #: Distances prepared for the whole network, None without.
    hierarchy: Hierarchy | None = None
    #: When packages may change hands.
    windows: Windows = field(default_factory=Windows)
    #: The network, whole, without pads that do not fit the drone.
    network: Network = field(init=False)
    pads: PadCalendar = field(init=False)
    #: Distinct destinations apart from the source, in the order in which packages name them.
    destinations: tuple[StationId, ...] = field(init=False)
    _pad_stations: dict[StationId, bool] = field(init=False, default_factory=dict)
    _finish_j: dict[StationId, float] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self.network = self.problem.network.fitting(self.model.connector)
        self.pads = PadCalendar(self.network, self.books)
        named = dict.fromkeys(package.destination for package in self.problem.packages)
        self.destinations = tuple(
            station_id for station_id in named if station_id != self.problem.source
        )

    @classmethod
    def of(
        cls,
        problem: Problem,
        airspace: Airspace,
        booked: PadBook = NO_RESERVATIONS,
        *,
        hierarchy: Hierarchy | None = None,
    ) -> "Situation":
        """The situation of this problem, with booked reservations beside its own."""
        given = NO_RESERVATIONS
        if problem.pad_reservations:
            given = PadBook.of(problem.network, problem.pad_reservations)
        closures = Closures.of(problem, airspace)
        if problem.weather is not None:
            # The distances of a hierarchy hold in still air alone.
            hierarchy = None
        if hierarchy is not None:
            hierarchy = hierarchy.fitting(problem.drone.model.connector)
        return cls(problem, closures, (given, booked), hierarchy, Windows.of(problem))

    @property
    def model(self) -> DroneModel:
        """The drone's model."""
        return self.problem.drone.model

    @property
    def fastest_model(self) -> DroneModel:
        """The drone's model with its charge curve at the network's strongest pads."""
        return model_on_pad(self.model, self.network.pad_powers.steps_w[0])

    def pad_power_w(self, station_id: StationId) -> float | None:
        """The power that each pad of this station gives, watts; None without a limit."""
        return self.network.pad_powers.limited_w.get(station_id)

    @property
    def capacity_j(self) -> float:
        """The most that can be flown from one pad to the next."""
        return (self.model.top_soc - self.model.reserve_soc) * self.model.battery_j

    def packages_for(self, station_id: StationId) -> tuple[PackageToDeliver, ...]:
        """The packages for this station."""
        return tuple(
            package for package in self.problem.packages if package.destination == station_id
        )

    def load_kg(self, undelivered: AbstractSet[StationId]) -> float:
        """The load while these destinations wait; summed each time, so that no rounding adds up."""
        return math.fsum(
            package.mass_kg
            for package in self.problem.packages
            if package.destination in undelivered
        )

    def flight_s(self, segment: Segment, load_kg: float, *, air: Air = STILL_AIR) -> float:
        """Time to fly this segment with this load."""
        length_m = segment.length_m * air.time_factor
        return flight_time_s(self.model, length_m=length_m, load_kg=load_kg)

    def flight_j(self, segment: Segment, load_kg: float, *, air: Air = STILL_AIR) -> float:
        """Energy to fly this segment with this load."""
        length_m = segment.length_m * air.time_factor
        energy_j = flight_energy_j(self.model, length_m=length_m, load_kg=load_kg)
        return energy_j * air.energy_factor

    def refuse_weather(self) -> None:
        """Refuse a problem with weather, for strategies that plan in still air.

        Raises
        ------
        InvalidProblem
            The problem has weather.
        """
        if self.problem.weather is not None:
            detail = "this strategy plans in still air only; the strategy 'exact' knows weather"
            raise InvalidProblem("weather", detail)

    def has_free_pad(self, station_id: StationId) -> bool:
        """Whether one of the station's pads is ever free."""
        return bool(self.pads.free_windows(station_id))

    def can_land_to_recharge(self, station_id: StationId) -> bool:
        """Whether a pad there is ever free, and the station not closed for good."""
        known = self._pad_stations.get(station_id)
        if known is None:
            known = self.has_free_pad(station_id) and not self.closures.is_closed_for_good(
                station_id
            )
            self._pad_stations[station_id] = known
        return known

    def finish_j(self, station_id: StationId) -> float:
        """Energy that must be left after a last delivery here, above the reserve.

        Infinite when the finish needs a pad and no pad is in reach.
        """
        if self.problem.finish == "stay":
            return 0.0
        known = self._finish_j.get(station_id)
        if known is None:
            known = self._finish_j[station_id] = energy_to_pad_j(
                self.network, self.model, station_id
            )
        return known


def energy_to_pad_j(network: Network, model: DroneModel, start: StationId) -> float:
    """Energy of the empty flight to the nearest station with a pad, taken or not.

    Infinite if no full battery reaches one. Zones, closures and the landing itself do not count
    (docs/reference/planner-problem.md).
    """
    # With one speed and one power the path of least energy is the shortest path.
    tie_breaker = count()
    heap = [(0.0, next(tie_breaker), start)]
    settled: set[StationId] = set()
    while heap:
        length_m, _, here = heapq.heappop(heap)
        if here in settled:
            continue
        energy_j = flight_energy_j(model, length_m=length_m, load_kg=0.0)
        if network.stations[here].pads > 0:
            return energy_j
        # Where the pads fit no drone of this kind, the whole network would be searched.
        if energy_j > model.battery_j:
            return math.inf
        settled.add(here)
        for segment in network.segments_from(here):
            if segment.to_id not in settled:
                reached_m = length_m + segment.length_m
                heapq.heappush(heap, (reached_m, next(tie_breaker), segment.to_id))
    return math.inf
