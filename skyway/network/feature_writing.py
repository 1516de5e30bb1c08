"""A network's stations, segments and zones as GeoJSON features."""

from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from typing import Any

import numpy as np
import numpy.typing as npt

from skyway.network.columns import Columns, segment_keys
from skyway.network.parts import Zone


def station_features(columns: Columns) -> Iterator[dict[str, Any]]:
    """The Points of the stations."""
    names, unread = columns.names, columns.station_properties
    longitudes, latitudes = columns.longitude_deg.tolist(), columns.latitude_deg.tolist()
    stations = zip(columns.station_ids, longitudes, latitudes, columns.pads.tolist(), strict=True)
    for row, (station_id, longitude_deg, latitude_deg, pads) in enumerate(stations):
        properties = dict(unread[row]) if row in unread else {}
        properties["kind"] = "station"
        properties["station_id"] = station_id
        if row in names:
            properties["name"] = names[row]
        properties["pads"] = pads
        if row in columns.parking:
            properties["parking"] = True
        yield _feature("Point", [longitude_deg, latitude_deg], properties)


def segment_features(columns: Columns) -> Iterator[dict[str, Any]]:
    """The LineStrings; two opposite segments of equal length and properties become one."""
    ids, unread = columns.station_ids, columns.segment_properties
    at = list(zip(columns.longitude_deg.tolist(), columns.latitude_deg.tolist(), strict=True))
    for row, start, end, length_m, is_one_way in lines(columns):
        properties = dict(unread[row]) if row in unread else {}
        properties["kind"] = "segment"
        properties["from"] = ids[start]
        properties["to"] = ids[end]
        properties["length_m"] = length_m
        properties["one_way"] = is_one_way
        yield _feature("LineString", [[*at[start]], [*at[end]]], properties)


def lines(columns: Columns) -> Iterator[tuple[int, int, int, float, bool]]:
    """For each LineString: its row, the rows of its start and end, its length, and `one_way`."""
    opposite = _opposite_rows(columns)
    rows = np.arange(len(opposite))
    # The first of two opposite segments stands for both.
    written = rows[(opposite < 0) | (rows < opposite)]
    return zip(
        written.tolist(),
        columns.from_row[written].tolist(),
        columns.to_row[written].tolist(),
        columns.length_m[written].tolist(),
        (opposite[written] < 0).tolist(),
        strict=True,
    )


def zone_feature(zone: Zone) -> dict[str, Any]:
    """The Polygon of a zone."""
    properties = {"kind": "zone", "zone_id": zone.zone_id}
    for name, moment in (("active_from", zone.active_from), ("active_until", zone.active_until)):
        if moment is not None:
            properties[name] = _rfc_3339(moment)
    rings = [[list(corner) for corner in ring] for ring in zone.rings]
    return _feature("Polygon", rings, {**zone.properties, **properties})


def _feature(shape: str, coordinates: Any, properties: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": {"type": shape, "coordinates": coordinates},
        "properties": properties,
    }


def _opposite_rows(columns: Columns) -> npt.NDArray[np.int64]:
    """The row of each segment's equal opposite, ``(m,)`` int64, -1 where there is none."""
    from_row, to_row, unread = columns.from_row, columns.to_row, columns.segment_properties
    stations = len(columns.station_ids)
    keys = segment_keys(from_row, to_row, stations=stations)
    if not len(keys):
        return keys
    order = np.argsort(keys)
    reversed_keys = segment_keys(to_row, from_row, stations=stations)
    place = np.minimum(np.searchsorted(keys, reversed_keys, sorter=order), len(keys) - 1)
    opposite = order[place]
    is_equal = (keys[opposite] == reversed_keys) & (columns.length_m[opposite] == columns.length_m)
    for row in unread:
        other = int(opposite[row])
        if is_equal[row] and unread.get(other) != unread[row]:
            is_equal[row] = is_equal[other] = False
    return np.where(is_equal, opposite, -1)


def _rfc_3339(moment: datetime) -> str:
    return moment.astimezone(UTC).isoformat().replace("+00:00", "Z")
