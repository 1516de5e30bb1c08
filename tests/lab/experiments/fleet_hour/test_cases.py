"""The seeded networks, homes and requests of an hour."""

import pytest
from skyway_lab.experiments.fleet_hour.cases import HOUR_MS, PLACES, Load, Place, draw_case

from skyway.geo import distance_m

LOAD = Load(drones=50, requests=60)


@pytest.mark.parametrize("place", PLACES)
def test_every_station_has_one_pad_and_requests_come_within_the_hour(place: Place) -> None:
    case = draw_case(place, LOAD, seed=1)

    assert set(case.network.columns.pads.tolist()) == {1}
    assert len(case.homes) == LOAD.drones
    moments_ms = [each.asked_ms for each in case.requests]
    assert moments_ms == sorted(moments_ms)
    assert 0 <= moments_ms[0] <= moments_ms[-1] < HOUR_MS
    assert [each.number for each in case.requests] == list(range(LOAD.requests))


@pytest.mark.parametrize(("place", "sources"), [("hub", 1), ("three hubs", 3)])
def test_all_packages_come_from_the_hubs(place: Place, sources: int) -> None:
    case = draw_case(place, LOAD, seed=1)

    assert len({each.source for each in case.requests}) == sources


def test_packages_go_to_other_stations_that_are_near() -> None:
    case = draw_case("corridor", LOAD, seed=1)

    for request in case.requests:
        here = case.network.stations[request.source].position
        for package in request.packages:
            there = case.network.stations[package.destination].position
            assert 0 < distance_m(here, there) <= 25_000


def test_homes_are_shared_only_when_there_are_more_drones_than_stations() -> None:
    homes = draw_case("city", LOAD, seed=1).homes

    assert len(set(homes[:40])) == 40
