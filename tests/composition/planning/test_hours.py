"""Opening hours of a network's stations: trips, quotes and standbys keep to them."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.planning.world import ClosedAhead, World

from skyway.delivery.plan import Deliver
from skyway.ids import StationId
from skyway.scheduling.trip import Trip
from skyway.units import moment_to_ms, ms_to_moment
from tests.composition.planning.test_find_trip import trip_of

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


def row_with_hours(make: Any, **spans: list[str]) -> Any:
    """The row of stations; the clock begins on 1 March 2026, a Sunday, at 12:00."""
    network = make.network()
    for feature in network["features"]:
        station_id = feature["properties"].get("station_id")
        if station_id in spans:
            feature["properties"]["opening_hours"] = {"weekly": {"sun": spans[station_id]}}
    return network


async def test_a_package_is_handed_over_when_its_station_is_open(
    composition: Any, make: Any
) -> None:
    await composition.publish(row_with_hours(make, b=["15:00-16:00"]))

    trip = await trip_of(composition, make.request("b"), make.candidate())

    assert isinstance(trip, Trip)
    (delivered,) = [step for step in trip.plan.steps if isinstance(step, Deliver)]
    begins_at = ms_to_moment(trip.start_ms) + timedelta(seconds=delivered.start_s)
    assert begins_at == composition.clock.now().replace(hour=15)


async def test_a_drone_waits_on_the_ground_until_its_home_opens(
    composition: Any, make: Any
) -> None:
    await composition.publish(row_with_hours(make, a=["12:00-12:10", "18:00-20:00"]))

    trip = await trip_of(composition, make.request("b"), make.candidate())

    assert isinstance(trip, Trip)
    landed_at = ms_to_moment(trip.home_start_ms) + timedelta(
        seconds=trip.home_plan.delivery_time_s or 0.0
    )
    assert landed_at == composition.clock.now().replace(hour=18)


async def test_wrong_opening_hours_are_refused_with_their_field(
    composition: Any, make: Any
) -> None:
    network = row_with_hours(make, b=["15:00-14:00"])

    answer = await composition("operator:op", "PUT", "/v1/networks/row", network)

    assert answer.status_code == 422, answer.text
    (fault,) = answer.json()["errors"]
    assert fault["field"].endswith("properties.opening_hours.weekly.sun.0")
    assert "ends before it begins" in fault["detail"]


async def test_opening_hours_shut_a_station_and_leave_it_open_for_late_drones(
    composition: Any, make: Any
) -> None:
    await composition.publish(row_with_hours(make, b=["12:00-13:00"]))
    skyway = await composition.parts.networks.current("row")
    now_ms = moment_to_ms(composition.clock.now())
    world = await World.of(skyway, composition.db, after_ms=now_ms)

    closed = ClosedAhead.of(world, now_ms=now_ms)

    hour_ms = 3_600_000
    station = StationId("b")
    assert not closed.is_shut(station, now_ms + hour_ms - 1)
    assert closed.is_shut(station, now_ms + hour_ms)
    assert not closed.closes_landing(station, now_ms + hour_ms)
