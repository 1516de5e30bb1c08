"""Drones that sign nothing, for tests of everything else."""

from collections.abc import Collection, Sequence

from skyway.contracts.drones import DroneSignature
from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock
from skyway.runtime.signing.key_book import KeyBook


class UnsignedDrones:
    """A `KeySource` in which no drone signs."""

    async def of(self, drone_ids: Collection[DroneId]) -> Sequence[DroneSignature]:
        return [DroneSignature(drone_id=each, is_signed=False) for each in drone_ids]

    async def changed(self) -> Sequence[DroneSignature]:
        return ()


def unsigned_book(clock: FleetClock) -> KeyBook:
    return KeyBook(UnsignedDrones(), clock)
