"""A network's stations and segments as columns: the form for reading, writing and searching."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from skyway.errors import InvalidNetwork
from skyway.ids import StationId
from skyway.network.parts import Segment, Station

Floats = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int32]

#: Why a parking station without pads is refused.
PARKING_WITHOUT_PADS: Final = "a parking station needs at least 1 pad"


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Stations and directed segments, a row each, in the order of the document.

    The arrays belong to the network. Nobody writes to them.

    Parameters
    ----------
    station_ids
        ``(n,)``, all different.
    longitude_deg, latitude_deg
        ``(n,)`` float64.
    pads
        ``(n,)`` int32.
    from_row, to_row
        ``(m,)`` int32, rows of stations.
    length_m
        ``(m,)`` float64.
    names
        By the station's row, for stations that have a name.
    station_properties, segment_properties
        By row: the properties that Skyway does not read.
    parking
        The rows of the parking stations, each with at least one pad.
    """

    station_ids: tuple[StationId, ...]
    longitude_deg: Floats
    latitude_deg: Floats
    pads: Rows
    from_row: Rows
    to_row: Rows
    length_m: Floats
    names: Mapping[int, str] = field(default_factory=dict)
    station_properties: Mapping[int, Mapping[str, Any]] = field(default_factory=dict)
    segment_properties: Mapping[int, Mapping[str, Any]] = field(default_factory=dict)
    parking: frozenset[int] = frozenset()

    @classmethod
    def of(cls, stations: Mapping[StationId, Station], segments: Iterable[Segment]) -> "Columns":
        """The columns of these objects.

        Raises
        ------
        InvalidNetwork
            A segment names a station that is not there.
        """
        row_of = {station_id: row for row, station_id in enumerate(stations)}
        in_order, segments = list(stations.values()), list(segments)
        return cls(
            station_ids=tuple(stations),
            longitude_deg=np.array([s.position.longitude_deg for s in in_order], np.float64),
            latitude_deg=np.array([s.position.latitude_deg for s in in_order], np.float64),
            pads=np.array([station.pads for station in in_order], np.int32),
            from_row=_rows([segment.from_id for segment in segments], row_of),
            to_row=_rows([segment.to_id for segment in segments], row_of),
            length_m=np.array([segment.length_m for segment in segments], np.float64),
            names={row: s.name for row, s in enumerate(in_order) if s.name is not None},
            station_properties={r: s.properties for r, s in enumerate(in_order) if s.properties},
            segment_properties={r: s.properties for r, s in enumerate(segments) if s.properties},
            parking=frozenset(row for row, s in enumerate(in_order) if s.is_parking),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Adjacency:
    """The segments at each station; the segments of one station in the order of the document.

    Entries ``offsets[row]`` up to ``offsets[row + 1]`` belong to the station of that row.

    Parameters
    ----------
    offsets
        ``(n + 1,)`` int64.
    station
        ``(m,)`` int32, the row of the station at the other end.
    segment
        ``(m,)`` int32, the segment's row.
    length_m
        ``(m,)`` float64.
    """

    offsets: npt.NDArray[np.int64]
    station: Rows
    segment: Rows
    length_m: Floats

    @classmethod
    def of(cls, near_row: Rows, far_row: Rows, *, length_m: Floats, stations: int) -> "Adjacency":
        """The adjacency in which each segment stands at its near end."""
        segment = np.argsort(near_row, kind="stable").astype(np.int32)
        offsets = np.zeros(stations + 1, np.int64)
        np.cumsum(np.bincount(near_row, minlength=stations), out=offsets[1:])
        return cls(offsets, far_row[segment], segment, length_m[segment])

    def at(self, row: int) -> slice:
        """The entries of this station."""
        return slice(int(self.offsets[row]), int(self.offsets[row + 1]))

    def degrees(self) -> npt.NDArray[np.int64]:
        """How many segments each station has, ``(n,)``."""
        return np.diff(self.offsets)


def refuse_contradictions(columns: Columns, row_of: Mapping[StationId, int]) -> None:
    """Refuse wrong stations and segments.

    Wrong are two stations of one id, a parking station without pads, and a segment with a missing
    end, with equal ends, or repeated.

    Raises
    ------
    InvalidNetwork
        Names the first station or segment at fault by its row.
    """
    stations = len(columns.station_ids)
    if len(row_of) < stations:
        raise InvalidNetwork("stations", "two stations share an id")
    if (row := parking_without_pads(columns.parking, columns.pads)) is not None:
        raise InvalidNetwork(f"stations.{row}", PARKING_WITHOUT_PADS)
    from_row, to_row = columns.from_row, columns.to_row
    lost = (np.minimum(from_row, to_row) < 0) | (np.maximum(from_row, to_row) >= stations)
    if lost.any():
        number = int(lost.argmax())
        ends = f"{from_row[number]} to {to_row[number]}"
        raise InvalidNetwork(f"segments.{number}", f"row {ends}: there are {stations} stations")
    standing = from_row == to_row
    if standing.any():
        number = int(standing.argmax())
        name = columns.station_ids[from_row[number]]
        raise InvalidNetwork(f"segments.{number}", f"starts where it ends: {name!r}")
    repeated = first_repeated(segment_keys(from_row, to_row, stations=stations))
    if repeated is not None:
        from_id, to_id = (columns.station_ids[ends[repeated]] for ends in (from_row, to_row))
        raise InvalidNetwork(f"segments.{repeated}", f"a second one from {from_id!r} to {to_id!r}")


def parking_without_pads(parking: Iterable[int], pads: npt.NDArray[Any]) -> int | None:
    """The first row of a parking station that has no pad; None when each has one."""
    return min((row for row in parking if pads[row] < 1), default=None)


def segment_keys(from_row: Rows, to_row: Rows, *, stations: int) -> npt.NDArray[np.int64]:
    """One number for each pair of ends, ``(m,)`` int64, different for different ends."""
    return from_row.astype(np.int64) * stations + to_row


def first_repeated(keys: npt.NDArray[np.int64]) -> int | None:
    """The first index whose key also stands at a smaller index; None when all keys differ."""
    in_order = np.sort(keys)
    if not (in_order[1:] == in_order[:-1]).any():
        return None
    order = np.argsort(keys, kind="stable")
    return int(order[1:][keys[order][1:] == keys[order][:-1]].min())


def _rows(ids: list[StationId], row_of: Mapping[StationId, int]) -> Rows:
    rows = [row_of.get(station_id, -1) for station_id in ids]
    if -1 in rows:
        number = rows.index(-1)
        raise InvalidNetwork(f"segments.{number}", f"no station is called {ids[number]!r}")
    return np.array(rows, np.int32)
