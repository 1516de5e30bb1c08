import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skyway.geo import Position, distance_m
from skyway.ids import StationId, ZoneId
from skyway.network.near_pairs import near_pairs, segments_in_sight
from skyway.network.network import Station, Zone

POSITIONS = st.builds(Position, st.floats(-180, 180), st.floats(-90, 90))
NEAR = st.builds(Position, st.floats(179.9, 180) | st.floats(-180, -179.9), st.floats(-0.1, 0.1))
REACHES = st.sampled_from([0.0, 1.0, 500.0, 12_000.0, 5e6, 3e7])


def pairs_of(
    positions: list[Position], *, reach_m: float, around: list[bool] | None = None
) -> list[tuple[float, int, int]]:
    longitude_deg, latitude_deg = np.array(positions, np.float64).reshape(-1, 2).T
    mask = None if around is None else np.array(around, np.bool_)
    pairs = near_pairs(longitude_deg, latitude_deg, reach_m=reach_m, around=mask)
    return list(zip(pairs.length_m.tolist(), pairs.one.tolist(), pairs.other.tolist(), strict=True))


def all_pairs(positions: list[Position], *, reach_m: float) -> list[tuple[float, int, int]]:
    everything = [
        (distance_m(a, b), i, j)
        for j, b in enumerate(positions)
        for i, a in enumerate(positions[:j])
    ]
    return sorted(pair for pair in everything if 0.0 < reach_m >= pair[0])


@given(positions=st.lists(POSITIONS, max_size=12) | st.lists(NEAR, max_size=12), reach_m=REACHES)
def test_cells_find_the_same_pairs_as_comparing_all_positions(
    positions: list[Position], reach_m: float
) -> None:
    assert pairs_of(positions, reach_m=reach_m) == all_pairs(positions, reach_m=reach_m)


@given(stations=st.lists(st.tuples(NEAR, st.booleans()), min_size=1, max_size=12), reach_m=REACHES)
def test_with_around_each_pair_has_an_end_in_it(
    stations: list[tuple[Position, bool]], reach_m: float
) -> None:
    positions, around = map(list, zip(*stations, strict=True))

    found = pairs_of(positions, reach_m=reach_m, around=around)

    everything = all_pairs(positions, reach_m=reach_m)
    assert found == [pair for pair in everything if around[pair[1]] or around[pair[2]]]


@pytest.mark.long
def test_many_positions_in_one_cell_lose_no_pair() -> None:
    count = 2_100
    longitude_deg, latitude_deg = np.random.default_rng(1).uniform(0, 0.01, (2, count))

    pairs = near_pairs(longitude_deg, latitude_deg, reach_m=5_000.0)

    found = np.zeros((count, count), bool)
    found[pairs.one, pairs.other] = True
    assert np.count_nonzero(found) == count * (count - 1) // 2


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
