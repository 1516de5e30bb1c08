import copy
import json
from datetime import UTC, datetime
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from skyway.bounds import EARLIEST, LATEST
from skyway.errors import InvalidNetwork
from skyway.geo import Position, distance_m
from skyway.ids import StationId, ZoneId
from skyway.network.geojson import read_network, write_network
from skyway.network.network import Network, Segment, Station, Zone


def make_station(station_id: str, *, at: tuple[float, float] = (0.0, 0.0), **more: Any) -> Any:
    return {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": list(at)},
        "properties": {"kind": "station", "station_id": station_id, **more},
    }


def make_segment(start: Any, end: Any, **more: Any) -> Any:
    ends = {
        "from": start["properties"]["station_id"],
        "to": end["properties"]["station_id"],
    }
    line = [start["geometry"]["coordinates"], end["geometry"]["coordinates"]]
    return {
        "type": "Feature",
        "geometry": {"type": "LineString", "coordinates": line},
        "properties": {"kind": "segment", **ends, **more},
    }


def make_zone(zone_id: str, **more: Any) -> Any:
    ring = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]]
    return {
        "type": "Feature",
        "geometry": {"type": "Polygon", "coordinates": [ring]},
        "properties": {"kind": "zone", "zone_id": zone_id, **more},
    }


A = make_station("a")
B = make_station("b", at=(0.1, 0.2))


def make_document(*features: Any, **more: Any) -> dict[str, Any]:
    return {"type": "FeatureCollection", "features": list(features), **more}


def test_a_document_gives_stations_segments_zones_and_settings() -> None:
    a = make_station("a", name="City hall", pads=2, roof="flat")
    zone = make_zone("park", active_from="2026-05-01T10:00:00+02:00", active_until=None)
    document = make_document(
        make_segment(a, B, one_way=True, length_m=25_000, wire=1), a, B, zone, settings={"x": 1}
    )

    network = read_network(document)

    assert network.stations["a"] == Station(  # type: ignore[index]
        StationId("a"), Position(0.0, 0.0), 2, "City hall", {"roof": "flat"}
    )
    assert network.segments == (Segment(StationId("a"), StationId("b"), 25_000.0, {"wire": 1}),)
    assert network.zones[0].active_from == datetime(2026, 5, 1, 8, tzinfo=UTC)
    assert network.zones[0].active_until is None
    assert network.settings == {"x": 1}


def test_a_station_without_pads_property_has_four_pads() -> None:
    assert read_network(make_document(A)).stations[StationId("a")].pads == 4


def test_a_parking_station_is_read_and_written_as_such() -> None:
    network = read_network(make_document(A, make_station("p", parking=True)))

    written = write_network(network)

    assert [each.is_parking for each in network.stations.values()] == [False, True]
    assert network.stations[StationId("p")].is_parking
    assert [each["properties"].get("parking") for each in written["features"]] == [None, True]
    assert read_network(written) == network
    assert read_network(make_document(A, make_station("p"))) != network


def test_a_parking_station_without_pads_is_refused() -> None:
    with pytest.raises(InvalidNetwork) as refusal:
        read_network(make_document(A, make_station("p", parking=True, pads=0)))

    field = "features.1.properties.parking"
    assert str(refusal.value) == (
        f"{field}: a parking station needs at least 1 pad: this station has 0"
    )


def test_a_line_means_both_directions_unless_it_is_one_way() -> None:
    network = read_network(make_document(A, B, make_segment(A, B)))

    assert [(s.from_id, s.to_id) for s in network.segments] == [("a", "b"), ("b", "a")]


def test_a_segment_without_length_is_as_long_as_the_great_circle() -> None:
    network = read_network(make_document(A, B, make_segment(A, B)))

    assert network.segments[0].length_m == distance_m(Position(0.0, 0.0), Position(0.1, 0.2))


def test_opposite_segments_of_equal_length_become_one_line() -> None:
    network = read_network(make_document(A, B, make_segment(A, B, wire=1)))

    lines = [f for f in write_network(network)["features"] if f["properties"]["kind"] == "segment"]

    assert [line["properties"]["one_way"] for line in lines] == [False]
    assert lines[0]["properties"]["wire"] == 1


def test_opposite_segments_that_differ_become_two_lines() -> None:
    there, back = make_segment(A, B, one_way=True), make_segment(B, A, one_way=True, wire=1)
    network = read_network(make_document(A, B, there, back))

    lines = [f for f in write_network(network)["features"] if f["properties"]["kind"] == "segment"]

    assert [line["properties"]["one_way"] for line in lines] == [True, True]
    assert read_network(write_network(network)) == network


