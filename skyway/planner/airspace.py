"""The stations and segments that zones close: geometry, the same for every problem."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from skyway.ids import StationId
from skyway.network.columns import Floats, Rows
from skyway.network.great_circle import beside_deg
from skyway.network.network import Network, Zone
from skyway.network.zones import Outline, Points
from skyway.planner.stop import OutOfTime, Stop, never

_ROUNDING_DEG = 1e-9

#: A segment by its ends; a network has at most one in each direction.
SegmentEnds = tuple[StationId, StationId]


# Without slots: the ids are made when they are first read, and cached.
@dataclass(frozen=True, eq=False)
class ZoneReach:
    """The stations that lie in a zone, and the segments that meet it.

    Parameters
    ----------
    station_rows, segment_rows
        ``(k,)`` int32 each, rising.
    """

    zone: Zone
    network: Network
    station_rows: Rows
    segment_rows: Rows

    @cached_property
    def stations(self) -> tuple[StationId, ...]:
        """The stations in the order of the document."""
        ids = self.network.columns.station_ids
        return tuple(ids[row] for row in self.station_rows.tolist())

    @cached_property
    def segments(self) -> tuple[SegmentEnds, ...]:
        """The segments in the order of the document."""
        columns = self.network.columns
        ends = (columns.from_row[self.segment_rows], columns.to_row[self.segment_rows])
        rows = zip(ends[0].tolist(), ends[1].tolist(), strict=True)
        return tuple((columns.station_ids[a], columns.station_ids[b]) for a, b in rows)


@dataclass(frozen=True, slots=True)
class Airspace:
    """The reach of every zone. Make it once to compose often on one network."""

    reaches: tuple[ZoneReach, ...]

    @classmethod
    def of(cls, network: Network, *, stop: Stop = never) -> "Airspace":
        """The airspace above this network.

        Raises
        ------
        OutOfTime
            The stop ended the work.
        """
        return cls.over(network, network.zones, stop=stop)

    @classmethod
    def over(cls, network: Network, zones: Sequence[Zone], *, stop: Stop = never) -> "Airspace":
        """The airspace above this network with these zones instead of its own.

        Raises
        ------
        OutOfTime
            The stop ended the work.
        """

        def go_on() -> None:
            if stop(0):
                raise OutOfTime

        if not zones:
            return cls(())
        columns = network.columns
        at = columns.longitude_deg, columns.latitude_deg
        starts, ends = ((at[0][rows], at[1][rows]) for rows in (columns.from_row, columns.to_row))
        stations, segments = _Boxes(at, at), _Boxes(starts, ends)
        reaches = []
        for zone in zones:
            go_on()
            outline = Outline(zone)
            near, met = stations.rows_near(outline), segments.rows_near(outline)
            inside = outline.holds(_taken(at, near), go_on=go_on)
            crossing = outline.meets(_taken(starts, met), _taken(ends, met), go_on=go_on)
            reaches.append(ZoneReach(zone, network, near[inside], met[crossing]))
        return cls(tuple(reaches))


class _Boxes:
    """The boxes around many lines, sorted by their southern edge: what may lie near a zone."""

    def __init__(self, starts: Points, ends: Points) -> None:
        reached_deg = beside_deg(ends[0], starts[0])
        self._middle_deg = (starts[0] + reached_deg) / 2
        self._half_deg = np.abs(reached_deg - starts[0]) / 2
        south = np.minimum(starts[1], ends[1])
        self._north = np.maximum(starts[1], ends[1])
        self._order = np.argsort(south).astype(np.int32)
        self._sorted_south: Floats = south[self._order]
        self._tallest_deg = float(np.max(self._north - south, initial=0.0))

    def rows_near(self, outline: Outline) -> Rows:
        """The rows, ascending, of the boxes that meet the outline's box, or miss it narrowly."""
        west, south, east, north = outline.box
        # A little more, so that rounding never loses a box that only touches.
        first = np.searchsorted(self._sorted_south, south - self._tallest_deg - _ROUNDING_DEG)
        last = np.searchsorted(self._sorted_south, north, side="right")
        rows = self._order[first:last]
        middle = (west + east) / 2
        apart_deg = np.abs(beside_deg(self._middle_deg[rows], middle) - middle)
        within_deg = self._half_deg[rows] + (east - west) / 2 + _ROUNDING_DEG
        return np.sort(rows[(self._north[rows] >= south) & (apart_deg <= within_deg)])


def _taken(points: Points, rows: Rows) -> Points:
    return points[0][rows], points[1][rows]
