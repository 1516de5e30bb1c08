"""How taken stations are, told to everybody: retained, on change and after every connect."""

from dataclasses import dataclass, field

from skyway.contracts.topics import STATION_STATE
from skyway.contracts.world import StationState
from skyway.ids import StationId
from skyway.runtime.clock import FleetClock
from skyway.runtime.minting import Mint
from skyway.runtime.mqtt.client import MqttClient
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.closures.store import outages
from skyway_composition.pads.occupancy import Occupancy, outages_by_pad
from skyway_composition.pads.occupancy_store import pads_everywhere, pads_of_all, used_stations
from skyway_composition.pads.store import booked_at


@dataclass(slots=True)
class StationStates:
    """Publishes what changed since it last told: after a connect all stations, then what changes.

    All of them, because the process before this one may have left a station told as taken.
    """

    db: Database
    mqtt: MqttClient
    clock: FleetClock
    mint: Mint
    _told: dict[StationId, Occupancy] = field(default_factory=dict)
    _connects: int = 1
    _told_connects: int = 0

    def forget(self) -> None:
        """Tell everything again: a broker keeps nothing over a restart."""
        self._told = {}
        self._connects += 1

    async def step(self) -> bool:
        """Publish what is different now."""
        if not self.mqtt.is_connected:
            return False
        now_ms = moment_to_ms(self.clock.now())
        connects = self._connects  # a connect in the middle of this step has all told once more
        for station_id, use in sorted((await self._uses(now_ms, connects)).items()):
            if self._told.get(station_id) != use:
                await self.mqtt.publish(STATION_STATE(station_id), self._message(station_id, use))
                self._told[station_id] = use
        self._told_connects = connects
        return False

    async def _uses(self, now_ms: int, connects: int) -> dict[StationId, Occupancy]:
        """Of the stations that are used, or were told so; of all after a connect."""
        async with self.db.read() as connection:
            used = await used_stations(connection, at_ms=now_ms)
            broken = outages_by_pad(await outages(connection, at_ms=now_ms))
            held = await booked_at(connection, sorted(broken), moment_ms=now_ms) if broken else []
            if self._told_connects == connects:
                others = {*broken, *self._told_as_used()} - used.keys()
                pads = await pads_of_all(connection, sorted(others)) if others else {}
            else:
                pads = await pads_everywhere(connection)
        uses = {station_id: Occupancy(count) for station_id, count in pads.items()} | used
        for station_id in broken.keys() & uses.keys():
            taken = [
                (pad, end_ms)
                for at, pad, start_ms, end_ms in held
                if at == station_id and start_ms <= now_ms
            ]
            uses[station_id] = uses[station_id].with_outages(taken, broken[station_id])
        return uses

    def _told_as_used(self) -> list[StationId]:
        return [station_id for station_id, use in self._told.items() if not use.is_none]

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