def changed(path: str, value: Any) -> dict[str, Any]:
    """A good document with one member replaced; `...` takes it away."""
    zone = make_zone(
        "park", active_from="2026-05-01T10:00:00Z", active_until="2026-05-02T10:00:00Z"
    )
    document = copy.deepcopy(
        make_document(A, B, make_segment(A, B, length_m=5.0), zone, settings={})
    )
    *way, last = [int(part) if part.isdigit() else part for part in path.split(".")]
    holder: Any = document
    for part in way:
        holder = holder[part]
    if value is ...:
        del holder[last]
    else:
        holder[last] = value
    return document


STATION, SEGMENT, ZONE = "features.1.properties", "features.2.properties", "features.3.properties"
LINE, RINGS = "features.2.geometry.coordinates", "features.3.geometry.coordinates"


@pytest.mark.parametrize(
    ("path", "value", "detail"),
    [
        ("type", "Feature", "'Feature' is not 'FeatureCollection'"),
        ("type", ..., "null is not 'FeatureCollection'"),
        ("features", ..., "null is not an array"),
        ("settings", [], "an array is not an object"),
        ("features.1", 7, "7 is not an object"),
        ("features.1.type", "Point", "'Point' is not 'Feature'"),
        ("features.1.properties", None, "null is not an object"),
        ("features.1.geometry", None, "null is not an object"),
        ("features.1.geometry.type", "Polygon", "'Polygon' is not 'Point'"),
        ("features.1.geometry.coordinates", [1.0, 2.0, 3.0, 4.0], "4 numbers instead of"),
        ("features.1.geometry.coordinates.0", 180.1, "180.1 is above 180"),
        ("features.1.geometry.coordinates.1", -91, "-91 is below -90"),
        ("features.1.geometry.coordinates.1", "1", "'1' is not a number"),
        (f"{STATION}.kind", "node", "'node' is none of station, segment, zone"),
        (f"{STATION}.kind", ["station"], "an array is none of"),
        (f"{STATION}.station_id", ..., "is missing"),
        (f"{STATION}.station_id", "b c", "'b c' is not an identifier"),
        (f"{STATION}.station_id", "b\n", "is not an identifier"),
        (f"{STATION}.station_id", "b" * 65, "is not an identifier"),
        (f"{STATION}.station_id", 7, "7 is not an identifier"),
        (f"{STATION}.station_id", "a", "a second station called 'a'"),
        (f"{STATION}.pads", -1, "-1 is below 0"),
        (f"{STATION}.pads", 1_001, "1001 is above 1000"),
        (f"{STATION}.pads", 1.5, "1.5 is not a whole number"),
        (f"{STATION}.pads", True, "true is not a number"),
        (f"{STATION}.pads", None, "null is not a number"),
        (f"{STATION}.parking", "yes", "'yes' is neither true nor false"),
        (f"{STATION}.parking", None, "null is neither true nor false"),
        (f"{STATION}.name", 7, "7 is not a string"),
        (f"{SEGMENT}.from", "c", "no station is called 'c'"),
        (f"{SEGMENT}.to", ..., "is missing"),
        (f"{SEGMENT}.length_m", -0.5, "-0.5 is below 0"),
        (f"{SEGMENT}.length_m", float("nan"), "nan is not a finite number"),
        (f"{SEGMENT}.length_m", float("inf"), "inf is not a finite number"),
        (f"{SEGMENT}.length_m", 10**400, "a number of more than 40 digits is above"),
        (f"{SEGMENT}.one_way", 1, "1 is neither true nor false"),
        (f"{SEGMENT}.one_way", None, "null is neither true nor false"),
        (f"{LINE}", [[0.0, 0.0]], "1 positions instead of 2"),
        (f"{LINE}.1", [0.1, 0.21], "from station 'b', more than 100 m"),
        (f"{ZONE}.zone_id", ..., "is missing"),
        (f"{ZONE}.active_from", "2026-05-01T10:00:00", "must be a moment like"),
        (f"{ZONE}.active_from", "tomorrow", "not 'tomorrow'"),
        (f"{ZONE}.active_from", 7, "must be a moment like"),
        (f"{ZONE}.active_until", "2026-05-01T10:00:00Z", "is not after active_from"),
        (f"{RINGS}", [], "a zone without an outer ring"),
        (f"{RINGS}.0", [[0, 0], [1, 1], [0, 0]], "3 positions, fewer than 4"),
        (f"{RINGS}.0.3", [0.0, 0.5], "the ring is not closed"),
        (f"{RINGS}.0.2", [0.0], "1 numbers instead of"),
    ],
)
def test_an_error_names_the_path_and_the_limit(path: str, value: Any, detail: str) -> None:
    # A ring's end is named by its ring.
    field = f"{RINGS}.0" if path == f"{RINGS}.0.3" else path

    with pytest.raises(InvalidNetwork) as refusal:
        read_network(changed(path, value))

    assert refusal.value.field == field
    assert detail in refusal.value.detail


