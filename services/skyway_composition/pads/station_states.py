"""How taken stations are, told to everybody: retained, on change and after every connect."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from skyway.contracts.topics import STATION_STATE
from skyway.contracts.world import StationState
from skyway.ids import StationId
from skyway.planner.pad_book import OPEN_MS
from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Database
from skyway.runtime.minting import Mint
from skyway.runtime.mqtt import MqttClient
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.closures.store import outages
from skyway_composition.pads.booked_pad import BookedPad
from skyway_composition.pads.outage import Outage, outages_by_pad
from skyway_composition.pads.store import booked_by_station, pads_everywhere, pads_of_all


@dataclass(frozen=True, slots=True)
class _Taken:
    pads: int
    pads_taken: int
    queue: int
    next_free_ms: int | None


@dataclass(slots=True)
class StationStates:
    """Publishes what changed since it last told: after a connect all stations, then what changes.

    All of them, because the process before this one may have left a station told as taken.
    """

    db: Database
    mqtt: MqttClient
    clock: FleetClock
    mint: Mint
    _told: dict[StationId, _Taken] = field(default_factory=dict)
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
        async with self.db.read() as connection:
            booked = await booked_by_station(connection, ending_after_ms=now_ms)
            broken = outages_by_pad(await outages(connection, at_ms=now_ms))
            if self._told_connects == connects:
                pads = await pads_of_all(
                    connection, sorted({*booked, *broken, *self._told_as_booked()})
                )
            else:
                pads = await pads_everywhere(connection)
        for station_id in sorted(pads):
            state = _state_of(
                pads[station_id],
                booked.get(station_id, []),
                broken.get(station_id, {}),
                now_ms=now_ms,
            )
            if self._told.get(station_id) != state:
                await self.mqtt.publish(STATION_STATE(station_id), self._message(station_id, state))
                self._told[station_id] = state
        self._told_connects = connects
        return False

    def _told_as_booked(self) -> list[StationId]:
        return [name for name, state in self._told.items() if state.pads_taken or state.queue]

    def _message(self, station_id: StationId, state: _Taken) -> StationState:
        next_free_ms = state.next_free_ms
        return StationState(
            message_id=self.mint("msg"),
            sent_at=self.clock.now(),
            station_id=station_id,
            pads=state.pads,
            pads_taken=state.pads_taken,
            queue=state.queue,
            next_free_at=None if next_free_ms is None else ms_to_moment(next_free_ms),
        )


def _state_of(
    pads: int, booked: Sequence[BookedPad], broken: Mapping[int, Outage], *, now_ms: int
) -> _Taken:
    """How taken a station is; a pad that is out of order is free when it works again."""
    taken = {each.pad: each.end_ms for each in booked if each.start_ms <= now_ms}
    queue = len(booked) - len(taken)
    for pad, outage in broken.items():
        if outage.until_ms is None:
            taken[pad] = OPEN_MS
        else:
            taken[pad] = max(taken.get(pad, 0), outage.until_ms)
    next_free_ms = min(taken.values(), default=OPEN_MS)
    return _Taken(
        pads=pads,
        pads_taken=sum(pad < pads for pad in taken),
        queue=queue,
        next_free_ms=None if next_free_ms == OPEN_MS else next_free_ms,
    )
