"""Draws what a customer of the small world requests: a few packages to stations not far away."""

from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta
from random import Random
from typing import Any, Final

import numpy as np

from skyway.geo import distance_m
from skyway.ids import StationId
from skyway.network.components import station_parts
from skyway.network.network import Network

#: Destinations are so far from the pickup, metres: a drone is seen on its way, and need not
#: recharge.
_NEAREST_M: Final = 6_000.0
_FARTHEST_M: Final = 20_000.0

_MOST_PACKAGES: Final = 3
_MASSES_KG: Final = (0.2, 0.4, 0.6, 0.8)

_OBJECTIVES: Final = ("fastest", "cheapest", "greenest")

#: One request in so many is PRIORITY, and one in so many has a deadline.
_PRIORITY_IN: Final = 4
_DEADLINE_IN: Final = 3

#: From now to the deadline, fleet time.
_DEADLINE_AFTER: Final = timedelta(hours=6)


class RequestDraw:
    """Draws requests on one network; the same `chance` draws the same requests."""

    def __init__(self, network: Network, chance: Random) -> None:
        self._chance = chance
        stations = network.stations
        parts = station_parts(network)
        is_connected = parts == np.bincount(parts).argmax()
        ids = network.columns.station_ids
        connected = [stations[ids[row]] for row in np.flatnonzero(is_connected)]
        near = {
            station.station_id: [
                other.station_id
                for other in connected
                if _NEAREST_M <= distance_m(station.position, other.position) <= _FARTHEST_M
            ]
            for station in connected
        }
        self._near: dict[StationId, Sequence[StationId]] = {
            pickup: others for pickup, others in near.items() if len(others) >= _MOST_PACKAGES
        }
        self._pickups = sorted(self._near)

    def draw(self, now: datetime) -> dict[str, Any]:  # a delivery request as JSON
        """A request at this fleet time."""
        chance = self._chance
        pickup = chance.choice(self._pickups)
        number = chance.randint(1, _MOST_PACKAGES)
        destinations = chance.sample(self._near[pickup], number)
        qos: dict[str, object] = {"objective": chance.choice(_OBJECTIVES)}
        if chance.randrange(_PRIORITY_IN) == 0:
            qos["priority"] = "PRIORITY"
        if chance.randrange(_DEADLINE_IN) == 0:
            qos["deadline_at"] = (now + _DEADLINE_AFTER).isoformat()
        return {
            "pickup": {"station_id": pickup},
            "packages": [*self._packages(destinations)],
            "qos": qos,
        }

    def _packages(self, destinations: Sequence[StationId]) -> Iterator[dict[str, Any]]:
        for index, destination in enumerate(destinations, 1):
            yield {
                "package_id": f"p{index}",
                "mass_kg": self._chance.choice(_MASSES_KG),
                "destination": {"station_id": destination},
            }
