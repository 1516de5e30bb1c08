"""Stations read by the column, block after block."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skyway.errors import InvalidNetwork
from skyway.ids import StationId
from skyway.network import column_fields
from skyway.network.column_fields import Doubtful
from skyway.network.columns import Floats, Rows, parking_without_pads
from skyway.network.geojson_features import STATION_PROPERTIES
from skyway.network.opening_hours import HOURS, read_opening_hours
from skyway.network.pad_connectors import PAD_CONNECTORS, read_pad_connectors
from skyway.network.pad_power import has_power, read_pad_power
from skyway.network.parts import DEFAULT_PADS, MAX_PADS

_KNOWN = frozenset(STATION_PROPERTIES)


@dataclass(frozen=True, slots=True, eq=False)
class PlacedStations:
    """Where the stations stand, by row, and the row of each."""

    longitude_deg: Floats
    latitude_deg: Floats
    row_of: Mapping[StationId, int]


class StationColumns:
    """The stations' columns; `names` and `unread` properties by row, where there are any.

    `row_of` holds the row of each station read so far, and `parking` the rows of parking stations.
    """

    def __init__(self) -> None:
        self.names: dict[int, str] = {}
        self.unread: dict[int, dict[str, Any]] = {}
        self.parking: set[int] = set()
        self.row_of: dict[StationId, int] = {}
        self._longitudes: list[Floats] = [np.empty(0)]
        self._latitudes: list[Floats] = [np.empty(0)]
        self._pads: list[Floats] = [np.empty(0)]

    def read(self, properties: Sequence[Any], coordinates: Sequence[Any]) -> None:
        """Read these stations.

        Raises
        ------
        Doubtful
            They hold a fault, or something unusual.
        """
        first = len(self.row_of)
        ids = column_fields.member(properties, "station_id")
        column_fields.identifiers(ids)
        names = [each.get("name") for each in properties]
        column_fields.texts_or_none(names)
        pads = [each.get("pads", DEFAULT_PADS) for each in properties]
        parking = column_fields.rows_of_truth([each.get("parking", False) for each in properties])
        longitude_deg, latitude_deg = column_fields.positions(coordinates)
        self.row_of.update(zip(ids, range(first, first + len(ids)), strict=True))
        if len(self.row_of) < first + len(ids):
            raise Doubtful
        self._longitudes.append(longitude_deg)
        self._latitudes.append(latitude_deg)
        self._pads.append(column_fields.whole_numbers(pads, low=0, high=MAX_PADS))
        if parking_without_pads(parking, self._pads[-1]) is not None:
            raise Doubtful
        self.parking.update(first + row for row in parking)
        for row, name in enumerate(names, start=first):
            if name is not None:
                self.names[row] = name
        for index, unread in column_fields.unknown_members(properties, _KNOWN).items():
            _check_kept(unread, pads=int(self._pads[-1][index]))
            self.unread[first + index] = unread

    def placed(self) -> PlacedStations:
        """All stations together."""
        return PlacedStations(
            np.concatenate(self._longitudes), np.concatenate(self._latitudes), self.row_of
        )

    def pads(self) -> Rows:
        """The pads of each station, ``(n,)``."""
        return np.concatenate(self._pads).astype(np.int32)


def _check_kept(properties: Mapping[str, Any], *, pads: int) -> None:
    """Doubt opening hours, powers and connectors with a fault; they stay among the properties."""
    try:
        if HOURS in properties:
            read_opening_hours(properties[HOURS], HOURS)
        if has_power(properties):
            read_pad_power(properties, "properties", pads=pads)
        if PAD_CONNECTORS in properties:
            read_pad_connectors(properties, "properties", pads=pads)
    except InvalidNetwork as error:
        raise Doubtful from error
