"""What the picture is made of: three sources, each of which remembers what it has read.

After an error a source goes on from what it has read before.
"""

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

from skyway.cells import DEFAULT_SERVER, ask_all
from skyway.contracts.live import (
    LIVE_DRONES,
    LIVE_MISSIONS,
    LIVE_WORLD,
    MOST_MISSIONS,
    LiveMissionsQuery,
)
from skyway.ids import DeliveryId, MissionId, SubjectId
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.sql.database import Database
from skyway_gateway.live import live_store
from skyway_gateway.live.documents import (
    alarm_item,
    closure_item,
    customers_drone,
    customers_mission,
    delivery_item,
    drone_item,
    linked_delivery_item,
    mission_item,
    service_items,
    station_item,
)
from skyway_gateway.live.picture import Item, JsonObject, Key, Kind, Picture

log = logging.getLogger(__name__)

#: Deliveries that are read together.
_DELIVERIES_AT_ONCE: Final = 200

#: Deliveries whose customers are remembered.
_MOST_CUSTOMERS: Final = 100_000

#: A service that hangs must not hold back what the others say for long, wall seconds.
_ANSWERS_WITHIN_S: Final = 3.0

#: The name of the default server in the picture while other networks have cells.
_OTHER_NETWORKS: Final = f"{DEFAULT_SERVER} of other networks"

#: A JSON object of our own services: valid, so that no member is checked again.
_Json = dict[str, Any]


class Source(Protocol):
    """One part of the picture."""

    @property
    def name(self) -> str:
        """The service that it asks."""
        ...

    async def read(self, picture: Picture) -> None:
        """Bring its part of the picture up to date.

        Raises
        ------
        ServiceUnavailable
            The service or the database does not answer.
        """
        ...

    def forget(self) -> None:
        """Read everything again next time."""
        ...


@dataclass(slots=True)
class Deliveries:
    """The deliveries that are not over, from the gateway's own database."""

    db: Database
    name: str = "gateway"
    _versions: dict[DeliveryId, int] = field(default_factory=dict)

    async def read(self, picture: Picture) -> None:
        """Read the deliveries whose version is another than before."""
        async with self.db.read() as connection:
            versions = await live_store.live_versions(connection)
        changed = [each for each in versions if versions[each] != self._versions.get(each)]
        for start in range(0, len(changed), _DELIVERIES_AT_ONCE):
            some = changed[start : start + _DELIVERIES_AT_ONCE]
            async with self.db.read() as connection:
                found = await live_store.deliveries_named(connection, some)
            picture.put(delivery_item(each) for each in found if not each.is_over)
            picture.put(linked_delivery_item(each, versions[each]) for each in some)
        shown = picture.of_kind("deliveries")
        picture.remove([key for key in shown if key.item_id not in versions])
        self._versions = versions

    def forget(self) -> None:
        """Read all deliveries again next time."""
        self._versions.clear()


@dataclass(slots=True)
class World:
    """Missions, stations, closures and alarms, from all servers of composition.

    The last data of a server that does not answer stays in the picture, which names the server.
    """

    clients: Callable[[], Mapping[str, ServiceClient]]
    db: Database
    name: str = "composition"
    _worlds: Mapping[str, _Json] = field(default_factory=dict)
    _versions: dict[MissionId, str] = field(default_factory=dict)
    _customers: dict[DeliveryId, SubjectId] = field(default_factory=dict)

    async def read(self, picture: Picture) -> None:
        """Read all but missions as a whole, and the missions whose version is new."""
        clients = self.clients()
        answers = await ask_all(clients, _world_of)
        if not answers.given:
            answers.must_be_whole()
        known = {**self._worlds, **answers.given}
        self._worlds = worlds = {name: known[name] for name in clients if name in known}
        every = list(worlds.values())
        _replace(
            picture, "stations", (station_item(each) for of in every for each in of["stations"])
        )
        _replace(
            picture, "closures", (closure_item(each) for of in every for each in of["closures"])
        )
        _replace(picture, "alarms", (alarm_item(each) for of in every for each in of["alarms"]))
        versions = {each["mission_id"]: each["version"] for of in every for each in of["missions"]}
        shown = picture.of_kind("missions")
        picture.remove([key for key in shown if key.item_id not in versions])
        self._versions = {each: v for each, v in self._versions.items() if each in versions}
        answering = [
            name
            for name, world in answers.given.items()
            if await self._read_changed(picture, clients[name], world)
        ]
        if len(clients) > 1:
            for name in clients:
                shown_name = _OTHER_NETWORKS if name == DEFAULT_SERVER else name
                picture.put(service_items(shown_name, {}, is_answering=name in answering))
        elif not answering:
            raise ServiceUnavailable(self.name, "it did not answer with its missions")

    async def _read_changed(self, picture: Picture, client: ServiceClient, world: _Json) -> bool:
        """Read the missions of one server whose version is new; False if it did not answer."""
        versions = {each["mission_id"]: each["version"] for each in world["missions"]}
        changed = [each for each in versions if versions[each] != self._versions.get(each)]
        for start in range(0, len(changed), MOST_MISSIONS):
            some = changed[start : start + MOST_MISSIONS]
            try:
                await self._read_missions(picture, client, some)
            except ServiceUnavailable as error:
                log.info("missions not read", extra={"part": client.name, "reason": str(error)})
                return False
            self._versions |= {each: versions[each] for each in some}
        return True

    async def _read_missions(
        self, picture: Picture, client: ServiceClient, mission_ids: Sequence[MissionId]
    ) -> None:
        query = LiveMissionsQuery(mission_ids=tuple(mission_ids))
        answer = await client.call(
            "POST", LIVE_MISSIONS, body=query, answer=_Json, timeout_s=_ANSWERS_WITHIN_S
        )
        missions = answer["missions"]
        await self._find_customers({each["delivery_id"] for each in missions})
        picture.put([mission_item(each, _promises(picture, each)) for each in missions])
        picture.put(
            customers_mission(each, self._customers[each["delivery_id"]])
            for each in missions
            if each["delivery_id"] in self._customers
        )

    async def _find_customers(self, delivery_ids: set[DeliveryId]) -> None:
        new = delivery_ids - self._customers.keys()
        if not new:
            return
        if len(self._customers) > _MOST_CUSTOMERS:
            self._customers.clear()
            new = delivery_ids
        async with self.db.read() as connection:
            self._customers |= await live_store.customers_of(connection, new)

    def forget(self) -> None:
        """Read all missions again next time."""
        self._versions.clear()


