"""Which ends of a trip are tried, and which of the trips to them wins."""

from collections.abc import Mapping
from typing import Final

from skyway.contracts.candidate import Standby
from skyway.delivery.plan import Recharge
from skyway.drone.models import DJI_MATRICE_300_RTK as MODEL
from skyway.geo import Position
from skyway.ids import StationId
from skyway.network.network import Network, Station
from skyway.planner.problem import DroneAtStart
from skyway.scheduling.standby_choice import StandbyChoice
from skyway.scheduling.standby_search import search_standby
from skyway.scheduling.trip import NOTHING_TO_DELIVER, NoTrip, Trip

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


def trip(end: str, *, is_charged: bool = True, ends_s: float = 60.0) -> Trip:
    recharge = Recharge(
        station_id=StationId(end), pad=0, start_s=0, end_s=ends_s, soc_start=0.5, soc_end=0.9
    )
    home_recharge = recharge if is_charged else None
    return Trip(0, NOTHING_TO_DELIVER, 0, NOTHING_TO_DELIVER, home_recharge)


def searched(standby: Standby, trips: Mapping[str, Trip]) -> tuple[str, Trip | NoTrip]:
    """The ends that were tried, and the trip that won; no pad is free at all other ends."""
    tried = ""
    drone = DroneAtStart(model=MODEL, soc=0.5)
    choice = StandbyChoice(standby, StationId("a"))
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


def test_the_first_reason_counts_when_no_end_has_a_trip() -> None:
    assert searched("STAY", {}) == ("edca", NO_PAD)
