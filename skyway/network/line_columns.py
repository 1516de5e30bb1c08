"""Lines between stations read by the column, block after block, and their segments."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skyway.ids import StationId
from skyway.network import column_fields
from skyway.network.column_fields import Doubtful
from skyway.network.columns import Floats, Rows, first_repeated, segment_keys
from skyway.network.geojson_features import (
    LINE_END_TOLERANCE_M,
    MAX_SEGMENT_LENGTH_M,
    SEGMENT_PROPERTIES,
)
from skyway.network.great_circle import distances_m
from skyway.network.station_columns import PlacedStations

#: Rounding can make a distance differ by less than this, metres; the slow reader judges such ends.
_ROUNDING_M = 1e-3

_KNOWN = frozenset(SEGMENT_PROPERTIES)


@dataclass(frozen=True, slots=True, eq=False)
class DirectedSegments:
    """Ends by the stations' rows, lengths, and the properties that Skyway does not read."""

    from_row: Rows
    to_row: Rows
    length_m: Floats
    unread: dict[int, dict[str, Any]]


class _Ends:
    """One end of each line, as the station's row.

    Names are looked up and dropped immediately. Kept beside values that are freed, they would
    fragment the memory.
    """

    def __init__(self) -> None:
        self._rows: list[Rows] = [np.empty(0, np.int32)]
        self._count = 0
        self._late: dict[int, Any] = {}  # any JSON values that may yet be a station's name

    def read(self, names: Sequence[Any], row_of: Mapping[StationId, int]) -> None:
        try:
            rows = np.array([row_of.get(name, -1) for name in names], np.int32)
        except TypeError as error:  # no station can have such an id
            raise Doubtful from error
        for index in np.flatnonzero(rows < 0).tolist():
            self._late[self._count + index] = names[index]
        self._rows.append(rows)
        self._count += len(names)

    def rows(self, row_of: Mapping[StationId, int]) -> Rows:
        rows = np.concatenate(self._rows)
        for index, name in self._late.items():
            if name not in row_of:
                raise Doubtful
            rows[index] = row_of[name]
        return rows


class LineColumns:
    """The lines' columns, and their directed segments."""

    def __init__(self) -> None:
        self._ends = {"from": _Ends(), "to": _Ends()}
        self._longitudes: list[Floats] = [np.empty(0)]
        self._latitudes: list[Floats] = [np.empty(0)]
        self._lengths: list[Floats] = [np.empty(0)]
        self._one_way: list[bool] = []
        self._unread: dict[int, dict[str, Any]] = {}

    def read(
        self,
        properties: Sequence[Any],
        coordinates: Sequence[Any],
        *,
        row_of: Mapping[StationId, int],
    ) -> None:
        """Read these lines; stations that come later are looked up later.

        Raises
        ------
        Doubtful
            They hold a fault, or something unusual.
        """
        first = len(self._one_way)
        for name, ends in self._ends.items():
            ends.read(column_fields.member(properties, name), row_of)
        longitude_deg, latitude_deg = column_fields.positions(
            column_fields.arrays(coordinates, length=2)
        )
        self._longitudes.append(longitude_deg)
        self._latitudes.append(latitude_deg)
        self._lengths.append(_lengths_m([each.get("length_m") for each in properties]))
        one_way = [each.get("one_way", False) for each in properties]
        column_fields.truths(one_way)
        self._one_way.extend(one_way)
        for index, unread in column_fields.unknown_members(properties, _KNOWN).items():
            self._unread[first + index] = unread

    def directed(self, stations: PlacedStations) -> DirectedSegments:
        """The segments, in both directions unless a line is `one_way`; `Doubtful` on a fault."""
        start, end = (ends.rows(stations.row_of) for ends in self._ends.values())
        longitude_deg, latitude_deg = map(np.concatenate, (self._longitudes, self._latitudes))
        for nth, rows in enumerate((start, end)):
            _refuse_ends_elsewhere(longitude_deg[nth::2], latitude_deg[nth::2], rows, stations)
        length_m = np.concatenate(self._lengths)
        is_missing = np.isnan(length_m)
        length_m[is_missing] = _apart_m(start[is_missing], end[is_missing], stations)

        is_both_ways = ~np.array(self._one_way, np.bool_)
        times = 1 + is_both_ways
        forth = np.cumsum(times) - times
        back = forth[is_both_ways] + 1
        from_row, to_row = np.repeat(start, times), np.repeat(end, times)
        from_row[back], to_row[back] = end[is_both_ways], start[is_both_ways]
        keys = segment_keys(from_row, to_row, stations=len(stations.row_of))
        if (from_row == to_row).any() or first_repeated(keys) is not None:
            raise Doubtful
        unread = {}
        for line, properties in self._unread.items():
            row = forth.item(line)
            for directed in range(row, row + times.item(line)):
                unread[directed] = properties
        return DirectedSegments(from_row, to_row, np.repeat(length_m, times), unread)


def _lengths_m(given: Sequence[Any]) -> Floats:
    """The lengths that are given, not a number where none is."""
    is_given = np.array([each is not None for each in given], np.bool_)
    length_m = np.full(len(given), np.nan)
    length_m[is_given] = column_fields.numbers(
        [each for each in given if each is not None], low=0.0, high=MAX_SEGMENT_LENGTH_M
    )
    return length_m


def _apart_m(start: Rows, end: Rows, stations: PlacedStations) -> Floats:
    """The great circle between stations."""
    longitude_deg, latitude_deg = stations.longitude_deg, stations.latitude_deg
    return distances_m(
        (longitude_deg[start], longitude_deg[end]), (latitude_deg[start], latitude_deg[end])
    )


def _refuse_ends_elsewhere(
    longitude_deg: Floats, latitude_deg: Floats, rows: Rows, stations: PlacedStations
) -> None:
    """Every line must end where its station stands."""
    station_longitude_deg = stations.longitude_deg[rows]
    station_latitude_deg = stations.latitude_deg[rows]
    apart = (longitude_deg != station_longitude_deg) | (latitude_deg != station_latitude_deg)
    away_m = distances_m(
        (longitude_deg[apart], station_longitude_deg[apart]),
        (latitude_deg[apart], station_latitude_deg[apart]),
    )
    if (away_m > LINE_END_TOLERANCE_M - _ROUNDING_M).any():
        raise Doubtful
