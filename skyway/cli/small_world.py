"""The small world of `skyway up --demo`: registers a few fleets and customers, and keeps it going.

A file in the data folder keeps who lives in the small world, so a restart goes on.

Its customers request a few packages to stations not far away, one delivery every few seconds, while
some drones are idle: people who open the console find a service that works.
"""

import asyncio
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from random import Random
from typing import Any, Final, Never

import httpx
import numpy as np

from skyway.broker_setup.private_file import write_private
from skyway.cli.demo.fleets import NETWORK_ID, PROVIDERS, RegisteredFleet, register_fleet
from skyway.cli.gateway import GatewayApi
from skyway.cli.system.niceness import SIMULATES
from skyway.cli.system.running_system import System
from skyway.cli.system.secrets import keep_provider_key, read_secret
from skyway.errors import SkywayError
from skyway.geo import distance_m
from skyway.ids import StationId
from skyway.network.bundled import texas_corridor
from skyway.network.components import station_parts
from skyway.network.geojson import write_network
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


@dataclass(slots=True)
class Inhabitants:
    """The fleets and the customers' keys that are registered so far, by their names."""

    file: Path
    fleets: dict[str, RegisteredFleet] = field(default_factory=dict)
    customer_keys: dict[str, str] = field(default_factory=dict)

    @classmethod
    def read(cls, file: Path) -> "Inhabitants":
        """Those in the file; nobody without a file."""
        if not file.exists():
            return cls(file)
        kept: dict[str, Any] = json.loads(file.read_text())
        fleets = {name: RegisteredFleet(**fleet) for name, fleet in kept["fleets"].items()}
        return cls(file, fleets, kept["customer_keys"])

    def keep(self) -> None:
        """Write them into the file; only this user can read it."""
        fleets = {name: asdict(fleet) for name, fleet in self.fleets.items()}
        write_private(
            self.file, json.dumps({"fleets": fleets, "customer_keys": self.customer_keys})
        )

    @property
    def drones(self) -> list[dict[str, Any]]:
        """All drones with their credentials, as JSON."""
        return [drone for fleet in self.fleets.values() for drone in fleet.drones]


#: It flies more than 50 km with the packages of the small world.
_MODEL_ID: Final = "dji-matrice-300-rtk"

#: Customers beside the one whose key is in keys.env.
_CUSTOMERS: Final = ("river-books", "city-pharmacy")


async def populate(system: System, api: GatewayApi, network: Network) -> Inhabitants:
    """Publish the network, register who is missing, and start the drones.

    Raises
    ------
    SkywayError
        The gateway refuses a call.
    """
    folder, operator_key = system.folder, read_secret(system.folder, "operator_key")
    known = Inhabitants.read(folder.path / "small-world.json")
    published = await api.call("GET", "/v1/networks?limit=200", key=operator_key)
    if NETWORK_ID not in {each["network_id"] for each in published["items"]}:
        path = f"/v1/networks/{NETWORK_ID}"
        await api.call("PUT", path, key=operator_key, body=write_network(network))
    for name in _CUSTOMERS:
        if name not in known.customer_keys:
            body = {"role": "customer", "subject_id": name}
            issued = await api.call("POST", "/v1/keys", key=operator_key, body=body)
            known.customer_keys[name] = issued["key"]
            known.keep()
    for provider in PROVIDERS:
        if provider["name"] not in known.fleets:
            known.fleets[provider["name"]] = await register_fleet(
                api, operator_key, provider, model_id=_MODEL_ID
            )
            known.keep()
    keep_provider_key(folder, known.fleets[PROVIDERS[0]["name"]].key)
    fleet_file = folder.path / "small-world-fleet.json"
    write_private(fleet_file, json.dumps({"items": known.drones}))
    system.start_fleet("small-world", fleet_file, gives_way_by=SIMULATES)
    return known


async def live_on(system: System, *, say: Callable[[str], None]) -> Never:
    """Register who is missing, start the drones, and request deliveries; this never returns.

    Raises
    ------
    SkywayError
        The gateway refuses a provider, a customer or the network.
    """
    network = texas_corridor()
    async with GatewayApi(system.urls["gateway"]) as api:
        known = await populate(system, api, network)
        say(
            f"The small world: {len(known.fleets)} providers with {len(known.drones)} drones, a "
            f"request every {REQUEST_EVERY_S:g} s while at least {LEAST_IDLE} drones are idle."
        )
        operator_key = read_secret(system.folder, "operator_key")
        keys = (read_secret(system.folder, "customer_key"), *known.customer_keys.values())
        chance = Random()  # noqa: S311 - nothing is secret
        customers = Customers(
            api, keys, RequestDraw(network, chance), operator_key=operator_key, say=say
        )
        await customers.run()
