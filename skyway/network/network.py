"""Stations, segments, zones, and the network that they form."""

import copy
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from skyway.errors import InvalidNetwork
from skyway.ids import ConnectorId, StationId
from skyway.network.columns import Adjacency, Columns, Rows, refuse_contradictions
from skyway.network.opening_hours import HOURS, OpeningHours, read_opening_hours
from skyway.network.pad_connectors import PadConnectors
from skyway.network.pad_power import PadPowers
from skyway.network.parts import DEFAULT_PADS, MAX_PADS, Segment, Station, Zone
from skyway.network.views import SegmentView, StationView

__all__ = ["DEFAULT_PADS", "MAX_PADS", "Network", "Segment", "Station", "Zone"]


class Network:
    """A skyway network, never changed once made; `settings` is read by the services only.

    It is held as columns, so a million stations fit in memory. `stations` and `segments` make
    objects when they are read.

    Raises
    ------
    InvalidNetwork
        A segment names a station that is not there, starts where it ends, or repeats another;
        a parking station has no pad; opening hours, powers or connectors are wrong; or two zones
        share an id.
    """

    def __init__(
        self,
        stations: Mapping[StationId, Station],
        segments: Iterable[Segment],
        zones: Iterable[Zone] = (),
        settings: Mapping[str, Any] | None = None,  # any JSON value, see the services
    ) -> None:
        self._fill(Columns.of(stations, segments), zones, settings)

    @classmethod
    def from_columns(
        cls,
        columns: Columns,
        zones: Iterable[Zone] = (),
        settings: Mapping[str, Any] | None = None,
    ) -> "Network":
        """The network of these columns, which belong to it from now on."""
        network = cls.__new__(cls)
        network._fill(columns, zones, settings)
        return network

    def _fill(
        self, columns: Columns, zones: Iterable[Zone], settings: Mapping[str, Any] | None
    ) -> None:
        self._columns = columns
        self._zones = tuple(zones)
        self._settings = {} if settings is None else settings
        self._row_of = {station_id: row for row, station_id in enumerate(columns.station_ids)}
        self._stations = StationView(columns, self._row_of)
        self._leaving: dict[StationId, tuple[Segment, ...]] = {}
        self._opening_hours = {
            columns.station_ids[row]: read_opening_hours(each[HOURS], f"stations.{row}.{HOURS}")
            for row, each in columns.station_properties.items()
            if HOURS in each
        }
        self._pad_powers = PadPowers.of(columns)
        self._pad_connectors = PadConnectors.of(columns)
        self._whole = self
        self._fitting: dict[ConnectorId | None, Network] = {}
        if len({zone.zone_id for zone in self._zones}) < len(self._zones):
            raise InvalidNetwork("zones", "two zones share an id")
        refuse_contradictions(columns, self._row_of)

    @property
    def columns(self) -> Columns:
        """The stations and segments as arrays, rows in the order of the document."""
        return self._columns

    @property
    def row_of(self) -> Mapping[StationId, int]:
        """The row of each station in the columns."""
        return self._row_of

    @property
    def stations(self) -> Mapping[StationId, Station]:
        """The stations by id, in the order of the document."""
        return self._stations

    @property
    def segments(self) -> Sequence[Segment]:
        """The directed segments in the order of the document."""
        return SegmentView(self._columns)

    @property
    def zones(self) -> tuple[Zone, ...]:
        """The zones in the order of the document."""
        return self._zones

    @property
    def opening_hours(self) -> Mapping[StationId, OpeningHours]:
        """The opening hours of the stations that have some; the others are always open."""
        return self._opening_hours

    @property
    def pad_powers(self) -> PadPowers:
        """The power that the pads of each station give."""
        return self._pad_powers

    @property
    def pad_connectors(self) -> PadConnectors:
        """The connectors of the pads of each station."""
        return self._pad_connectors

    def fitting(self, connector: ConnectorId | None) -> "Network":
        """The network as a drone with this connector sees it: without pads that do not fit it.

        Rows are the same. A drone without a connector fits every pad, and sees this network.
        """
        whole = self._whole
        if connector is None:
            return whole
        # All connectors that are on no pad lead to the same network, so few networks are cached.
        key = connector if connector in self._pad_connectors.named else None
        seen = whole._fitting.get(key)
        return seen or whole._fitting.setdefault(key, whole._seen_with(connector))

    def _seen_with(self, connector: ConnectorId) -> "Network":
        unfit = [self._row_of[each] for each in self._pad_connectors.unfit(connector)]
        if not unfit:
            return self
        # Computed before the copy, so that both share them.
        _ = self.outgoing, self.incoming
        pads = self._columns.pads.copy()
        pads[unfit] = 0
        seen = copy.copy(self)
        seen._columns = replace(
            self._columns, pads=pads, parking=self._columns.parking.difference(unfit)
        )
        seen._stations = StationView(seen._columns, self._row_of)
        return seen

    @property
    def settings(self) -> Mapping[str, Any]:
        """The settings that the services read, as they came."""
        return self._settings

    @cached_property
    def outgoing(self) -> Adjacency:
        """The segments that leave each station."""
        return self._adjacency(self._columns.from_row, self._columns.to_row)

    @cached_property
    def incoming(self) -> Adjacency:
        """The segments that reach each station."""
        return self._adjacency(self._columns.to_row, self._columns.from_row)

    @cached_property
    def is_two_way(self) -> bool:
        """Whether each way back is known to be as long as the way there.

        Each segment is longer than 0 and has an opposite segment of the same length. Both also have
        the same place in the lists of segments that leave and that reach a station. This is so if
        the document has one line for both.
        """
        leaving, reaching = self.outgoing, self.incoming
        return (
            np.array_equal(leaving.station, reaching.station)
            and np.array_equal(leaving.length_m, reaching.length_m)
            and bool((leaving.length_m > 0).all())
        )

    def segments_from(self, station_id: StationId) -> tuple[Segment, ...]:
        """The segments that leave this station, in the order of the document."""
        leaving = self._leaving.get(station_id)
        if leaving is None:
            row, segments = self._row_of[station_id], self.segments
            rows = self.outgoing.segment[self.outgoing.at(row)].tolist()
            leaving = tuple(segments[row] for row in rows)
            self._leaving[station_id] = leaving
        return leaving

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Network):
            return NotImplemented
        return (
            self._zones == other.zones
            and self._settings == other.settings
            and (
                _are_equal(self._columns, other.columns)
                # The order of stations means nothing.
                or (self.stations == other.stations and self.segments == other.segments)
            )
        )

    __hash__ = None  # type: ignore[assignment]

    def __getstate__(self) -> dict[str, Any]:
        """All but what is cached: other threads may add to that while the network is packed."""
        return self.__dict__ | {"_fitting": {}, "_leaving": {}}

    def __repr__(self) -> str:
        sizes = f"{len(self._row_of)} stations, {len(self._columns.length_m)} segments"
        return f"<Network of {sizes}, {len(self._zones)} zones>"

    def _adjacency(self, near_row: Rows, far_row: Rows) -> Adjacency:
        return Adjacency.of(
            near_row, far_row, length_m=self._columns.length_m, stations=len(self._row_of)
        )


def _are_equal(columns: Columns, other: Columns) -> bool:
    return (
        columns.station_ids == other.station_ids
        and all(
            np.array_equal(getattr(columns, name), getattr(other, name))
            for name in ("longitude_deg", "latitude_deg", "pads", "from_row", "to_row", "length_m")
        )
        and columns.names == other.names
        and columns.parking == other.parking
        and columns.station_properties == other.station_properties
        and columns.segment_properties == other.segment_properties
    )
