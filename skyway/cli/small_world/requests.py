"""Draws the delivery requests of the small world: valid, near enough, and different."""

from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta
from random import Random
from typing import Any, Final

import numpy as np

from skyway.cli.small_world.shops import Shop
from skyway.geo import distance_m
from skyway.ids import StationId
from skyway.network.components import station_parts
from skyway.network.network import Network

#: Destinations are so far from the pickup, metres: a drone is seen on its way, and need not
#: recharge.
_NEAREST_M: Final = 6_000.0
_FARTHEST_M: Final = 16_000.0

#: How many packages a request has: most have one.
_NUMBERS: Final = (1, 1, 1, 1, 2)
_MASSES_KG: Final = (0.2, 0.4, 0.6, 0.8)

_OBJECTIVES: Final = ("FASTEST", "CHEAPEST", "GREENEST")

#: One request in so many is PRIORITY, and one in so many has a deadline.
_PRIORITY_IN: Final = 4
_DEADLINE_IN: Final = 3

#: From now to the deadline, fleet time.
_DEADLINE_AFTER: Final = timedelta(hours=6)

#: The first order's number.
_FIRST_ORDER: Final = 1042


class RequestDraw:
    """Draws requests on one network; the same `chance` draws the same requests."""

    def __init__(self, network: Network, chance: Random) -> None:
        self._chance = chance
        self._order = _FIRST_ORDER
        stations = network.stations
        parts = station_parts(network)
        is_connected = parts == np.bincount(parts).argmax()
        ids = network.columns.station_ids
        self._connected = [stations[ids[row]] for row in np.flatnonzero(is_connected)]
        self._stations = stations

    def draw(self, now: datetime, shop: Shop) -> dict[str, Any]:  # a delivery request as JSON
        """A request of this shop at this fleet time."""
        chance = self._chance
        pickup = chance.choice(shop.stations)
        number = chance.choice(_NUMBERS)
        qos: dict[str, object] = {"objective": chance.choice(_OBJECTIVES)}
        if chance.randrange(_PRIORITY_IN) == 0:
            qos["priority"] = "PRIORITY"
        if chance.randrange(_DEADLINE_IN) == 0:
            qos["deadline_at"] = (now + _DEADLINE_AFTER).isoformat()
        self._order += 1
        return {
            "pickup": {"station_id": pickup},
            "packages": [*self._packages(chance.sample(self._near(pickup), number), shop)],
            "qos": qos,
            "reference": f"Order {self._order - 1}",
        }

    def _near(self, pickup: StationId) -> Sequence[StationId]:
        """The stations that are neither here nor far."""
        here = self._stations[pickup].position
        return [
            each.station_id
            for each in self._connected
            if _NEAREST_M <= distance_m(here, each.position) <= _FARTHEST_M
        ]

    def _packages(self, destinations: Sequence[StationId], shop: Shop) -> Iterator[dict[str, Any]]:
        wares = self._chance.sample(shop.wares, len(destinations))
        for destination, ware in zip(destinations, wares, strict=True):
            yield {
                "package_id": ware,
                "mass_kg": self._chance.choice(_MASSES_KG),
                "destination": {"station_id": destination},
            }
