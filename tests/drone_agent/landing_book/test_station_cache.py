"""The extract of the networks: the nearest stations, and no more of them than can be kept."""

import random
from typing import Any

from skyway_drone_agent.analysis.landings import Landing
from skyway_drone_agent.landing_book.station_cache import CachedStation, StationCache
from skyway_drone_agent.landing_book.tiles import Tile, TileBox, tile_of

from skyway.geo import Position, distance_m
from skyway.ids import NetworkId, StationId

TEXAS = NetworkId("texas")


def station(name: str, longitude: float, latitude: float) -> CachedStation:
    return CachedStation(TEXAS, Landing(StationId(name), Position(longitude, latitude)))


def put(extract: StationCache, *stations: CachedStation) -> None:
    for one in stations:
        extract.put(TEXAS, [tile_of(one.landing.position)], [one], at_s=0.0)


def names(found: Any) -> list[str]:
    return [one.landing.station_id for one in found]


def test_the_nearest_are_those_of_a_search_through_all() -> None:
    dice = random.Random(7)
    every = [
        station(f"stn_{number:03}", dice.uniform(-98.1, -97.9), dice.uniform(29.9, 30.1))
        for number in range(300)
    ]
    extract = StationCache()
    box = TileBox.around(Position(-98.1, 29.9), Position(-97.9, 30.1))
    extract.put(TEXAS, box.tiles, every, at_s=0.0)

    for _ in range(100):
        here = Position(dice.uniform(-98.1, -97.9), dice.uniform(29.9, 30.1))
        expected = sorted(every, key=lambda one: distance_m(here, one.landing.position))[:4]
        assert names(extract.nearest(here, count=4)) == names(expected)


def test_stations_are_found_over_the_date_line() -> None:
    extract = StationCache()
    put(extract, station("east", 179.99, -17.0), station("west", -179.99, -17.0))

    assert names(extract.nearest(Position(179.999, -17.0), count=2)) == ["east", "west"]


def test_a_tile_that_is_read_again_holds_what_was_read_last() -> None:
    extract = StationCache()
    put(extract, station("old", -98.0, 30.0))
    put(extract, station("new", -98.0, 30.0))

    assert names(extract.nearest(Position(-98.0, 30.0), count=9)) == ["new"]


def test_stations_outside_of_what_was_asked_for_are_left_out() -> None:
    extract = StationCache()

    extract.put(TEXAS, [Tile(0, 0)], [station("stray", -98.0, 30.0)], at_s=0.0)

    assert extract.nearest(Position(-98.0, 30.0), count=9) == []


def test_the_oldest_tiles_are_dropped_first() -> None:
    by_stations, by_tiles = StationCache(most_stations=3), StationCache(most_tiles=3)
    line = [station(f"stn_{number}", -98.0 + number / 10, 30.0) for number in range(5)]

    put(by_stations, *line)
    put(by_tiles, *line)

    for extract in (by_stations, by_tiles):
        kept = [one.landing.station_id for _, _, stations in extract for one in stations]
        assert kept == ["stn_2", "stn_3", "stn_4"]
        assert extract.read_at_s(TEXAS, tile_of(line[1].landing.position)) == float("-inf")
