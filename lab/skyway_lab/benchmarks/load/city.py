"""The city and what happens in it: drones that reach far, requests that stay near, all by seed."""

import json
import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

import numpy as np

from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.ids import StationId
from skyway.network.geojson import write_network
from skyway.network.network import Network
from skyway.network.synthetic import synthetic_city

NETWORK_ID: Final = "city"
#: Metres between stations, about: a flight between neighbours takes two minutes of fleet time.
_SPACING_M: Final = 3_000.0
#: Pads per station: the two drones at home there recharge after each mission, others pass.
_PADS: Final = 4
#: Most segments between a pickup and a destination.
_NEAR: Final = 2
#: Shares of requests with one, two and three packages.
_PACKAGES: Final = ((1, 2, 3), (0.7, 0.2, 0.1))
_MASS_KG: Final = (0.1, 0.8)
_OBJECTIVES: Final = (("FASTEST", "CHEAPEST", "GREENEST"), (0.8, 0.1, 0.1))


@dataclass(frozen=True, slots=True)
class DueRequest:
    """A request and when it is sent, wall seconds after the burst began."""

    at_s: float
    body: bytes


class Place(Protocol):
    """Where a benchmark delivers: one city, or several regions."""

    def documents(self) -> Mapping[str, dict[str, Any]]:
        """The GeoJSON of each network to publish, by its id. Any: JSON of every kind."""
        ...

    def tariff(self, number: int) -> dict[str, Any]:
        """What the provider of this number asks."""
        ...

    def fleet(self, number: int, *, providers: int, drones: int) -> list[dict[str, Any]]:
        """The drones of one provider."""
        ...

    def requests(self, *, rate_per_s: float, seconds: float, seed: int) -> Iterator[DueRequest]:
        """A Poisson stream of local requests."""
        ...


@dataclass(frozen=True, slots=True)
class City:
    """A network, its stations with drones and customers, and the stations near each station."""

    network: Network
    served: Sequence[StationId] = field(repr=False)
    near: dict[StationId, list[StationId]] = field(repr=False)

    @classmethod
    def of(cls, *, stations: int, seed: int, served: int | None = None) -> "City":
        """The synthetic city of this size; only `served` stations in its middle are served."""
        network = synthetic_city(stations=stations, seed=seed, pads=_PADS, spacing_m=_SPACING_M)
        return cls.on(network, served=served)

    @classmethod
    def on(cls, network: Network, *, served: int | None = None) -> "City":
        """The city of a network; None serves all its stations."""
        ids = network.columns.station_ids
        if served is None or served >= len(ids):
            return cls(network, ids, _near(network))
        return cls(network, _most_central(network, served), _near(network))

    def documents(self) -> Mapping[str, dict[str, Any]]:
        """The GeoJSON to publish, with the defaults of all settings."""
        return {NETWORK_ID: write_network(self.network)}

    def tariff(self, number: int) -> dict[str, Any]:
        """What the provider of this number asks: no two ask the same."""
        return {"currency": "USD", "base": 300 + 10 * number, "per_km": 40 - number}

    def fleet(self, number: int, *, providers: int, drones: int) -> list[dict[str, Any]]:
        """The drones of one provider: every n-th of all, so that each is at home all over."""
        ids = self.served
        return [
            {
                "model_id": DJI_MATRICE_300_RTK.model_id,
                "home_station_id": ids[(drone // providers * providers + number) % len(ids)],
            }
            for drone in range(number, drones, providers)
        ]

    def requests(self, *, rate_per_s: float, seconds: float, seed: int) -> Iterator[DueRequest]:
        """A Poisson stream of local requests."""
        chance = random.Random(seed)
        at_s = chance.expovariate(rate_per_s)
        while at_s < seconds:
            yield DueRequest(at_s, self.request(chance))
            at_s += chance.expovariate(rate_per_s)

    def request(self, chance: random.Random) -> bytes:
        """One request from anywhere in the city, as JSON."""
        pickup = chance.choice(self.served)
        count = min(chance.choices(*_PACKAGES)[0], len(self.near[pickup]))
        packages = [
            {
                "package_id": f"p{number}",
                "mass_kg": round(chance.uniform(*_MASS_KG), 2),
                "destination": {"station_id": destination},
            }
            for number, destination in enumerate(chance.sample(self.near[pickup], count), start=1)
        ]
        qos = {"objective": chance.choices(*_OBJECTIVES)[0]}
        body = {"pickup": {"station_id": pickup}, "packages": packages, "qos": qos}
        return json.dumps(body).encode()


def _most_central(network: Network, count: int) -> list[StationId]:
    """So many stations around the middle of a network, in the order of their ids."""
    columns = network.columns
    away = np.hypot(
        columns.longitude_deg - columns.longitude_deg.mean(),
        columns.latitude_deg - columns.latitude_deg.mean(),
    )
    return sorted(columns.station_ids[row] for row in np.argsort(away, kind="stable")[:count])


def _near(network: Network) -> dict[StationId, list[StationId]]:
    """By station, those that can be reached over a few segments, sorted."""
    columns = network.columns
    ids = columns.station_ids
    neighbours: dict[StationId, set[StationId]] = {station: set() for station in ids}
    for start, end in zip(columns.from_row.tolist(), columns.to_row.tolist(), strict=True):
        neighbours[ids[start]].add(ids[end])
    near = {}
    for station in ids:
        reached = {station}
        for _ in range(_NEAR):
            reached |= {other for one in reached for other in neighbours[one]}
        near[station] = sorted(reached - {station})
    return near
