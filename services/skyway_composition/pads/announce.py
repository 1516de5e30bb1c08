"""Publish the occupancy of stations over MQTT: retained, on change and after every connect.

Only the stations of this server's own networks are published.
"""

from dataclasses import dataclass, field

from skyway.contracts.topics import STATION_STATE
from skyway.contracts.world import StationState
from skyway.ids import StationId
from skyway.runtime.clock import FleetClock
from skyway.runtime.minting import Mint
from skyway.runtime.mqtt.client import MqttClient
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.own_cells import OwnCells
from skyway_composition.pads.occupancy import Occupancy
from skyway_composition.pads.store import (
    occupied_stations,
    pads_everywhere,
    pads_of_all,
    stations_of,
)


@dataclass(slots=True)
class StationStates:
    """Publishes all stations after a connect, then each station that changes.

    After a connect it publishes all, because an earlier process may have left a retained message
    that shows a free station as occupied.
    """

    db: Database
    mqtt: MqttClient
    clock: FleetClock
    mint: Mint
    own: OwnCells
    _published: dict[StationId, Occupancy] = field(default_factory=dict)
    _connects: int = 1
    _published_connects: int = 0

    def forget(self) -> None:
        """Publish everything again, because a broker may lose retained messages in a restart."""
        self._published = {}
        self._connects += 1

    async def step(self) -> bool:
        """Publish the stations that have changed."""
        if not self.mqtt.is_connected:
            return False
        now_ms = moment_to_ms(self.clock.now())
        connects = self._connects  # after a connect during this step, all is published again
        for station_id, use in sorted((await self._uses(now_ms, connects)).items()):
            if self._published.get(station_id) != use:
                await self.mqtt.publish(STATION_STATE(station_id), self._message(station_id, use))
                self._published[station_id] = use
        self._published_connects = connects
        return False

    async def _uses(self, now_ms: int, connects: int) -> dict[StationId, Occupancy]:
        """The occupancy of stations that are or were published as used; after a connect of all."""
        async with self.db.read() as connection:
            occupied = await occupied_stations(connection, at_ms=now_ms)
            if self._published_connects == connects:
                used = {each for each, use in self._published.items() if not use.is_none}
                others = sorted(used - occupied.keys())
                pads = await pads_of_all(connection, others) if others else {}
            else:
                pads = await pads_everywhere(connection)
            foreign = set[StationId]()
            if self.own.foreign:
                foreign = await stations_of(connection, sorted(self.own.foreign))
        uses = {station_id: Occupancy(count) for station_id, count in pads.items()} | occupied
        return {station_id: use for station_id, use in uses.items() if station_id not in foreign}

    def _message(self, station_id: StationId, use: Occupancy) -> StationState:
        next_free_ms = use.next_free_ms
        return StationState(
            message_id=self.mint("msg"),
            sent_at=self.clock.now(),
            station_id=station_id,
            pads=use.pads,
            pads_taken=use.pads_taken,
            queue=use.queue,
            next_free_at=None if next_free_ms is None else ms_to_moment(next_free_ms),
        )
