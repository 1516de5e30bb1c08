"""How taken stations are, told to everybody: retained, on change and after every connect."""

from dataclasses import dataclass, field

from skyway.contracts.topics import STATION_STATE
from skyway.contracts.world import StationState
from skyway.ids import StationId
from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Database
from skyway.runtime.minting import Mint
from skyway.runtime.mqtt import MqttClient
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.pads.store import pads_of_all, taken_at


@dataclass(frozen=True, slots=True)
class _Taken:
    pads: int
    pads_taken: int
    next_free_ms: int | None


@dataclass(slots=True)
class StationStates:
    """Publishes what changed since it last told; a station never reserved is told by nothing."""

    db: Database
    mqtt: MqttClient
    clock: FleetClock
    mint: Mint
    _told: dict[StationId, _Taken] = field(default_factory=dict)

    def forget(self) -> None:
        """Tell everything again: a broker keeps nothing over a restart."""
        self._told = {station: _Taken(-1, -1, None) for station in self._told}

    async def step(self) -> bool:
        """Publish what is different now."""
        if not self.mqtt.is_connected:
            return False
        now = self.clock.now()
        async with self.db.read() as connection:
            taken = await taken_at(connection, moment_to_ms(now))
            known = sorted({*taken, *self._told})
            pads = await pads_of_all(connection, known)
        for station_id in known:
            booked = taken.get(station_id, [])
            state = _Taken(
                pads=pads.get(station_id, 0),
                pads_taken=len(booked),
                next_free_ms=min((each.end_ms for each in booked), default=None),
            )
            if self._told.get(station_id) != state:
                await self.mqtt.publish(STATION_STATE(station_id), self._message(station_id, state))
                self._told[station_id] = state
        return False

    def _message(self, station_id: StationId, state: _Taken) -> StationState:
        next_free_ms = state.next_free_ms
        return StationState(
            message_id=self.mint("msg"),
            sent_at=self.clock.now(),
            station_id=station_id,
            pads=state.pads,
            pads_taken=state.pads_taken,
            next_free_at=None if next_free_ms is None else ms_to_moment(next_free_ms),
        )
