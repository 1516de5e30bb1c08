"""Skyway networks as the text of a GeoJSON document, in and out; see `skyway.network.geojson`."""

import json
import re
from collections.abc import Iterator
from itertools import chain
from json.encoder import encode_basestring_ascii
from typing import Any

import numpy as np

from skyway.json_text import json_value
from skyway.network.column_fields import Doubtful, collector_paused
from skyway.network.columns import Columns, Floats
from skyway.network.feature_columns import read_blocks
from skyway.network.geojson import (
    assembled,
    lines,
    read_network,
    segment_features,
    station_features,
    zone_feature,
)
from skyway.network.network import Network

_HEAD = re.compile(
    r'[ \t\n\r]*\{[ \t\n\r]*"type"[ \t\n\r]*:[ \t\n\r]*"FeatureCollection"[ \t\n\r]*,'
    r'[ \t\n\r]*"features"[ \t\n\r]*:[ \t\n\r]*\[[ \t\n\r]*'
)
_NEXT = re.compile(r',[ \t\n\r]*(?=\{[ \t\n\r]*"type"[ \t\n\r]*:[ \t\n\r]*"Feature")')

_PARKING = ', "parking": true'

#: Characters decoded together: few enough for their objects to stay in a processor's cache.
_BLOCK = 50_000


def read_network_text(text: str | bytes) -> Network:
    """The network that this text describes.

    Raises
    ------
    InvalidNetwork
        Names the field at fault.
    ValueError
        The text is not JSON.
    """
    if isinstance(text, bytes):
        text = text.decode(json.detect_encoding(text), "surrogatepass")
    with collector_paused():
        try:
            return _read_block_by_block(text)
        except Doubtful:
            return read_network(json_value(text))


def network_text(network: Network) -> str:
    """The GeoJSON of this network in one line, equal to `json.dumps` of `write_network`."""
    columns = network.columns
    with collector_paused():
        features = ", ".join(
            chain(
                _stations(columns),
                _segments(columns),
                map(_dumped, map(zone_feature, network.zones)),
            )
        )
    settings = f', "settings": {_dumped(dict(network.settings))}' if network.settings else ""
    return f'{{"type": "FeatureCollection", "features": [{features}]{settings}}}'


def _read_block_by_block(text: str) -> Network:
    features = _FeatureText(text)
    columns, zone_features = read_blocks(features.blocks())
    return assembled(columns, zone_features, features.other_members())


def _stations(columns: Columns) -> Iterator[str]:
    if columns.station_properties or not _are_finite(columns.longitude_deg, columns.latitude_deg):
        return map(_dumped, station_features(columns))
    ids = map(encode_basestring_ascii, columns.station_ids)
    names, parking = columns.names, columns.parking
    longitudes, latitudes = columns.longitude_deg.tolist(), columns.latitude_deg.tolist()
    stations = zip(ids, longitudes, latitudes, columns.pads.tolist(), strict=True)
    return (
        f'{{"type": "Feature", "geometry": {{"type": "Point", "coordinates": [{longitude_deg!r}, '
        f'{latitude_deg!r}]}}, "properties": {{"kind": "station", "station_id": {station_id}, '
        f'{_name(names[row]) if row in names else ""}"pads": {pads}'
        f"{_PARKING if row in parking else ''}}}}}"
        for row, (station_id, longitude_deg, latitude_deg, pads) in enumerate(stations)
    )


def _segments(columns: Columns) -> Iterator[str]:
    if columns.segment_properties or not _are_finite(
        columns.longitude_deg, columns.latitude_deg, columns.length_m
    ):
        return map(_dumped, segment_features(columns))
    ids = list(map(encode_basestring_ascii, columns.station_ids))
    at = [
        f"[{longitude_deg!r}, {latitude_deg!r}]"
        for longitude_deg, latitude_deg in zip(
            columns.longitude_deg.tolist(), columns.latitude_deg.tolist(), strict=True
        )
    ]
    return (
        '{"type": "Feature", "geometry": {"type": "LineString", "coordinates": '
        f'[{at[start]}, {at[end]}]}}, "properties": {{"kind": "segment", "from": {ids[start]}, '
        f'"to": {ids[end]}, "length_m": {length_m!r}, '
        f'"one_way": {"true" if is_one_way else "false"}}}}}'
        for _, start, end, length_m, is_one_way in lines(columns)
    )


def _name(name: str) -> str:
    return f'"name": {encode_basestring_ascii(name)}, '


def _dumped(value: Any) -> str:  # any JSON value
    return json.dumps(value)


def _are_finite(*columns: Floats) -> bool:
    return all(np.isfinite(column).all() for column in columns)


class _FeatureText:
    """The text of a FeatureCollection that begins with its type and its features.

    Features are decoded block after block: a whole document as Python objects is ten times its
    text, and slow.

    Raises
    ------
    Doubtful
        It begins in another way, or is not JSON; `json.loads` of the whole text decides.
    """

    def __init__(self, text: str) -> None:
        head = _HEAD.match(text)
        if head is None:
            raise Doubtful
        self._text = text
        self._at = head.end()

    def blocks(self) -> Iterator[list[Any]]:
        """The features, a block at a time."""
        text, at = self._text, self._at
        try:
            # If a text only looks like a feature's beginning, the halves are not JSON.
            while (following := _NEXT.search(text, at + _BLOCK)) is not None:
                yield json.loads(f"[{text[at : following.start()]}]")
                at = following.end()
            block, length = json.JSONDecoder().raw_decode(f"[{text[at:]}")
        except ValueError as error:
            raise Doubtful from error
        yield block
        self._at = at + length - 1

    def other_members(self) -> dict[str, Any]:
        """The members after the features, once all blocks are read."""
        tail = self._text[self._at :].lstrip(" \t\n\r")
        if tail.strip(" \t\n\r") == "}":
            return {}
        try:
            others: dict[str, Any] = json.loads("{" + tail.removeprefix(","))
        except ValueError as error:
            raise Doubtful from error
        # A comma with nothing after it is not JSON; a second `features` would replace the first.
        if not others or not tail.startswith(",") or {"type", "features"} & others.keys():
            raise Doubtful
        return others
