from hypothesis import given
from hypothesis import strategies as st

from skyway.geo import Position, distance_m
from skyway.ids import StationId, ZoneId
from skyway.network.line_of_sight import pairs_within, segments_in_sight
from skyway.network.network import Station, Zone

POSITIONS = st.builds(Position, st.floats(-180, 180), st.floats(-90, 90))
NEAR = st.builds(Position, st.floats(179.9, 180) | st.floats(-180, -179.9), st.floats(-0.1, 0.1))


def make_stations(*positions: tuple[float, float]) -> dict[StationId, Station]:
    ids = [StationId(f"s{number}") for number in range(len(positions))]
    return {i: Station(i, Position(*at)) for i, at in zip(ids, positions, strict=True)}


@given(
    positions=st.lists(POSITIONS, max_size=12) | st.lists(NEAR, max_size=12),
    reach_m=st.sampled_from([0.0, 500.0, 12_000.0, 5e6, 3e7]),
)
def test_cells_find_the_pairs_that_comparing_all_finds(
    positions: list[Position], reach_m: float
) -> None:
    everything = [
        (distance_m(a, b), i, j)
        for j, b in enumerate(positions)
        for i, a in enumerate(positions[:j])
    ]

    found = pairs_within(positions, reach_m=reach_m)

    assert sorted(found) == sorted(pair for pair in everything if 0.0 < reach_m >= pair[0])


def test_segments_join_stations_in_sight_both_ways() -> None:
    stations = make_stations((0.0, 0.0), (0.05, 0.0), (0.5, 0.0))

    segments = segments_in_sight(stations, max_segment_m=10_000.0)

    assert [(s.from_id, s.to_id) for s in segments] == [("s0", "s1"), ("s1", "s0")]


def test_no_segment_crosses_a_zone() -> None:
    stations = make_stations((0.0, 0.0), (0.05, 0.0))
    wall = [(0.02, -1.0), (0.03, -1.0), (0.03, 1.0), (0.02, -1.0)]
    zone = Zone(ZoneId("wall"), (tuple(Position(*corner) for corner in wall),))

    assert segments_in_sight(stations, max_segment_m=10_000.0, zones=[zone]) == ()
