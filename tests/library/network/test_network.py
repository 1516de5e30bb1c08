import pytest

from skyway.errors import InvalidNetwork
from skyway.geo import Position
from skyway.ids import StationId, ZoneId
from skyway.network.network import Network, Segment, Station, Zone

A, B = StationId("a"), StationId("b")
STATIONS = {A: Station(A, Position(0.0, 0.0)), B: Station(B, Position(0.1, 0.0))}


def test_segments_are_found_by_the_station_that_they_leave() -> None:
    there, back = Segment(A, B, 10.0), Segment(B, A, 11.0)

    network = Network(STATIONS, (there, back))

    assert network.segments_from(A) == (there,)
    assert network.segments_from(B) == (back,)


@pytest.mark.parametrize(
    ("lengths_m", "is_two_way"),
    [((5.0, 5.0), True), ((5.0, 6.0), False), ((5.0,), False), ((0.0, 0.0), False), ((), True)],
)
def test_a_network_is_two_way_if_each_way_back_is_as_long_as_the_way_there(
    lengths_m: tuple[float, ...], is_two_way: bool
) -> None:
    ends = [(A, B), (B, A)][: len(lengths_m)]

    network = Network(
        STATIONS, [Segment(*each, m) for each, m in zip(ends, lengths_m, strict=True)]
    )

    assert network.is_two_way is is_two_way


@pytest.mark.parametrize(
    ("segments", "message"),
    [
        ((Segment(A, StationId("c"), 1.0),), "segments.0: no station is called 'c'"),
        ((Segment(A, A, 1.0),), "segments.0: starts where it ends: 'a'"),
        ((Segment(A, B, 1.0), Segment(A, B, 2.0)), "segments.1: a second one from 'a' to 'b'"),
    ],
)
def test_segments_that_contradict_the_stations_are_refused(
    segments: tuple[Segment, ...], message: str
) -> None:
    with pytest.raises(InvalidNetwork) as refusal:
        Network(STATIONS, segments)

    assert str(refusal.value) == message


def test_a_parking_station_without_pads_is_refused() -> None:
    bare = Station(B, Position(0.1, 0.0), pads=0, is_parking=True)

    with pytest.raises(InvalidNetwork) as refusal:
        Network({**STATIONS, B: bare}, ())

    assert str(refusal.value) == "stations.1: a parking station needs at least 1 pad"


def test_two_zones_with_the_same_id_are_refused() -> None:
    zone = Zone(ZoneId("z"), ((Position(0, 0), Position(1, 0), Position(0, 1), Position(0, 0)),))

    with pytest.raises(InvalidNetwork, match="two zones share an id"):
        Network(STATIONS, (), (zone, zone))
