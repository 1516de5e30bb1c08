"""The world in which plans are made: one network version, and who holds its pads."""

from collections.abc import Iterator
from dataclasses import dataclass

from skyway.planner.problem import PadReservation
from skyway_composition.networks.prepared import PreparedNetwork
from skyway_composition.pads.booked_pad import BookedPad


@dataclass(frozen=True, slots=True)
class World:
    """What plans are made in; a booking checks again that both parts still hold."""

    skyway: PreparedNetwork
    booked_pads: tuple[BookedPad, ...]

    def reservations_from(self, start_ms: int) -> Iterator[PadReservation]:
        """The reservations that last beyond this moment, in seconds counted from it."""
        for booked in self.booked_pads:
            station = self.skyway.network.stations.get(booked.station_id)
            if booked.end_ms > start_ms and station is not None and booked.pad < station.pads:
                yield PadReservation(
                    station_id=booked.station_id,
                    pad=booked.pad,
                    start_s=(booked.start_ms - start_ms) / 1000,
                    end_s=(booked.end_ms - start_ms) / 1000,
                )
