"""Trips in the openings of a calendar, and a drone's standby after its last delivery."""

from typing import Any

import pytest
from skyway_composition.planning.availability import NextMission, Opening
from skyway_composition.planning.find_trip import TripFinder
from skyway_composition.planning.offer import Limits
from skyway_composition.planning.world import World

from skyway.drone.models import DRONE_MODELS
from skyway.ids import DroneId, DroneModelId, MissionId, StationId
from skyway.scheduling.stays import Slot
from skyway.scheduling.trip import NoTrip, Trip
from skyway.units import moment_to_ms

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

#: Flies there and back without a recharge.
FAR_FLYER = DRONE_MODELS[DroneModelId("dji-matrice-300-rtk")]


async def trip_of(composition: Any, request: Any, candidate: Any) -> Trip | NoTrip:
    skyway = await composition.parts.networks.current("row")
    world = await World.of(skyway, composition.db, after_ms=0)
    start_ms = moment_to_ms(composition.clock.now())
    limits = Limits.of(request.qos)
    finder = TripFinder(composition.parts.solver, world, start_ms, limits.latest_ms)
    return await finder.trip(candidate, request)


async def test_the_drone_flies_home(composition: Any, make: Any) -> None:
    trip = await trip_of(composition, make.request("c"), make.candidate())

    assert isinstance(trip, Trip)
    assert trip.home_plan.deliveries[0].station_id == "a"


async def test_a_drone_that_cannot_fly_home_stays_at_a_station_with_pads(
    composition: Any, make: Any
) -> None:
    network = make.network(stations="abcdef")
    # No drone can fly to f: its only segment leads away from it.
    network["features"][-1]["properties"] |= {"from": "f", "to": "e", "one_way": True}
    network["features"][-1]["geometry"]["coordinates"].reverse()
    await composition.publish(network)

    trip = await trip_of(composition, make.request("c"), make.candidate(home_station_id="f"))

    assert isinstance(trip, Trip)
    assert trip.home_plan.deliveries[0].station_id == "c"
    assert trip.home_recharge is not None
    assert trip.home_recharge.station_id == "c"


async def test_a_standby_charges_as_long_as_the_pad_at_home_needs(
    composition: Any, make: Any
) -> None:
    network = make.network()
    network["features"][0]["properties"]["pad_power_w"] = 50
    await composition.publish(network)

    candidate = make.candidate()
    trip = await trip_of(composition, make.request("c"), candidate)

    assert isinstance(trip, Trip)
    charge = trip.home_recharge
    assert charge is not None
    assert (charge.station_id, charge.power_w) == ("a", 50)
    needed_j = (charge.soc_end - charge.soc_start) * candidate.model.battery_j
    assert charge.end_s - charge.start_s == pytest.approx(needed_j / 50)


async def test_a_drone_that_cannot_stay_flies_to_the_nearest_pad(
    composition: Any, make: Any
) -> None:
    await composition.publish(make.network(pads={"b": 0}))

    candidate = make.candidate(model=FAR_FLYER, home_station_id="gone")
    trip = await trip_of(composition, make.request("b"), candidate)

    assert isinstance(trip, Trip)
    assert trip.home_plan.deliveries[0].station_id in ("a", "c")


def row_with_parking(make: Any, *stations: str, pads: dict[str, int] | None = None) -> Any:
    network = make.network(pads=pads)
    for feature in network["features"]:
        if feature["properties"].get("station_id") in stations:
            feature["properties"]["parking"] = True
    return network


async def close_pads(composition: Any, station_id: str) -> None:
    """Both pads of a station are out of order for good."""
    for pad in (0, 1):
        path = f"/v1/stations/{station_id}/pads/{pad}/outages"
        answer = await composition("operator:op", "POST", path)
        assert answer.is_success, answer.text


async def test_a_drone_that_stays_charges_where_it_delivered(composition: Any, make: Any) -> None:
    candidate = make.candidate(model=FAR_FLYER, standby="STAY")

    trip = await trip_of(composition, make.request("c"), candidate)

    assert isinstance(trip, Trip)
    assert [step.kind for step in trip.home_plan.steps] == ["PICK_UP", "DELIVER"]
    assert trip.home_recharge is not None
    assert trip.home_recharge.station_id == "c"
    assert trip.home_recharge.soc_end == FAR_FLYER.top_soc


