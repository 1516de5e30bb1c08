"""Stations and segments as objects, made from the columns when they are read."""

from collections.abc import ItemsView, Iterator, Mapping, Sequence, ValuesView
from typing import overload

from skyway.geo import Position
from skyway.ids import StationId
from skyway.network.columns import Columns
from skyway.network.parts import Segment, Station


class StationView(Mapping[StationId, Station]):
    """The stations by id, in the order of the document.

    A station that is read by its id is kept, because such stations are read often. Stations that
    are only iterated over are not kept: a million objects are heavy.
    """

    __slots__ = ("_columns", "_kept", "_row_of")

    def __init__(self, columns: Columns, row_of: Mapping[StationId, int]) -> None:
        self._columns = columns
        self._row_of = row_of
        self._kept: dict[StationId, Station] = {}

    def __getitem__(self, station_id: StationId) -> Station:
        station = self._kept.get(station_id)
        if station is None:
            row, columns = self._row_of[station_id], self._columns
            station = Station(
                columns.station_ids[row],
                Position(columns.longitude_deg.item(row), columns.latitude_deg.item(row)),
                columns.pads.item(row),
                columns.names.get(row),
                columns.station_properties.get(row, {}),
                row in columns.parking,
            )
            self._kept[station_id] = station
        return station

    def __contains__(self, station_id: object) -> bool:
        return station_id in self._row_of

    def __iter__(self) -> Iterator[StationId]:
        return iter(self._row_of)

    def __len__(self) -> int:
        return len(self._row_of)

    def __repr__(self) -> str:
        return f"<{len(self)} stations>"

    def values(self) -> ValuesView[Station]:
        """The stations in the order of the document."""
        return _StationValues(self)

    def items(self) -> ItemsView[StationId, Station]:
        """The stations with their ids in the order of the document."""
        return _StationItems(self)

    def in_order(self) -> Iterator[Station]:
        """Every station, each time as a new object."""
        columns = self._columns
        rows = zip(
            columns.station_ids,
            map(Position, columns.longitude_deg.tolist(), columns.latitude_deg.tolist()),
            columns.pads.tolist(),
            strict=True,
        )
        names, properties = columns.names, columns.station_properties
        for row, (station_id, position, pads) in enumerate(rows):
            yield Station(
                station_id,
                position,
                pads,
                names.get(row),
                properties.get(row, {}),
                row in columns.parking,
            )


class _StationValues(ValuesView[Station]):
    __slots__ = ()
    _mapping: StationView

    def __iter__(self) -> Iterator[Station]:
        return self._mapping.in_order()


class _StationItems(ItemsView[StationId, Station]):
    __slots__ = ()
    _mapping: StationView

    def __iter__(self) -> Iterator[tuple[StationId, Station]]:
        return ((station.station_id, station) for station in self._mapping.in_order())


class SegmentView(Sequence[Segment]):
    """The directed segments in the order of the document; equal to any sequence of equal ones."""

    __slots__ = ("_columns",)

    def __init__(self, columns: Columns) -> None:
        self._columns = columns

    @overload
    def __getitem__(self, index: int) -> Segment: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Segment, ...]: ...
    def __getitem__(self, index: int | slice) -> Segment | tuple[Segment, ...]:
        if isinstance(index, slice):
            return tuple(map(self._segment, range(*index.indices(len(self)))))
        return self._segment(range(len(self))[index])

    def __len__(self) -> int:
        return len(self._columns.length_m)

    def __iter__(self) -> Iterator[Segment]:
        columns = self._columns
        ids, properties = columns.station_ids, columns.segment_properties
        rows = zip(
            columns.from_row.tolist(),
            columns.to_row.tolist(),
            columns.length_m.tolist(),
            strict=True,
        )
        for row, (start, end, length_m) in enumerate(rows):
            yield Segment(ids[start], ids[end], length_m, properties.get(row, {}))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Sequence):
            return NotImplemented
        return len(self) == len(other) and all(map(Segment.__eq__, self, other))

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<{len(self)} segments>"

    def _segment(self, row: int) -> Segment:
        columns = self._columns
        return Segment(
            columns.station_ids[columns.from_row[row]],
            columns.station_ids[columns.to_row[row]],
            columns.length_m.item(row),
            columns.segment_properties.get(row, {}),
        )
