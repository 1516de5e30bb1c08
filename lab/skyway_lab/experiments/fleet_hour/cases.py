"""Seeded cases: a network with one pad a station, drones at home, and one hour of requests."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from random import Random
from typing import Final, Literal

import numpy as np

from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.geo import distance_m
from skyway.ids import StationId
from skyway.network.bundled import texas_corridor
from skyway.network.network import Network
from skyway.network.synthetic import synthetic_city
from skyway.planner.problem import PackageToDeliver
from skyway.scheduling.repositioning import PastRequest
from skyway.units import hours_to_s
from skyway_lab.experiments.instances import Setting, chance, connected_to, packages_for

#: Where packages come from: any station of a city, any place of the Texas corridor, or the most
#: central stations of a city.
Place = Literal["city", "corridor", "hub", "three hubs"]

PLACES: Final[tuple[Place, ...]] = ("city", "corridor", "hub", "three hubs")

#: Requests come within this time, milliseconds.
HOUR_MS: Final = round(hours_to_s(1) * 1000)

_DAY_MS: Final = 24 * HOUR_MS

#: The cities: their stations and the side of a station's share of the area. Our own choice.
_STATIONS, _SPACING_M, _DEGREE = 40, 5_000.0, 5.0

_HUBS: Final = {"hub": 1, "three hubs": 3}

#: Packages go at most this far, straight, if two stations are so near. Our own choice.
_FARTHEST_M: Final = 25_000.0

#: A request has up to this many packages. Our own choice.
_MOST_PACKAGES: Final = 2


@dataclass(frozen=True, slots=True)
class Load:
    """How many drones serve how many requests of one hour."""

    drones: int
    requests: int

    def __str__(self) -> str:
        return f"{self.drones} drones, {self.requests} requests"


@dataclass(frozen=True, slots=True)
class HourRequest:
    """A customer's request; `asked_ms` and windows of packages count from the start of the hour."""

    number: int
    asked_ms: int
    source: StationId
    packages: tuple[PackageToDeliver, ...]


@dataclass(frozen=True, slots=True)
class Case:
    """A network, the home of each drone, and the requests in the order of asking.

    `past` are requests of earlier days, for drones that wait near the next pickup.
    """

    network: Network
    homes: tuple[StationId, ...]
    requests: tuple[HourRequest, ...]
    past: tuple[PastRequest, ...] = ()


def draw_case(place: Place, load: Load, *, seed: int) -> Case:
    """The case that this seed draws."""
    random = chance(f"{seed}/hour")
    network, stations = _network(place, seed=seed)
    homes = tuple(_spread(stations, load.drones, random=random))
    customers = _customers(place, network, stations)
    return Case(network, homes, tuple(customers.requests(load.requests, random=random)))


def draw_day(place: Place, load: Load, *, seed: int, hours: float, days_before: int) -> Case:
    """The same case with its requests spread over so many hours, after days of such requests."""
    case = draw_case(place, load, seed=seed)
    random = chance(f"{seed}/days before")
    _, stations = _network(place, seed=seed)
    customers = _customers(place, case.network, stations)
    past = [
        PastRequest(each.source, round(each.asked_ms * hours) - day * _DAY_MS)
        for day in range(days_before, 0, -1)
        for each in customers.requests(load.requests, random=random)
    ]
    requests = (replace(each, asked_ms=round(each.asked_ms * hours)) for each in case.requests)
    return replace(case, requests=tuple(requests), past=tuple(past))


def _network(place: Place, *, seed: int) -> tuple[Network, list[StationId]]:
    """The network, and its stations that can be served."""
    if place == "corridor":
        # Its segments avoid the airports' discs already, so the zones would only cost time.
        columns = texas_corridor().columns
        one_pad = replace(columns, pads=np.ones_like(columns.pads))
        network = Network.from_columns(one_pad)
        return network, connected_to(network, StationId("san-marcos"))
    network = synthetic_city(
        stations=_STATIONS, seed=seed, pads=1, degree=_DEGREE, spacing_m=_SPACING_M
    )
    return network, list(network.stations)


def _customers(place: Place, network: Network, stations: Sequence[StationId]) -> "_Customers":
    """Where the customers of a place are."""
    hubs = _central(network, count=_HUBS[place]) if place in _HUBS else stations
    return _Customers(network, hubs, stations)


def _central(network: Network, *, count: int) -> list[StationId]:
    """The most central station; of several, each is the most central of its part of the city."""
    columns = network.columns
    parts = np.array_split(np.argsort(columns.longitude_deg, kind="stable"), count)
    return [columns.station_ids[_middle(network, part)] for part in parts]


def _middle(network: Network, rows: np.ndarray[tuple[int], np.dtype[np.intp]]) -> int:
    """The row with the least sum of distances to these rows."""
    positions = [network.stations[network.columns.station_ids[row]].position for row in rows]
    apart_m = np.array([[distance_m(one, other) for other in positions] for one in positions])
    return int(rows[apart_m.sum(axis=1).argmin()])


def _spread(stations: Sequence[StationId], count: int, *, random: Random) -> list[StationId]:
    """So many stations; none comes again before each other one has come as often."""
    found: list[StationId] = []
    while len(found) < count:
        found += random.sample(list(stations), len(stations))
    return found[:count]


@dataclass(frozen=True, slots=True)
class _Customers:
    """Where customers' packages come from, and which stations can be served."""

    network: Network
    sources: Sequence[StationId]
    stations: Sequence[StationId]

    def requests(self, count: int, *, random: Random) -> list[HourRequest]:
        """So many requests at random moments of the hour, in the order of asking."""
        moments_ms = sorted(random.randrange(HOUR_MS) for _ in range(count))
        return [
            self._request(number, asked_ms, random=random)
            for number, asked_ms in enumerate(moments_ms)
        ]

    def _request(self, number: int, asked_ms: int, *, random: Random) -> HourRequest:
        source = random.choice(self.sources)
        destinations = random.sample(self._near(source), random.randint(1, _MOST_PACKAGES))
        packages = packages_for(destinations, Setting(model=DJI_MATRICE_300_RTK), random=random)
        return HourRequest(number, asked_ms, source, packages)

    def _near(self, source: StationId) -> list[StationId]:
        """The stations to which packages go: those within the limit, or the nearest ones."""
        here = self.network.stations[source].position
        away_m = {
            each: distance_m(here, self.network.stations[each].position)
            for each in self.stations
            if each != source
        }
        by_distance = sorted(away_m, key=lambda each: (away_m[each], each))
        within = [each for each in by_distance if away_m[each] <= _FARTHEST_M]
        return within if len(within) >= _MOST_PACKAGES else by_distance[:_MOST_PACKAGES]