async def test_a_drone_stays_at_the_nearest_pad_when_there_is_none_where_it_delivered(
    composition: Any, make: Any
) -> None:
    await composition.publish(make.network(pads={"b": 0, "a": 0}))

    candidate = make.candidate(model=FAR_FLYER, standby="STAY")
    trip = await trip_of(composition, make.request("b"), candidate)

    assert isinstance(trip, Trip)
    assert trip.home_recharge is not None
    assert trip.home_recharge.station_id == "c"


async def test_a_drone_that_stays_goes_where_it_can_charge(composition: Any, make: Any) -> None:
    await close_pads(composition, "b")

    candidate = make.candidate(model=FAR_FLYER, standby="STAY")
    trip = await trip_of(composition, make.request("b"), candidate)

    assert isinstance(trip, Trip)
    assert trip.home_recharge is not None
    assert trip.home_recharge.station_id in ("a", "c")


async def test_a_drone_parks_where_it_is_charged_first(composition: Any, make: Any) -> None:
    await composition.publish(row_with_parking(make, "a", "d"))

    candidate = make.candidate(model=FAR_FLYER, standby="PARKING")
    trip = await trip_of(composition, make.request("c"), candidate)

    assert isinstance(trip, Trip)
    assert trip.home_recharge is not None
    assert trip.home_recharge.station_id == "d"


async def test_a_drone_parks_farther_away_when_the_pads_of_the_nearest_are_out_of_order(
    composition: Any, make: Any
) -> None:
    await composition.publish(row_with_parking(make, "a", "d"))
    await close_pads(composition, "d")

    candidate = make.candidate(model=FAR_FLYER, standby="PARKING")
    trip = await trip_of(composition, make.request("c"), candidate)

    assert isinstance(trip, Trip)
    assert trip.home_recharge is not None
    assert trip.home_recharge.station_id == "a"


async def test_a_drone_stays_in_a_network_without_parking_stations(
    composition: Any, make: Any
) -> None:
    candidate = make.candidate(model=FAR_FLYER, standby="PARKING")

    trip = await trip_of(composition, make.request("c"), candidate)

    assert isinstance(trip, Trip)
    assert trip.home_recharge is not None
    assert trip.home_recharge.station_id == "c"


@pytest.mark.parametrize("gap_s", [-1, 0, 1, 60])
async def test_a_drone_without_time_before_its_next_mission_is_busy_and_no_deadline_is_named(
    composition: Any, make: Any, gap_s: int
) -> None:
    trip = await trip_before_the_next_mission(composition, make, gap_s=gap_s)

    assert isinstance(trip, NoTrip)
    assert (trip.code, trip.is_temporary) == ("BUSY", True)


@pytest.mark.parametrize(("deadline_s", "code"), [(-1, "TOO_LATE"), (1, "TOO_LATE"), (90, "BUSY")])
async def test_the_earlier_of_deadline_and_next_mission_is_the_reason(
    composition: Any, make: Any, deadline_s: int, code: str
) -> None:
    trip = await trip_before_the_next_mission(composition, make, gap_s=60, deadline_s=deadline_s)

    assert isinstance(trip, NoTrip)
    assert trip.code == code


async def trip_before_the_next_mission(
    composition: Any, make: Any, *, gap_s: int, deadline_s: int | None = None
) -> Trip | NoTrip:
    """The trip of a drone that must be ready for its next mission after so many seconds."""
    candidate = make.candidate(model=FAR_FLYER)
    skyway = await composition.parts.networks.current("row")
    world = await World.of(skyway, composition.db, after_ms=0)
    start_ms = moment_to_ms(composition.clock.now())
    here = Slot(StationId("a"), start_ms, candidate.soc)
    ready = Slot(StationId("a"), start_ms + 1000 * gap_s, candidate.soc)
    opening = Opening(here, None, NextMission(MissionId("mis_next"), ready))
    finder = TripFinder(
        composition.parts.solver,
        world,
        start_ms,
        None if deadline_s is None else start_ms + 1000 * deadline_s,
        openings={DroneId(candidate.drone_id): opening},
    )
    return await finder.trip(candidate, make.request("c"))
