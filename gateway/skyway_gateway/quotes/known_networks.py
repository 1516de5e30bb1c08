"""Stations that are known without asking: those of the network versions announced on MQTT.

What is known is only ever good news. A station that is not known here, or to which no way is, is
asked about; one that a new version drops a moment before its request comes is found out by booking.
"""

import asyncio
from collections.abc import AsyncIterator, Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from skyway.contracts.station_check import NetworkStations
from skyway.contracts.topics import NETWORK_VERSION
from skyway.contracts.world import NetworkVersion
from skyway.geo import Position
from skyway.ids import NetworkId, StationId
from skyway.runtime.loops import Wake, repeat
from skyway.runtime.mqtt.client import MqttClient, Received
from skyway_gateway.clients import Composition

#: The most stations that are kept, of all networks together: a hundred bytes each, or two.
_MOST_KEPT: Final = 200_000
#: Seconds of wall time until composition is asked again when it knew less than it had announced.
_LOOK_EVERY_S: Final = 5.0


@dataclass(frozen=True, slots=True)
class _Known:
    """The stations of one version: where each is, and to which part of the network it belongs."""

    version: int
    places: Mapping[StationId, tuple[Position, int]]


class KnownNetworks:
    """The networks of which this process has heard, for as long as it would hear of new ones."""

    def __init__(self, composition: Composition) -> None:
        self._composition = composition
        self._announced: dict[NetworkId, int] = {}
        self._known: dict[NetworkId, _Known] = {}
        self._wake = Wake()

    def start_of_ways(self, start: StationId, *, to: Iterable[StationId]) -> Position | None:
        """Where a station is from which ways are known to lead to all of these; else None."""
        for network in self._known.values():
            if (place := network.places.get(start)) is not None:
                position, part = place
                ends = (network.places.get(each) for each in to)
                return position if all(end and end[1] == part for end in ends) else None
        return None

    async def run(self, mqtt: MqttClient) -> None:
        """Learn every version that is announced, and forget all while nothing can be heard."""
        announced = mqtt.batches(NETWORK_VERSION)
        async with asyncio.TaskGroup() as group:
            group.create_task(self._hear(announced))
            group.create_task(self._forget_when_deaf(mqtt))
            learn = repeat("networks", self.learn, every_s=_LOOK_EVERY_S, wake=self._wake)
            group.create_task(learn)

    def announce(self, message: NetworkVersion) -> None:
        """Note a version; what was known of an older one does not count from now on."""
        network_id, version = message.network_id, message.version
        self._announced[network_id] = version
        if network_id in self._known and self._known[network_id].version < version:
            del self._known[network_id]
        self._wake.set()

    async def learn(self) -> bool:
        """Step of a loop: ask for the stations of the networks that are announced, but not known.

        Raises
        ------
        ServiceUnavailable
            Composition cannot be asked now.
        """
        for network_id in [each for each in self._announced if each not in self._known]:
            told = await self._composition.all_stations(network_id)
            # Announced anew or forgotten meanwhile: the next step looks again.
            if told.version >= self._announced.get(network_id, told.version + 1):
                self._known[network_id] = _Known(told.version, self._places(told))
        return False

    def forget(self) -> None:
        """Know nothing, until it is announced again."""
        self._announced.clear()
        self._known.clear()

    def _places(self, told: NetworkStations) -> Mapping[StationId, tuple[Position, int]]:
        """What is kept of a network: all of it, or nothing when that would be too much."""
        kept = sum(len(network.places) for network in self._known.values())
        if kept + len(told.station_ids) > _MOST_KEPT:
            return {}
        places = zip(told.positions, told.parts, strict=True)
        return dict(zip(told.station_ids, places, strict=True))

    async def _hear(self, announced: AsyncIterator[list[Received[NetworkVersion]]]) -> None:
        async for batch in announced:
            for received in batch:
                self.announce(received.message)

    async def _forget_when_deaf(self, mqtt: MqttClient) -> None:
        while True:
            await mqtt.wait_connected()
            await mqtt.wait_lost()
            self.forget()
