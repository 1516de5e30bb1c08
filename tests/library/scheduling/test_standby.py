"""Where a drone stands by, which of the ways there wins, and a standby that ends early."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import pytest

from skyway.contracts.candidate import Standby
from skyway.delivery.plan import Fly, Plan, PlanStatus, Recharge, Wait
from skyway.drone.models import DJI_MATRICE_300_RTK as MODEL
from skyway.geo import Position
from skyway.ids import ConnectorId, StationId
from skyway.network.network import Network, Station
from skyway.planner.problem import DroneAtStart
from skyway.scheduling.standby import StandbyChoice, search_standby, shortened_plan, shortened_step
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


@pytest.mark.parametrize("standby", ["HOME", "STAY", "PARKING"])
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


A, B = StationId("a"), StationId("b")
FLIGHT = Fly.model_validate(
    {
        "from": B,
        "to": A,
        "start_s": 0.0,
        "end_s": 100.0,
        "load_kg": 0.0,
        "energy_j": 5.0,
        "soc_end": 0.3,
    }
)
PAUSE = Wait(station_id=A, start_s=100.0, end_s=150.0)
CHARGE = Recharge(station_id=A, pad=0, start_s=150.0, end_s=350.0, soc_start=0.3, soc_end=0.9)
TO_HOME = Plan(status=PlanStatus.OPTIMAL, delivery_time_s=350.0, steps=(FLIGHT, PAUSE, CHARGE))


def test_a_recharge_that_ends_early_gives_its_share_of_the_charge() -> None:
    shortened = shortened_step(CHARGE, 250.0)

    assert isinstance(shortened, Recharge)
    assert shortened.end_s == 250.0
    assert shortened.soc_end == pytest.approx(0.6)


@pytest.mark.parametrize("until_s", [350.0, 349.999, 1_000.0])
def test_a_step_that_ends_before_the_moment_stays(until_s: float) -> None:
    assert shortened_step(CHARGE, until_s) == CHARGE


@pytest.mark.parametrize("until_s", [150.0, 150.001, 20.0])
def test_a_step_that_begins_at_the_moment_or_later_is_left_out(until_s: float) -> None:
    assert shortened_step(CHARGE, until_s) is None


def test_a_shortened_plan_counts_only_the_steps_that_are_left() -> None:
    plan = shortened_plan(TO_HOME, 120.0)

    assert [each.end_s for each in plan.steps] == [100.0, 120.0]
    assert plan.delivery_time_s == 120.0
    assert (plan.energy_j, plan.flight_s) == (5.0, 100.0)
    assert (plan.waiting_s, plan.recharging_s) == (20.0, 0.0)


def test_a_plan_that_ends_before_its_start_is_empty() -> None:
    plan = shortened_plan(TO_HOME, 0.0)

    assert (plan.steps, plan.delivery_time_s, plan.energy_j) == ((), 0.0, 0)
