"""Tiles of the map: every place in a box of them lies within its corners."""

import math
import random

import pytest
from skyway_drone_agent.landing_book.tiles import TILE_DEG, Tile, TileBox, covered_m, ring, tile_of

from skyway.geo import Position, moved


def corners(box: TileBox) -> tuple[float, ...]:
    return tuple(float(number) for number in box.bbox.split(","))


@pytest.mark.parametrize(
    ("start", "end"),
    [
        ((-98.0, 30.0), (-97.9, 30.1)),
        ((-97.9, 30.1), (-98.0, 30.0)),
        ((179.98, -17.0), (-179.97, -17.05)),
        ((-179.97, -17.05), (179.98, -17.0)),
        ((10.0, 89.99), (12.0, 89.99)),
        ((10.0, -90.0), (10.0, -89.95)),
        ((-180.0, 0.0), (180.0, 0.0)),
    ],
)
def test_the_places_of_its_tiles_lie_in_a_box(
    start: tuple[float, float], end: tuple[float, float]
) -> None:
    box = TileBox.around(Position(*start), Position(*end))
    west, south, east, north = corners(box)
    dice = random.Random(1)

    assert box.columns * box.rows < 700
    assert {tile_of(Position(*start)), tile_of(Position(*end))} <= set(box.tiles)
    for tile in box.tiles:
        longitude = (tile.column + dice.random()) * TILE_DEG - 180.0
        latitude = (tile.row + dice.random()) * TILE_DEG - 90.0
        assert south <= latitude <= north
        is_inside = west <= longitude <= east
        assert is_inside if west <= east else longitude >= west or longitude <= east


def test_the_surroundings_reach_some_ten_kilometres_beyond_a_flight() -> None:
    west, south, east, north = corners(TileBox.around(Position(-98.0, 30.0), Position(-97.9, 30.0)))

    assert 0.1 <= 30.0 - south <= 0.151
    assert 0.1 <= north - 30.0 <= 0.151
    assert 0.1 <= -98.0 - west <= 0.201
    assert 0.1 <= east + 97.9 <= 0.201


@pytest.mark.parametrize(
    ("here", "width"), [((-180.0, -84.98), 12), ((179.99, 0.0), 1), ((10.0, 60.1), 3)]
)
def test_rings_cover_the_map_once(here: tuple[float, float], width: int) -> None:
    place = Position(*here)
    around = [tile for distance in range(4) for tile in ring(place, distance)]

    assert len(around) == len(set(around)) == 7 * (6 * width + 1)
    middle = tile_of(place)
    assert Tile((middle.column - 3 * width) % 7200, middle.row - 1) in around


@pytest.mark.parametrize("latitude", [-87.9, -17.0, 0.0, 60.0, 75.0, 87.0])
def test_rings_hold_all_places_that_they_cover(latitude: float) -> None:
    dice = random.Random(latitude)
    here = Position(dice.uniform(-180, 180), latitude)

    for distance in range(5):
        tiles = {tile for each in range(distance + 1) for tile in ring(here, each)}
        radius_m = covered_m(here, distance)
        for _ in range(200):
            bearing = dice.uniform(0, math.tau)
            east_m, north_m = radius_m * math.sin(bearing), radius_m * math.cos(bearing)
            assert tile_of(moved(here, east_m=east_m * 0.999, north_m=north_m * 0.999)) in tiles
