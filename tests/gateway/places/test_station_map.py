"""Which stations lie near a position, sorted by distance and id, and bounded."""

from hypothesis import given
from hypothesis import strategies as st
from skyway_gateway.places.station_map import MOST_NEAR, StationMap

from skyway.contracts.station_check import NetworkStations
from skyway.geo import Position, distance_m, moved
from skyway.ids import NetworkId, StationId
from tests.gateway.places.small_town import SQUARE, cached, make_house, make_town


def near(stations: StationMap, position: Position, within_m: float) -> list[str]:
    return [each.station.station_id for each in stations.near(position, within_m=within_m)]


def test_stations_within_the_walk_come_nearest_first() -> None:
    at = moved(SQUARE, east_m=5_250.0, north_m=0.0)

    assert near(StationMap(cached()), at, 1_000.0) == ["bulverde", "mcqueeney", "san-antonio"]
    assert near(StationMap(cached()), at, 300.0) == ["bulverde", "mcqueeney"]


def test_equally_near_stations_are_sorted_by_id() -> None:
    stations = StationMap(cached(make_town(b=-100.0, a=100.0, c=0.0)))

    assert near(stations, SQUARE, 200.0)[0] == "c"
    assert set(near(stations, SQUARE, 200.0)[1:]) == {"a", "b"}
    assert near(StationMap(cached(make_town(b=50.0, a=50.0))), SQUARE, 100.0) == ["a", "b"]


def test_of_twenty_stations_in_one_house_four_are_considered() -> None:
    house = make_house()

    assert near(StationMap(cached(house)), SQUARE, 1_000.0) == ["s00", "s01", "s02", "s03"]


def test_each_area_has_its_own_nearest_stations() -> None:
    house = make_house()
    other = make_town("other", far=500.0)

    found = near(StationMap(cached(house, other)), SQUARE, 1_000.0)

    assert found == ["s00", "s01", "s02", "s03", "far"]


def test_the_map_follows_the_cached_networks() -> None:
    networks = cached()
    stations = StationMap(networks)
    assert near(stations, SQUARE, 10.0) == ["san-marcos"]

    networks.put(make_town("new", lake=5.0))

    assert near(stations, SQUARE, 10.0) == ["san-marcos", "lake"]


def test_without_stations_none_is_nearest() -> None:
    networks = cached(make_town())
    networks.drop(NetworkId("town"))
    # A version that left the cache is still the last that is known.
    assert StationMap(networks).nearest(Position(0.0, 0.0)) is not None
    assert StationMap(type(networks)()).nearest(Position(0.0, 0.0)) is None


_positions = st.builds(
    Position,
    st.one_of(st.floats(-180, 180), st.sampled_from([-180.0, 179.999, 180.0])),
    st.one_of(st.floats(-90, 90), st.sampled_from([-90.0, 89.999, 90.0])),
)


@given(st.lists(_positions, min_size=1, max_size=MOST_NEAR), _positions, st.floats(1.0, 5_000.0))
def test_no_station_within_the_walk_is_missed_anywhere_on_earth(
    positions: list[Position], at: Position, within_m: float
) -> None:
    positions = [*positions, moved(at, east_m=within_m * 0.6, north_m=within_m * 0.7)][-MOST_NEAR:]
    ids = tuple(StationId(f"s{number}") for number in range(len(positions)))
    parts = (0,) * len(ids)
    stations = StationMap(
        cached(
            NetworkStations(
                network_id=NetworkId("n"),
                version=1,
                station_ids=ids,
                positions=tuple(positions),
                parts=parts,
            )
        )
    )

    found = stations.near(at, within_m=within_m)

    away_m = {each: distance_m(at, where) for each, where in zip(ids, positions, strict=True)}
    assert {each.station.station_id for each in found} == {
        each for each, walk_m in away_m.items() if walk_m <= within_m
    }
    nearest = stations.nearest(at)
    assert nearest is not None
    assert nearest.walk_m <= min(away_m.values()) + 1.0
