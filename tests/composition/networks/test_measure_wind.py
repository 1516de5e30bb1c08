"""The wind that drones on missions measure corrects the forecast of their network."""

import json
from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.networks.measure_wind import MeasuredWinds
from sqlalchemy import text

from skyway.delivery.lateness import KnownAir
from skyway.planner.measured_wind import MeasuredAir
from tests.composition.drone_messages import DroneMessages

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

OPERATOR = "operator:op"
PATH = "/v1/networks/row/weather"

HEALTH = {
    "voltage_v": 22.0,
    "current_a": 1.0,
    "soc_error": 0.01,
    "cell_spread_v": 0.01,
    "temperature_c": 20.0,
    "state_of_health": 1.0,
    "range_m": 10_000.0,
}


async def fly(
    composition: Any, make: Any, *, number: int, east_mps: float, temperature_c: float = 20.0
) -> None:
    """A drone of a provider of its own takes off, and measures this wind."""
    drone = DroneMessages(composition, f"drn_{number}", f"prv_{number}")
    candidate = make.candidate(number, provider_id=drone.provider_id)
    await composition.book(candidate, delivery_id=f"dlv_{number}", request=make.request("b"))
    (instruction,) = await composition.sent(drone.drone_id)
    await composition.receive(drone.ack(instruction))
    values = {
        "mission_id": instruction.mission_id,
        "mission_revision": 1,
        "activity": "FLYING",
        "step_id": 2,
        "released_through": 2,
        "station_id": None,
        "package_ids": ("p1",),
        "health": HEALTH
        | {"wind": {"east_mps": east_mps, "north_mps": 0.0}, "temperature_c": temperature_c},
    }
    await composition.receive(drone.state(**values))


async def test_two_providers_that_measure_the_same_correct_the_forecast(
    composition: Any, make: Any
) -> None:
    now = composition.clock.now().isoformat()
    still = {"valid_at": now, "wind_speed_mps": 0.0, "wind_from_deg": 0.0}
    reports = [{"station_id": station, **still} for station in "ace"]
    forecast = {"source": "test", "issued_at": now, "reports": reports}
    await composition(OPERATOR, "PUT", PATH, forecast)
    winds = MeasuredWinds(composition.db, composition.clock, composition.parts.calendars)
    await fly(composition, make, number=1, east_mps=-6.0)

    await winds.step()
    alone = (await composition(OPERATOR, "GET", PATH)).json()
    await fly(composition, make, number=2, east_mps=-5.0)
    await winds.step()
    together = (await composition(OPERATOR, "GET", PATH)).json()
    (before,) = await composition.rows("SELECT conditions FROM networks")
    await winds.step()
    (after,) = await composition.rows("SELECT conditions FROM networks")
    windy = await composition.book(
        make.candidate(3), delivery_id="dlv_3", request=make.request("b")
    )

    assert alone["measured_at"] is None
    assert together["measured_at"] is not None
    assert before == after
    flight = next(step for step in windy.missions[0].plan.steps if step.kind == "FLY")
    speed_mps = make.candidate().model.speed_empty_mps
    assert flight.time_factor == pytest.approx(speed_mps / (speed_mps - 5.0), abs=0.011)
    assert (await composition(OPERATOR, "PUT", PATH, forecast)).json() == together
    assert await composition.broken() == []


async def test_a_correction_ends_when_drones_measure_no_such_wind_any_more(
    composition: Any, make: Any
) -> None:
    now = composition.clock.now()
    still = {"wind_speed_mps": 0.0, "wind_from_deg": 0.0}
    reports = [
        {"station_id": station, "valid_at": (now + timedelta(hours=hour)).isoformat(), **still}
        for station in "ace"
        for hour in range(3)
    ]
    forecast = {"source": "test", "issued_at": now.isoformat(), "reports": reports}
    await composition(OPERATOR, "PUT", PATH, forecast)
    winds = MeasuredWinds(composition.db, composition.clock, composition.parts.calendars)
    for number in (1, 2):
        await fly(composition, make, number=number, east_mps=-5.0)
    await winds.step()

    composition.clock.advance(timedelta(minutes=20))
    await winds.step()

    async with composition.db.read() as connection:
        found = await connection.execute(text("SELECT measured FROM forecasts"))
    assert '"places":[]' in found.scalar_one()


