"""Learns the stations of networks whenever a version is announced on MQTT.

What a version dropped a moment ago may still be known here: who must not err asks composition.
"""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Final

from skyway.announced_networks.known_networks import KnownNetworks
from skyway.contracts.station_check import NetworkStations
from skyway.contracts.topics import NETWORK_VERSION
from skyway.contracts.world import NetworkVersion
from skyway.ids import NetworkId
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.loops import Wake, repeat
from skyway.runtime.mqtt.client import MqttClient, Received

#: Tells all stations of a network's current version, unless they are very many.
AllStations = Callable[[NetworkId], Awaitable[NetworkStations]]

#: Seconds of wall time until composition is asked again when it knew less than it had announced.
_LOOK_EVERY_S: Final = 5.0


def asking(composition: ServiceClient) -> AllStations:
    """`AllStations` by asking composition."""

    async def ask(network_id: NetworkId) -> NetworkStations:
        path = f"/internal/networks/{network_id}/stations"
        return await composition.call("GET", path, answer=NetworkStations)

    return ask


class NetworkLearner:
    """Knows the networks of which this process has heard, while it would hear of new versions."""

    def __init__(self, all_stations: AllStations) -> None:
        self.known = KnownNetworks()
        self._all_stations = all_stations
        self._announced: dict[NetworkId, int] = {}
        self._wake = Wake()

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
        known = self.known.version_of(network_id)
        if known is not None and known < version:
            self.known.drop(network_id)
        self._wake.set()

    async def learn(self) -> bool:
        """Step of a loop: ask for the stations of the networks that are announced, but not known.

        Raises
        ------
        ServiceUnavailable
            Composition cannot be asked now.
        """
        for network_id in [each for each in self._announced if self._is_new(each)]:
            told = await self._all_stations(network_id)
            # Announced anew or forgotten meanwhile: the next step looks again.
            if told.version >= self._announced.get(network_id, told.version + 1):
                self.known.keep(told)
        return False

    def forget(self) -> None:
        """Know nothing, until it is announced again."""
        self._announced.clear()
        self.known.forget()

    def _is_new(self, network_id: NetworkId) -> bool:
        return self.known.version_of(network_id) is None

    async def _hear(self, announced: AsyncIterator[list[Received[NetworkVersion]]]) -> None:
        async for batch in announced:
            for received in batch:
                self.announce(received.message)

    async def _forget_when_deaf(self, mqtt: MqttClient) -> None:
        while True:
            await mqtt.wait_connected()
            await mqtt.wait_lost()
            self.forget()
