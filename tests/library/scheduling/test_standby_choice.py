"""Where a drone may stand by, for each setting."""

from typing import Final

import pytest

from skyway.contracts.candidate import Standby
from skyway.geo import Position
from skyway.ids import StationId
from skyway.network.network import Network, Station
from skyway.scheduling.standby_choice import StandbyChoice

HOME: Final = StationId("a")


def make_row(stations: str = "abcdefg", *, pads: str = "abcdefg", parking: str = "") -> Network:
    """Stations in a row, 0.1 degrees apart, without segments."""
    return Network(
        {
            StationId(name): Station(
                StationId(name),
                Position(0.1 * number, 0.0),
                pads=2 if name in pads else 0,
                is_parking=name in parking,
            )
            for number, name in enumerate(stations)
        },
        (),
    )


def in_turn(network: Network, standby: Standby, start: str) -> str:
    return "".join(StandbyChoice(standby, HOME).in_turn(network, StationId(start)))


def compared(network: Network, standby: Standby, start: str) -> str:
    return "".join(StandbyChoice(standby, HOME).to_compare(network, StationId(start)))


def test_a_drone_goes_home_or_else_to_the_nearest_stations_with_pads() -> None:
    assert in_turn(make_row(pads="abdfg"), "HOME", "f") == "afgd"


def test_a_drone_that_stays_stands_where_it_is_or_else_at_the_nearest_pads_or_at_home() -> None:
    assert in_turn(make_row(), "STAY", "f") == "fega"
    assert in_turn(make_row(pads="abdg"), "STAY", "f") == "gdba"


def test_a_drone_parks_at_one_of_the_nearest_parking_stations_or_else_stays() -> None:
    row = make_row(parking="abdg")

    assert compared(row, "PARKING", "f") == "gdb"
    assert in_turn(row, "PARKING", "f") == in_turn(row, "STAY", "f")


@pytest.mark.parametrize("standby", ["HOME", "STAY"])
def test_only_drones_that_park_compare_parking_stations(standby: Standby) -> None:
    assert compared(make_row(parking="abdg"), standby, "f") == ""


@pytest.mark.parametrize("standby", ["HOME", "STAY", "PARKING"])
def test_a_drone_whose_home_is_not_in_the_network_uses_the_nearest_pads(standby: Standby) -> None:
    assert in_turn(make_row("bcdefg"), standby, "f") == "feg"


def test_a_drone_that_is_called_home_goes_home_under_every_setting() -> None:
    called = StandbyChoice("STAY", HOME).at_home()

    assert next(called.in_turn(make_row(), StationId("f"))) == HOME
    assert called.is_home(HOME)
    assert not StandbyChoice("STAY", HOME).is_home(HOME)
