from skyway.geo import Position
from skyway.ids import StationId, ZoneId
from skyway.network.line_of_sight import segments_in_sight
from skyway.network.network import Station, Zone


def make_stations(*positions: tuple[float, float]) -> dict[StationId, Station]:
    ids = [StationId(f"s{number}") for number in range(len(positions))]
    return {i: Station(i, Position(*at)) for i, at in zip(ids, positions, strict=True)}


def test_segments_join_stations_in_sight_both_ways() -> None:
    stations = make_stations((0.0, 0.0), (0.05, 0.0), (0.5, 0.0))

    segments = segments_in_sight(stations, max_segment_m=10_000.0)

    assert [(s.from_id, s.to_id) for s in segments] == [("s0", "s1"), ("s1", "s0")]


def test_no_segment_crosses_a_zone() -> None:
    stations = make_stations((0.0, 0.0), (0.05, 0.0))
    wall = [(0.02, -1.0), (0.03, -1.0), (0.03, 1.0), (0.02, -1.0)]
    zone = Zone(ZoneId("wall"), (tuple(Position(*corner) for corner in wall),))

    assert segments_in_sight(stations, max_segment_m=10_000.0, zones=[zone]) == ()
