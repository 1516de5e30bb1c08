"""Where a drone may go after its last hand-over: home, where it stands, or a parking station."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np

from skyway.contracts.candidate import Candidate, Standby
from skyway.ids import StationId
from skyway.network.columns import Rows
from skyway.network.great_circle import distances_m
from skyway.network.network import Network

#: How many near stations with pads are tried. Our own choice.
_MOST_ENDS: Final = 3

#: How many near parking stations are compared by their plans. Our own choice.
_MOST_PARKING: Final = 3


@dataclass(frozen=True, slots=True)
class StandbyChoice:
    """A drone's standby setting, and its home station."""

    standby: Standby
    home_station_id: StationId

    @classmethod
    def of(cls, candidate: Candidate) -> Self:
        """The choice of a candidate."""
        return cls(candidate.standby, candidate.home_station_id)

    def at_home(self) -> Self:
        """The choice of a drone that an operator calls home."""
        return replace(self, standby="HOME")

    def is_home(self, station_id: StationId) -> bool:
        """Whether the drone flies home, and this is its home; a home may have no pads."""
        return self.standby == "HOME" and station_id == self.home_station_id

    def to_compare(self, network: Network, start: StationId) -> Iterator[StationId]:
        """The ends of which the best plan wins: the nearest parking stations, for PARKING."""
        if self.standby == "PARKING":
            parking = np.array(sorted(network.columns.parking), np.int32)
            yield from _nearest(network, start, among=parking, most=_MOST_PARKING)

    def in_turn(self, network: Network, start: StationId) -> Iterator[StationId]:
        """The ends of which the first possible one counts: home, and the nearest with pads.

        Home comes first for HOME, and last otherwise. A drone that stands at a station with pads
        is nearest to that station.
        """
        has_home = self.home_station_id in network.row_of
        if has_home and self.standby == "HOME":
            yield self.home_station_id
        with_pads = np.flatnonzero(network.columns.pads > 0).astype(np.int32)
        yield from _nearest(network, start, among=with_pads, most=_MOST_ENDS)
        if has_home and self.standby != "HOME":
            yield self.home_station_id


def _nearest(network: Network, start: StationId, *, among: Rows, most: int) -> Iterator[StationId]:
    """The nearest of the stations in these rows, by the great circle."""
    columns = network.columns
    here = np.full(len(among), network.row_of[start])
    away_m = distances_m(
        (columns.longitude_deg[here], columns.longitude_deg[among]),
        (columns.latitude_deg[here], columns.latitude_deg[among]),
    )
    nearest = among[np.argsort(away_m, kind="stable")[:most]]
    yield from (columns.station_ids[row] for row in nearest.tolist())
