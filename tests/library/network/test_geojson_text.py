import json
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from skyway.errors import InvalidNetwork
from skyway.geo import Position
from skyway.ids import StationId
from skyway.json_text import json_value
from skyway.network.bundled import texas_corridor
from skyway.network.geojson import read_network, write_network
from skyway.network.geojson_text import network_text, read_network_text
from skyway.network.network import Network, Segment, Station
from skyway.network.synthetic import synthetic_city

EXTRAS = st.dictionaries(st.sampled_from(["roof", "wire"]), st.integers() | st.none() | st.text())
POSITIONS = st.builds(Position, st.floats(-180, 180), st.floats(-90, 90))
NAMES = st.none() | st.text()


@st.composite
def networks(draw: st.DrawFn) -> Network:
    ids = [StationId(f"s{number}") for number in range(draw(st.integers(0, 4)))]
    extras = draw(st.sampled_from([st.just({}), EXTRAS]))
    stations = {
        i: Station(i, draw(POSITIONS), 4, draw(NAMES), draw(extras), draw(st.booleans()))
        for i in ids
    }
    ends = [(a, b) for a in ids for b in ids if a != b]
    chosen = draw(st.lists(st.sampled_from(ends), unique=True)) if ends else []
    lengths = st.sampled_from([0.0, 5.5, 1e6, 1e-7])
    segments = [Segment(a, b, draw(lengths), draw(extras)) for a, b in chosen]
    return Network(stations, segments, (), draw(extras))


@given(network=networks())
def test_the_text_equals_the_dumped_document(network: Network) -> None:
    assert network_text(network) == json.dumps(write_network(network))


def test_the_text_of_a_network_with_zones_reads_as_the_same_network() -> None:
    corridor = texas_corridor()

    assert network_text(corridor) == json.dumps(write_network(corridor))
    assert read_network_text(network_text(corridor)) == corridor


@pytest.mark.parametrize("spaced", [None, 1])
def test_a_text_of_several_blocks_reads_as_the_same_network(spaced: int | None) -> None:
    city = synthetic_city(stations=3_000, seed=1)
    text = json.dumps(write_network(city) | {"settings": {"currency": "EUR"}}, indent=spaced)

    network = read_network_text(text.encode())

    assert network.columns.station_ids == city.columns.station_ids
    assert network.segments == city.segments
    assert network.settings == {"currency": "EUR"}


@pytest.mark.parametrize(
    "text", ["", "{", "[1, 2", '{"type": "FeatureCollection", "features": [{}', "{} {}", "nul"]
)
def test_a_text_that_is_not_json_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        read_network_text(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[]", "network: an array is not an object"),
        ("{}", "type: null is not 'FeatureCollection'"),
        ('{"type": "FeatureCollection", "features": [7]}', "features.0: 7 is not an object"),
        ('{"type": "FeatureCollection", "features": [], "settings": 1}', "settings: 1 is not an"),
        ('{"type": "FeatureCollection", "features": [], "type": "F"}', "type: 'F' is not"),
        ('{"type": "FeatureCollection", "features": [], "features": 1}', "features: 1 is not an"),
    ],
)
def test_a_text_that_is_no_network_is_refused_with_its_field(text: str, message: str) -> None:
    with pytest.raises(InvalidNetwork) as refusal:
        read_network_text(text)

    assert message in str(refusal.value)


def test_stations_may_come_blocks_after_their_segments() -> None:
    city = synthetic_city(stations=1_000, seed=1)
    document = write_network(city)
    document["features"].reverse()

    network = read_network_text(json.dumps(document))

    assert network == read_network(document)
    assert network.stations == city.stations


CITY_TEXT = network_text(synthetic_city(stations=300, seed=1))


def reading(text: str, read: Callable[[str], Network]) -> Network | str:
    try:
        return read(text)
    except (ValueError, InvalidNetwork) as error:
        return repr(error)


@given(
    start=st.integers(0, len(CITY_TEXT)),
    length=st.integers(0, 60),
    replacement=st.sampled_from(["", ",", "]", "}", '"', '{"type": "Feature"', "], [", "s1", "0"]),
)
def test_a_damaged_text_is_read_or_refused_like_the_whole_document(
    start: int, length: int, replacement: str
) -> None:
    text = CITY_TEXT[:start] + replacement + CITY_TEXT[start + length :]

    read = reading(text, read_network_text)

    assert read == reading(text, lambda text: read_network(json_value(text)))