async def _world_of(client: ServiceClient) -> _Json:
    return await client.call("GET", LIVE_WORLD, answer=_Json, timeout_s=_ANSWERS_WITHIN_S)


@dataclass(slots=True)
class Drones:
    """All drones, from the registry."""

    client: ServiceClient
    name: str = "registry"
    _mark: str | None = None

    async def read(self, picture: Picture) -> None:
        """Read the drones that have changed since the last mark."""
        query = {} if self._mark is None else {"since": self._mark}
        answer = await self.client.call(
            "GET", LIVE_DRONES, query=query, answer=_Json, timeout_s=_ANSWERS_WITHIN_S
        )
        found = dict(
            drone_item(
                drone,
                picture.get(Key("drones", drone["drone_id"])),
                _document(picture, "missions", drone.get("mission_id")),
            )
            for drone in answer["drones"]
        )
        picture.put(found.items())
        if answer["is_whole"]:
            fleet = [key for key in picture.of_kind("drones") if not key.audience]
            picture.remove(key for key in fleet if key not in found)
        self._mark = answer["mark"]

    def forget(self) -> None:
        """Read all drones again next time."""
        self._mark = None


def show_customers_drones(picture: Picture) -> None:
    """Bring up to date what customers see of the drones that carry their packages."""
    shown = dict(_customers_drones(picture))
    drones = picture.of_kind("drones")
    picture.remove([key for key in drones if key.audience and key not in shown])
    picture.put(shown.items())


def _customers_drones(picture: Picture) -> Iterator[tuple[Key, Item]]:
    for key in picture.of_kind("missions"):
        if not key.audience:
            continue
        mission = _document(picture, "missions", key.item_id)
        drone = mission and picture.get(Key("drones", mission["drone_id"]))
        item = mission and drone and customers_drone(drone, mission, key)
        if mission and item:
            yield Key("drones", mission["drone_id"], key.audience), item


def _promises(picture: Picture, mission: _Json) -> JsonObject:
    """When its packages were promised: as the delivery says, or known from before it was over."""
    before = _document(picture, "missions", mission["mission_id"]) or {}
    delivery = _document(picture, "deliveries", mission["delivery_id"]) or {"packages": {}}
    own = {each["package_id"] for each in mission["packages"]}
    known: JsonObject = before.get("promises", {})
    return {**known} | {
        package_id: package["promised_at"]
        for package_id, package in delivery["packages"].items()
        if package_id in own and "promised_at" in package
    }


def _replace(picture: Picture, kind: Kind, items: Iterable[tuple[Key, Item]]) -> None:
    """Put all items of a kind, and remove those that are not among them."""
    every = dict(items)
    picture.put(every.items())
    picture.remove([key for key in picture.of_kind(kind) if key not in every])


def _document(picture: Picture, kind: Kind, item_id: str | None) -> JsonObject | None:
    item = None if item_id is None else picture.get(Key(kind, item_id))
    return None if item is None else item.document
