"""The customers of the small world: they request a few packages to stations not far away.

One delivery is requested every few seconds, while some drones are idle: people who open the
console, or request a delivery, find a service that works.
"""

import asyncio
from collections.abc import Callable, Iterator, Sequence
from datetime import datetime, timedelta
from random import Random
from typing import Any, Final, Never

import httpx
import numpy as np

from skyway.cli.demo.fleets import NETWORK_ID
from skyway.cli.gateway import GatewayApi
from skyway.errors import SkywayError
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

_OBJECTIVES: Final = ("FASTEST", "CHEAPEST", "GREENEST")

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


#: Seconds of wall time between two requests.
REQUEST_EVERY_S: Final = 4.0

#: Deliveries that are not over; while there are as many, nothing is requested.
MOST_OPEN: Final = 10

#: While fewer drones are idle, nothing is requested: they are left to those who try the demo.
LEAST_IDLE: Final = 3

_OVER: Final = frozenset({"COMPLETED", "PARTIALLY_COMPLETED", "CANCELLED", "FAILED", "REJECTED"})


class Customers:
    """The customers of the small world, who take turns; `say` gets each trouble once."""

    def __init__(
        self,
        api: GatewayApi,
        keys: Sequence[str],
        draw: RequestDraw,
        *,
        operator_key: str,
        say: Callable[[str], None],
    ) -> None:
        self._api = api
        self._keys = keys
        self._draw = draw
        self._operator_key = operator_key
        self._say = say
        self._turn = 0
        self._said = ""
        #: The key of each delivery that is not over.
        self._open: dict[str, str] = {}

    async def run(self) -> Never:
        """Go on with what an earlier start requested, and request more; this never returns."""
        while True:
            await self.step()
            await asyncio.sleep(REQUEST_EVERY_S)

    async def step(self) -> None:
        """Request one delivery, unless there are enough; trouble is left to the next step."""
        try:
            await self._look()
            if len(self._open) < MOST_OPEN and await self._idle_drones() >= LEAST_IDLE:
                await self._request()
        except (SkywayError, httpx.HTTPError) as trouble:
            if str(trouble) != self._said:
                self._said = str(trouble)
                self._say(f"no delivery is requested now: {trouble}")

    async def _look(self) -> None:
        """See which deliveries are over; the first look finds those of an earlier start."""
        if self._turn == 0:
            for key in self._keys:
                page = await self._api.call("GET", "/v1/deliveries?limit=50", key=key)
                self._open |= {each["delivery_id"]: key for each in page["items"]}
        for delivery_id, key in list(self._open.items()):
            delivery = await self._api.call("GET", f"/v1/deliveries/{delivery_id}", key=key)
            if delivery["state"] in _OVER:
                del self._open[delivery_id]

    async def _idle_drones(self) -> int:
        path = f"/v1/networks/{NETWORK_ID}/status"
        status = await self._api.call("GET", path, key=self._operator_key)
        return sum(each["idle"] for each in status["models"])

    async def _request(self) -> None:
        key = self._keys[self._turn % len(self._keys)]
        clock = await self._api.call("GET", "/v1/clock", key=key)
        body = self._draw.draw(datetime.fromisoformat(clock["now"]))
        created = await self._api.call("POST", "/v1/deliveries", key=key, body=body)
        self._open[created["delivery_id"]] = key
        self._turn += 1