async def test_without_a_forecast_plans_use_the_air_that_drones_measure(
    composition: Any, make: Any
) -> None:
    winds = MeasuredWinds(composition.db, composition.clock, composition.parts.calendars)
    await fly(composition, make, number=1, east_mps=-3.2, temperature_c=6.0)
    await winds.step()

    known = await composition.book(make.candidate(2), delivery_id="dlv_2")

    mission = known.missions[0]
    air = mission.margins.air
    assert (air.source, air.temperature_c) == ("MEASURED", 6.0)
    assert mission.weather.source == "MEASURED"
    assert mission.margins.late_share > 0.02
    flight = next(each for each in mission.plan.steps if each.kind == "FLY")
    assert flight.time_factor == pytest.approx(slowed_by(make, 3.0, drones=1), abs=0.011)
    assert flight.energy_factor == 1.04
    assert await composition.broken() == []


def slowed_by(make: Any, wind_mps: float, *, drones: int) -> float:
    """The time factor of a flight against this measured wind and its error."""
    against_mps = wind_mps + MeasuredAir(-wind_mps, 0.0, drones=drones).error_mps
    speed_mps = make.candidate().model.speed_empty_mps
    return float(speed_mps / (speed_mps - against_mps))


async def test_a_provider_that_lies_about_the_wind_does_not_change_plans(
    composition: Any, make: Any
) -> None:
    winds = MeasuredWinds(composition.db, composition.clock, composition.parts.calendars)
    await fly(composition, make, number=1, east_mps=-3.0)
    await fly(composition, make, number=2, east_mps=-40.0)
    await winds.step()

    planned = await composition.book(make.candidate(3), delivery_id="dlv_3")

    flight = next(each for each in planned.missions[0].plan.steps if each.kind == "FLY")
    assert flight.time_factor == pytest.approx(slowed_by(make, 3.0, drones=2), abs=0.011)


async def test_measured_wind_counts_for_hours_when_no_drone_measures_any_more(
    composition: Any, make: Any
) -> None:
    winds = MeasuredWinds(composition.db, composition.clock, composition.parts.calendars)
    await fly(composition, make, number=1, east_mps=-6.0)
    await winds.step()
    found = []

    for hours in (0, 2, 1):
        composition.clock.advance(timedelta(hours=hours))
        await winds.step()
        found.append((await composition(OPERATOR, "GET", PATH)).status_code)

    assert found == [200, 200, 404]


@pytest.mark.parametrize(("minutes", "east_mps"), [(20, -4.5), (70, -3.0)])
async def test_measured_wind_is_averaged_with_the_wind_of_the_last_hour(
    composition: Any, make: Any, minutes: int, east_mps: float
) -> None:
    winds = MeasuredWinds(composition.db, composition.clock, composition.parts.calendars)
    await fly(composition, make, number=1, east_mps=-6.0)
    await winds.step()
    composition.clock.advance(timedelta(minutes=minutes))
    await fly(composition, make, number=2, east_mps=-3.0)

    await winds.step()

    async with composition.db.read() as connection:
        found = await connection.execute(text("SELECT measured FROM forecasts"))
    assert json.loads(found.scalar_one())["places"] == [[0, east_mps, 0.0]]


async def test_calm_air_that_drones_measure_is_known_and_plans_stay_in_still_air(
    composition: Any, make: Any
) -> None:
    winds = MeasuredWinds(composition.db, composition.clock, composition.parts.calendars)
    await fly(composition, make, number=1, east_mps=0.2)
    await winds.step()

    planned = await composition.book(make.candidate(2), delivery_id="dlv_2")

    mission = planned.missions[0]
    assert mission.margins.air == KnownAir(source="MEASURED", wind_mps=0.0, temperature_c=20.0)
    assert {each.time_factor for each in mission.plan.steps if each.kind == "FLY"} == {1.0}


async def test_the_forecast_of_an_operator_counts_instead_of_measured_wind(
    composition: Any, make: Any
) -> None:
    winds = MeasuredWinds(composition.db, composition.clock, composition.parts.calendars)
    await fly(composition, make, number=1, east_mps=-6.0)
    await winds.step()
    now = composition.clock.now().isoformat()
    still = {"valid_at": now, "wind_speed_mps": 0.0, "wind_from_deg": 0.0}
    reports = [{"station_id": station, **still} for station in "ace"]
    forecast = {"source": "MEASURED", "issued_at": now, "reports": reports}

    refused = await composition(OPERATOR, "PUT", PATH, forecast)
    accepted = await composition(OPERATOR, "PUT", PATH, forecast | {"source": "test"})
    composition.clock.advance(timedelta(minutes=11))
    await winds.step()

    assert refused.status_code == 422
    assert accepted.status_code == 200
    assert (await composition(OPERATOR, "GET", PATH)).json()["source"] == "test"
