"""Where a drone stands by, and which of the ways there wins."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import pytest

from skyway.contracts.candidate import Standby
from skyway.delivery.plan import Recharge
from skyway.drone.models import DJI_MATRICE_300_RTK as MODEL
from skyway.geo import Position
from skyway.ids import ConnectorId, StationId
from skyway.network.network import Network, Station
from skyway.planner.problem import DroneAtStart
from skyway.scheduling.standby import StandbyChoice, search_standby
from skyway.scheduling.trip import NOTHING_TO_DELIVER, NoTrip, Trip

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


@pytest.mark.parametrize("standby", ["HOME", "STAY", "PARKING", "NEXT_PICKUP"])
def test_a_drone_whose_home_is_not_in_the_network_uses_the_nearest_pads(standby: Standby) -> None:
    assert in_turn(make_row("bcdefg"), standby, "f") == "feg"


def test_a_drone_that_is_called_home_goes_home_under_every_setting() -> None:
    called = StandbyChoice("STAY", HOME).at_home()

    assert next(called.in_turn(make_row(), StationId("f"))) == HOME
    assert called.is_home(HOME)
    assert not StandbyChoice("STAY", HOME).is_home(HOME)


#: A row of stations with pads; the search starts at e, whose neighbour d is nearest.
NETWORK: Final = Network(
    {
        StationId(name): Station(
            StationId(name), Position(0.1 * number, 0.0), pads=1, is_parking=name in "bd"
        )
        for number, name in enumerate("abcde")
    },
    (),
)
NO_PAD: Final = NoTrip("NO_PAD_IN_TIME", "all pads are taken", is_temporary=True)


def test_a_drone_stands_by_at_pads_that_fit_it() -> None:
    stations = {
        name: replace(each, properties={"pad_connectors": ["blade"]}) if name in "bde" else each
        for name, each in NETWORK.stations.items()
    }
    model = MODEL.model_copy(update={"connector": ConnectorId("pin")})
    search = search_standby(
        StandbyChoice("PARKING", HOME),
        Network(stations, ()),
        start=StationId("e"),
        drone=DroneAtStart(model=model, soc=0.5),
    )

    assert next(search) == "c"


def trip(end: str, *, is_charged: bool = True, ends_s: float = 60.0) -> Trip:
    recharge = Recharge(
        station_id=StationId(end), pad=0, start_s=0, end_s=ends_s, soc_start=0.5, soc_end=0.9
    )
    home_recharge = recharge if is_charged else None
    return Trip(0, NOTHING_TO_DELIVER, 0, NOTHING_TO_DELIVER, home_recharge)


def searched(
    standby: Standby, trips: Mapping[str, Trip], *, places: str = ""
) -> tuple[str, Trip | NoTrip]:
    """The ends that were tried, and the trip that won; no pad is free at all other ends."""
    tried = ""
    drone = DroneAtStart(model=MODEL, soc=0.5)
    choice = StandbyChoice(standby, StationId("a"), places=tuple(map(StationId, places)))
    search = search_standby(choice, NETWORK, start=StationId("e"), drone=drone)
    try:
        end = next(search)
        while True:
            tried += end
            end = search.send(trips.get(end, NO_PAD))
    except StopIteration as found:
        return tried, found.value


def test_a_drone_with_a_way_home_goes_home_even_without_a_free_pad_there() -> None:
    home = trip("a", is_charged=False)

    assert searched("HOME", {"a": home, "e": trip("e")}) == ("a", home)


def test_a_drone_without_a_way_home_charges_at_the_nearest_station_that_has_a_free_pad() -> None:
    assert searched("HOME", {"d": trip("d")}) == ("aed", trip("d"))


def test_a_drone_that_finds_no_free_pad_stays_uncharged_where_it_is() -> None:
    uncharged = trip("e", is_charged=False)

    assert searched("STAY", {"e": uncharged}) == ("edca", uncharged)


def test_the_parking_station_at_which_a_drone_is_charged_first_wins() -> None:
    sooner = trip("b", ends_s=30.0)

    assert searched("PARKING", {"b": sooner, "d": trip("d")}) == ("db", sooner)


def test_a_drone_waits_near_the_next_pickup_at_the_first_place_with_a_free_pad() -> None:
    late = trip("a")
    assert late.home_recharge is not None
    recharge = late.home_recharge.model_copy(update={"start_s": 1_000.0, "end_s": 2_000.0})
    late = replace(late, home_recharge=recharge)
    uncharged = trip("b", is_charged=False)
    near = {"a": late, "b": uncharged, "c": trip("c"), "e": trip("e")}

    assert searched("NEXT_PICKUP", near, places="abc") == ("abc", trip("c"))
    assert searched("NEXT_PICKUP", near, places="ab") == ("abe", trip("e"))


def test_a_drone_goes_home_where_no_pickup_is_expected() -> None:
    choice = StandbyChoice("NEXT_PICKUP", HOME)

    known, unknown = (
        choice.near(pickups, NETWORK, start=StationId("e"), waiting={HOME: 12})
        for pickups in ({StationId("b"): 1.0}, {})
    )

    assert known == replace(choice, places=(StationId("b"),))
    assert unknown == StandbyChoice("HOME", HOME)


def test_the_first_reason_counts_when_no_end_has_a_trip() -> None:
    assert searched("STAY", {}) == ("edca", NO_PAD)