def test_an_altitude_is_read_and_not_used() -> None:
    high = changed("features.1.geometry.coordinates", [1.0, 2.0, 350.5])
    flat = changed("features.1.geometry.coordinates", [1.0, 2.0])
    for document in (high, flat):
        del document["features"][2:]

    assert read_network(high) == read_network(flat)
    with pytest.raises(InvalidNetwork, match=r"coordinates\.2: 'high' is not a number"):
        read_network(changed("features.1.geometry.coordinates", [1.0, 2.0, "high"]))


@pytest.mark.parametrize(
    ("name", "is_read"),
    [
        ("urn:ogc:def:crs:OGC:1.3:CRS84", True),
        ("urn:ogc:def:crs:EPSG::4326", True),
        ("EPSG:4326", True),
        ("urn:ogc:def:crs:EPSG::3857", False),
        ("urn:ogc:def:crs:OGC:1.3:CRS83", False),
        (None, False),
    ],
)
def test_a_document_in_other_coordinates_is_refused(name: str | None, is_read: bool) -> None:
    document = make_document(A, B) | {"crs": {"type": "name", "properties": {"name": name}}}

    if is_read:
        assert read_network(document) == read_network(make_document(A, B))
        return
    with pytest.raises(InvalidNetwork, match=r"crs: .* is not EPSG:4326"):
        read_network(document)


def test_a_document_that_is_not_an_object_is_refused() -> None:
    with pytest.raises(InvalidNetwork, match="network: an array is not an object"):
        read_network([])  # type: ignore[arg-type]


def test_a_segment_parallel_to_another_is_refused() -> None:
    with pytest.raises(InvalidNetwork) as refusal:
        read_network(make_document(A, B, make_segment(A, B), make_segment(B, A, one_way=True)))

    assert str(refusal.value) == "features.3.properties.to: a second segment from 'b' to 'a'"


def test_a_segment_that_starts_where_it_ends_is_refused() -> None:
    with pytest.raises(InvalidNetwork, match="the segment starts where it ends: 'a'"):
        read_network(make_document(A, make_segment(A, A)))


def test_a_second_zone_of_the_same_name_is_refused() -> None:
    with pytest.raises(InvalidNetwork, match="a second zone called 'park'"):
        read_network(make_document(make_zone("park"), make_zone("park")))


IDENTIFIERS = st.from_regex(r"[A-Za-z0-9_-]{1,8}", fullmatch=True)
POSITIONS = st.builds(Position, st.floats(-180, 180), st.floats(-90, 90))
EXTRAS = st.dictionaries(st.sampled_from(["roof", "wire"]), st.integers() | st.none() | st.text())
MOMENTS = st.none() | st.datetimes(
    EARLIEST.replace(tzinfo=None), LATEST.replace(tzinfo=None), timezones=st.just(UTC)
)


@st.composite
def networks(draw: st.DrawFn) -> Network:
    ids = draw(st.lists(IDENTIFIERS, unique=True, max_size=5))
    stations = {
        StationId(name): Station(
            StationId(name),
            draw(POSITIONS),
            pads,
            draw(st.none() | st.text()),
            draw(EXTRAS),
            is_parking=pads > 0 and draw(st.booleans()),
        )
        for name in ids
        for pads in [draw(st.integers(0, 9))]
    }
    ends = [(a, b) for a in stations for b in stations if a != b]
    chosen = draw(st.lists(st.sampled_from(ends), unique=True)) if ends else []
    lengths = st.sampled_from([0.0, 5.5, 1e6])
    segments = tuple(Segment(a, b, draw(lengths), draw(EXTRAS)) for a, b in chosen)
    zone_ids = draw(st.lists(IDENTIFIERS, unique=True, max_size=2))
    return Network(stations, segments, tuple(draw(zones(name)) for name in zone_ids), draw(EXTRAS))


@st.composite
def zones(draw: st.DrawFn, name: str) -> Zone:
    ring = draw(st.lists(POSITIONS, min_size=3, max_size=5))
    moments = sorted(filter(None, draw(st.tuples(MOMENTS, MOMENTS))))
    bounds = moments if len(set(moments)) == 2 else [None, None]
    return Zone(ZoneId(name), ((*ring, ring[0]),), bounds[0], bounds[1], draw(EXTRAS))


@given(network=networks())
def test_a_network_written_as_json_reads_as_the_same_network(network: Network) -> None:
    document = json.loads(json.dumps(write_network(network)))

    again = read_network(document)

    assert again.stations == network.stations
    assert sorted(map(repr, again.segments)) == sorted(map(repr, network.segments))
    assert again.zones == network.zones
    assert again.settings == network.settings
    assert write_network(again) == document
