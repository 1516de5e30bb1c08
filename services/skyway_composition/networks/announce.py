"""Publish the current version of every network over MQTT: retained, on change and on connect."""

from dataclasses import dataclass, field

from skyway.contracts.topics import NETWORK_VERSION
from skyway.contracts.world import NetworkVersion
from skyway.ids import NetworkId
from skyway.runtime.clock import FleetClock
from skyway.runtime.minting import Mint
from skyway.runtime.mqtt.client import MqttClient
from skyway.runtime.sql.database import Database
from skyway_composition.networks.store import all_current


@dataclass(slots=True)
class NetworkVersions:
    """Publishes the current versions that it has not published yet."""

    db: Database
    mqtt: MqttClient
    clock: FleetClock
    mint: Mint
    _published: dict[NetworkId, int] = field(default_factory=dict)

    def forget(self) -> None:
        """Publish everything again, because a broker may lose retained messages in a restart."""
        self._published.clear()

    async def step(self) -> bool:
        """Publish the versions that are new."""
        if not self.mqtt.is_connected:
            return False
        async with self.db.read() as connection:
            rows = await all_current(connection)
        for row in rows:
            if self._published.get(row.network_id) != row.version:
                message = NetworkVersion(
                    message_id=self.mint("msg"),
                    sent_at=self.clock.now(),
                    network_id=row.network_id,
                    version=row.version,
                    sha256=row.sha256,
                    href=f"/v1/networks/{row.network_id}?version={row.version}",
                )
                await self.mqtt.publish(NETWORK_VERSION(row.network_id), message)
                self._published[row.network_id] = row.version
        return False
