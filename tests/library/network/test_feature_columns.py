"""The fast reader accepts only documents that the slow reader accepts, and reads them the same."""

import copy
import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from skyway.errors import InvalidNetwork
from skyway.geo import Position
from skyway.ids import StationId
from skyway.network.column_fields import Doubtful
from skyway.network.feature_columns import read_by_column
from skyway.network.geojson import read_network, write_network
from skyway.network.geojson_features import read_feature, read_segments, read_station
from skyway.network.network import Network, Segment, Station
from skyway.network.synthetic import synthetic_city

ODD_TEXTS = ["", "s1", "s2", "s3", "b c", "s\n", "é", "x" * 65, "station", "segment", "Point"]
ODD_NUMBERS = [True, False, 0, 1, -1, 2.5, 4.0, 1e9, 10**400, float("nan"), float("inf")]
ODD_ARRAYS = [[], [0.0], [0.0, 0.0], [[0.0, 0.0], [0.0, 0.0]], [True, False]]
ODD_VALUES = st.sampled_from([None, {}, *ODD_TEXTS, *ODD_NUMBERS, *ODD_ARRAYS])


def read_slowly(features: list[Any]) -> Network:
    read = [read_feature(value, f"features.{number}") for number, value in enumerate(features)]
    stations: dict[StationId, Station] = {}
    for feature in read:
        if feature.kind == "station":
            station = read_station(feature)
            if station.station_id in stations:
                raise InvalidNetwork(feature.path, "a second one")
            stations[station.station_id] = station
    segments: list[Segment] = []
    for feature in read:
        if feature.kind == "segment":
            segments.extend(read_segments(feature, stations))
    return Network(stations, segments)


def members(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The paths of all members below this value."""
    inner = value.items() if isinstance(value, dict) else enumerate(value)
    found = []
    for name, below in inner:
        found.append((*path, name))
        if isinstance(below, (dict, list)):
            found.extend(members(below, (*path, name)))
    return found


@st.composite
def damaged_features(draw: st.DrawFn) -> list[Any]:
    city = synthetic_city(stations=draw(st.integers(1, 5)), seed=draw(st.integers(0, 9)))
    features: list[Any] = copy.deepcopy(write_network(city)["features"])
    features = draw(st.permutations(features))
    for _ in range(draw(st.integers(0, 2))):
        *way, last = draw(st.sampled_from(members(features)))
        holder: Any = features
        for part in way:
            holder = holder[part]
        damage = draw(st.sampled_from(["replace", "replace", "take away", "repeat", "add"]))
        if damage == "replace":
            holder[last] = draw(ODD_VALUES)
        elif damage == "take away":
            del holder[last]
        elif damage == "repeat" and isinstance(holder, list):
            holder.append(copy.deepcopy(holder[last]))
        elif isinstance(holder, dict):
            holder[draw(st.sampled_from(["roof", "name", "one_way", "pads", "parking"]))] = draw(
                ODD_VALUES
            )
        if not members(features):
            break
    return features


@given(features=damaged_features())
def test_both_readers_agree_on_every_document_that_the_fast_one_accepts(
    features: list[Any],
) -> None:
    try:
        columns, zones = read_by_column(features)
    except Doubtful:
        return

    fast = Network.from_columns(columns)

    assert not zones
    assert repr(list(fast.segments)) == repr(list(read_slowly(features).segments))
    assert repr(fast.stations.items()) == repr(read_slowly(features).stations.items())


@given(
    names=st.lists(st.none() | st.text(max_size=3), min_size=2, max_size=5),
    roofs=st.lists(st.booleans(), min_size=5, max_size=5),
    one_way=st.lists(st.booleans(), min_size=5, max_size=5),
    lengths=st.lists(st.none() | st.floats(0, 1e6) | st.integers(0, 9), min_size=5, max_size=5),
)
def test_the_fast_reader_accepts_every_document_without_a_fault(
    names: list[str | None],
    roofs: list[bool],
    one_way: list[bool],
    lengths: list[float | None],
) -> None:
    features: list[Any] = []
    for number, name in enumerate(names):
        properties = {"kind": "station", "station_id": f"s{number}", "pads": 4.0, "name": name}
        point = {"type": "Point", "coordinates": [number, 0.5]}
        features.append(
            {
                "type": "Feature",
                "geometry": point,
                "properties": {**properties, **({"roof": "flat"} if roofs[number] else {})},
            }
        )
    for number in range(len(names) - 1):
        line = {"type": "LineString", "coordinates": [[number, 0.5], [number + 1, 0.5001]]}
        properties = {"kind": "segment", "from": f"s{number}", "to": f"s{number + 1}"}
        more = {"one_way": one_way[number], "length_m": lengths[number], "wire": number}
        features.insert(0, {"type": "Feature", "geometry": line, "properties": properties | more})

    columns, _ = read_by_column(features)

    slow = read_slowly(features)
    assert Network.from_columns(columns) == slow
    assert repr(list(Network.from_columns(columns).stations.values())) == repr(
        list(slow.stations.values())
    )


@pytest.mark.parametrize("tolerance_share", [0.5, 0.999999, 1.0, 1.000001, 2.0])
def test_both_readers_agree_on_a_line_that_ends_near_the_tolerance(
    tolerance_share: float,
) -> None:
    city = synthetic_city(stations=2, seed=1)
    document = json.loads(json.dumps(write_network(city)))
    line = document["features"][2]["geometry"]["coordinates"]
    line[0][1] += tolerance_share * 100.0 / 111_195.08

    try:
        assert len(read_network(document).segments) == 2
    except InvalidNetwork:
        with pytest.raises(InvalidNetwork):
            read_slowly(document["features"])
    else:
        read_slowly(document["features"])


def test_positions_of_whole_numbers_are_numbers() -> None:
    station = {"kind": "station", "station_id": "a"}
    point = {"type": "Point", "coordinates": (1, 2)}

    network = read_network(
        {
            "type": "FeatureCollection",
            "features": ({"type": "Feature", "geometry": point, "properties": station},),
        }
    )

    assert network.stations[StationId("a")].position == Position(1.0, 2.0)
