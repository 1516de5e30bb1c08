"""Several cities that share no station: each is a network, and may have a cell of its own."""

import random
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final, Self

from skyway_lab.benchmarks.load.city import City, DueRequest

from skyway.network.geojson import read_network, write_network

#: The members of a feature that name stations.
_NAMES: Final = ("station_id", "from", "to")


@dataclass(frozen=True, slots=True)
class Regions:
    """A `Place` of several networks; drones and requests are spread evenly over them."""

    cities: Mapping[str, City]

    @classmethod
    def of(cls, count: int, *, stations: int, seed: int) -> Self:
        """So many regions, with this number of stations together."""
        names = [f"region-{number}" for number in range(1, count + 1)]
        return cls({each: _named(each, stations // count, seed=seed) for each in names})

    def documents(self) -> Mapping[str, dict[str, Any]]:
        """The GeoJSON of each region, by its network's id. Any: JSON of every kind."""
        return {name: write_network(city.network) for name, city in self.cities.items()}

    def tariff(self, number: int) -> dict[str, Any]:
        """What the provider of this number asks."""
        return next(iter(self.cities.values())).tariff(number)

    def fleet(self, number: int, *, providers: int, drones: int) -> list[dict[str, Any]]:
        """The drones of one provider, as many in each region."""
        per_region = drones // len(self.cities)
        return [
            drone
            for city in self.cities.values()
            for drone in city.fleet(number, providers=providers, drones=per_region)
        ]

    def requests(self, *, rate_per_s: float, seconds: float, seed: int) -> Iterator[DueRequest]:
        """A Poisson stream of requests, each in a region by chance."""
        chance = random.Random(seed)
        cities = list(self.cities.values())
        at_s = chance.expovariate(rate_per_s)
        while at_s < seconds:
            yield DueRequest(at_s, chance.choice(cities).request(chance))
            at_s += chance.expovariate(rate_per_s)


def _named(region: str, stations: int, *, seed: int) -> City:
    """The synthetic city of this size, whose stations bear the name of the region."""
    document = write_network(City.of(stations=stations, seed=seed).network)
    for feature in document["features"]:
        names = feature["properties"]
        names.update({each: f"{region}-{names[each]}" for each in _NAMES if each in names})
    return City.on(read_network(document))
