"""Tiles of the map: every place in a box of them lies within its corners."""

import random

import pytest
from skyway_drone_agent.landing_book.tiles import TILE_DEG, Tile, TileBox, ring, tile_of

from skyway.geo import Position


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

    assert box.columns * box.rows < 200
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


def test_rings_cover_the_map_once() -> None:
    around = [tile for distance in range(4) for tile in ring(Tile(0, 100), distance)]

    assert len(around) == len(set(around)) == 49
    assert Tile(7199, 99) in around
