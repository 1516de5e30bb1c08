import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from skyway.geo import Position
from skyway.ids import ZoneId
from skyway.network.network import Zone
from skyway.network.zone_rows import Points, which_cross, which_lie_in
from skyway.network.zones import contains, crosses

# A coarse grid, for touching and overlapping, and anywhere, for what lies between.
PLACES = st.builds(Position, *[st.integers(0, 6).map(float)] * 2) | st.builds(
    Position, *[st.floats(-1, 7)] * 2
)
RINGS = st.lists(PLACES, min_size=3, max_size=6).map(lambda ring: (*ring, ring[0]))
ZONES = st.lists(RINGS, min_size=1, max_size=2).map(lambda rings: Zone(ZoneId("z"), tuple(rings)))


def points_of(positions: list[Position]) -> Points:
    longitude_deg, latitude_deg = np.array(positions, np.float64).reshape(-1, 2).T
    return longitude_deg, latitude_deg


def is_near(zone: Zone, *ends: Position) -> bool:
    """Whether the box around these meets the zone's; what does not is not asked about."""
    south_west, north_east = zone.box
    longitudes = [end.longitude_deg for end in ends]
    latitudes = [end.latitude_deg for end in ends]
    return (
        max(longitudes) >= south_west.longitude_deg
        and min(longitudes) <= north_east.longitude_deg
        and max(latitudes) >= south_west.latitude_deg
        and min(latitudes) <= north_east.latitude_deg
    )


@given(zone=ZONES, positions=st.lists(PLACES, max_size=8))
def test_positions_by_the_array_lie_in_a_zone_as_they_do_one_by_one(
    zone: Zone, positions: list[Position]
) -> None:
    near = [position for position in positions if is_near(zone, position)]

    inside = which_lie_in(zone, points_of(near))

    assert inside.tolist() == [contains(zone, position) for position in near]


@given(zone=ZONES, lines=st.lists(st.tuples(PLACES, PLACES), max_size=8))
def test_lines_by_the_array_cross_a_zone_as_they_do_one_by_one(
    zone: Zone, lines: list[tuple[Position, Position]]
) -> None:
    near = [line for line in lines if is_near(zone, *line)]

    met = which_cross(zone, points_of([a for a, _ in near]), points_of([b for _, b in near]))

    assert met.tolist() == [crosses(zone, *line) for line in near]
