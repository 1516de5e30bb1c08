"""/v1/networks/{network_id}/weather: a forecast changes all plans, and bad ones are refused."""

import math
from datetime import datetime, timedelta
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from skyway_composition.closures.read_forecast import forecast_of
from skyway_composition.planning.world import World

from skyway.contracts.flight_step import FlyStep
from skyway.contracts.weather import ForecastDocument, WeatherGrid
from skyway.units import moment_to_ms

OPERATOR = "operator:op"
PATH = "/v1/networks/row/weather"

_one = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


def grid(composition: Any, speed_mps: float = 5.0, **members: Any) -> dict[str, Any]:
    """Wind from the east over the whole network, for six hours from now on."""
    now = composition.clock.now()
    times = [(now + timedelta(hours=hour)).isoformat() for hour in range(6)]
    values = [[[speed_mps] * 2] * 2] * 6
    axes = {"time": times, "latitude": [-1.0, 1.0], "longitude": [-1.0, 2.0]}
    wind = {"wind_speed_mps": values, "wind_from_deg": [[[90.0] * 2] * 2] * 6}
    return {
        "source": "test",
        "issued_at": now.isoformat(),
        "grid": {**axes, **wind, **members},
    }


def reports(composition: Any, *stations: str, **members: Any) -> dict[str, Any]:
    now = composition.clock.now().isoformat()
    values = {"valid_at": now, "wind_speed_mps": 5.0, "wind_from_deg": 90.0, **members}
    each = [{"station_id": station, **values} for station in stations]
    return {"source": "roofs", "issued_at": now, "reports": each}


async def put(composition: Any, body: Any, *, caller: str = OPERATOR) -> Any:
    return await composition(caller, "PUT", PATH, body)


async def flights(composition: Any, drone_id: str) -> list[FlyStep]:
    (instruction,) = await composition.sent(drone_id)
    return [step for step in instruction.steps if isinstance(step, FlyStep)]


async def test_a_booking_is_planned_in_the_weather_in_force(composition: Any, make: Any) -> None:
    still = await composition.book(make.candidate(1), delivery_id="dlv_1")
    answer = await put(composition, grid(composition))
    assert answer.status_code == 200, answer.text

    windy = await composition.book(make.candidate(2), delivery_id="dlv_2")

    (calm,), (mission,) = still.missions, windy.missions
    assert calm.weather is None
    assert mission.weather.source == "test"
    model = make.candidate().model
    # Against 5 m/s the drone needs v / (v - 5) times as long; with them v / (v + 5) times.
    against = max(v / (v - 5.0) for v in (model.speed_empty_mps, model.speed_full_mps))
    back = max(v / (v + 5.0) for v in (model.speed_empty_mps, model.speed_full_mps))
    out, *_, home = await flights(composition, "drn_2")
    assert out.time_factor == pytest.approx(math.ceil(against * 100) / 100)
    assert home.time_factor == pytest.approx(math.ceil(back * 100) / 100)
    # A tail wind saves time, and no energy.
    assert home.time_factor * home.energy_factor >= 1.0
    (before,) = [step for step in await flights(composition, "drn_1") if step.step_id == 2]
    flown_s = [
        moment_to_ms(each.planned_end_at) - moment_to_ms(each.planned_start_at)
        for each in (before, out)
    ]
    assert flown_s[1] / flown_s[0] == pytest.approx(out.time_factor, rel=0.01)
    assert await composition.broken() == []


@_one
async def test_a_tail_wind_makes_a_deadline_possible(composition: Any, make: Any) -> None:
    still = await composition.book(make.candidate(1), delivery_id="dlv_1")
    (eta,) = still.missions[0].packages
    deadline = (eta.eta_at - timedelta(minutes=2)).isoformat()
    request = make.request("c", qos={"deadline_at": deadline})

    before = await composition.book(make.candidate(2), delivery_id="dlv_2", request=request)
    await put(composition, grid(composition, wind_from_deg=[[[270.0] * 2] * 2] * 6))
    after = await composition.book(make.candidate(2), delivery_id="dlv_3", request=request)

    assert (before.outcome, before.reasons[0].code) == ("INFEASIBLE", "TOO_LATE")
    assert after.outcome == "BOOKED", after.reasons


@_one
async def test_the_same_forecast_changes_nothing_and_a_deleted_forecast_ends(
    composition: Any,
) -> None:
    first = await put(composition, grid(composition))
    (before,) = await composition.rows("SELECT conditions FROM networks")
    composition.clock.advance(timedelta(minutes=10))
    again = await put(composition, grid_of(first, composition))

    (after,) = await composition.rows("SELECT conditions FROM networks")
    shown = await composition("customer:c", "GET", PATH)
    assert again.json()["received_at"] == first.json()["received_at"]
    assert before == after
    assert (shown.json()["phase"], shown.json()["age_s"]) == ("VALID", 600.0)

    deleted = await composition(OPERATOR, "DELETE", PATH)
    booking = await composition.book()

    assert deleted.status_code == 204
    assert booking.missions[0].weather is None
    assert (await composition(OPERATOR, "GET", PATH)).status_code == 404


@_one
@pytest.mark.parametrize("reserve_risk", [None, 0.05])
async def test_a_plan_names_a_forecast_until_its_end_and_not_after_it(
    composition: Any, make: Any, reserve_risk: float | None
) -> None:
    await composition.publish(make.network(reserve_risk=reserve_risk))
    shown = (await put(composition, grid(composition))).json()
    skyway = await composition.parts.networks.current("row")
    world = await World.of(skyway, composition.parts.db, after_ms=0)
    end_ms = moment_to_ms(datetime.fromisoformat(shown["fades_until_at"]))

    last, over = world.weather_note(end_ms - 1), world.weather_note(end_ms)
    composition.clock.advance(timedelta(days=1))
    booking = await composition.book()

    assert (last and last.source, over) == ("test", None)
    assert booking.missions[0].weather is None


def grid_of(first: Any, composition: Any) -> dict[str, Any]:
    """The forecast that was sent ten minutes ago."""
    body = grid(composition)
    earlier = timedelta(minutes=-10)
    now = composition.clock.now() + earlier
    body["issued_at"] = now.isoformat()
    body["grid"]["time"] = [(now + timedelta(hours=hour)).isoformat() for hour in range(6)]
    assert first.status_code == 200, first.text
    return body


BAD_GRIDS: list[tuple[dict[str, Any], str, str]] = [
    ({"wind_speed_mps": [[[101.0] * 2] * 2] * 6}, "grid.wind_speed_mps.0.0.0", "at most 100"),
    ({"wind_speed_mps": [[[1.0, None]] * 2] * 6}, "grid.wind_speed_mps", "no value at 0, 0, 1"),
    (
        {"wind_speed_mps": [[[1.0] * 2] * 2] * 5},
        "grid.wind_speed_mps",
        "5 values where 6 values are needed",
    ),
    (
        {"wind_speed_mps": [[1.0] * 2] * 6},
        "grid.wind_speed_mps",
        "no list where 2 values are needed",
    ),
    ({"wind_speed_mps": None}, "grid", "wind_speed_mps and wind_from_deg"),
    ({"temperature_c": [[[61.0] * 2] * 2] * 6}, "grid.temperature_c.0.0.0", "at most 60"),
    ({"latitude": [1.0, -1.0]}, "grid.latitude", "must rise"),
    ({"latitude": [40.0, 41.0]}, "grid", "station 'a' is 4448 km away from the area"),
    ({"latitude": [0.001 * row for row in range(9_000)]}, "grid.wind_speed_mps", "108000 values"),
    ({"time": ["2020-01-01T00:00:00Z"] * 6}, "grid.time", "must rise"),
    (
        {"time": [f"{year}-01-01T00:00:00Z" for year in range(2021, 9_000, 1_300)]},
        "grid",
        "limit of 60 days",
    ),
    ({f"unknown_{n}": 1 for n in range(99)}, "grid", "members exceed the limit of 10"),
]


@_one
async def test_a_bad_forecast_is_refused_with_its_field_and_limit(composition: Any) -> None:
    for change, field, detail in BAD_GRIDS:
        answer = await put(composition, grid(composition, **change))

        assert answer.status_code == 422, (field, answer.text)
        (fault,) = answer.json()["errors"]
        assert fault["field"] == field, fault
        assert detail in fault["detail"], fault
    assert (await composition(OPERATOR, "GET", PATH)).status_code == 404


def test_a_list_of_wrong_values_is_read_up_to_the_first_of_them() -> None:
    """A million errors would take gigabytes before the first one is shown."""
    wrong = ["wrong"] * 1_000
    for member, known in (("latitude", {}), ("wind_speed_mps", {"latitude": [0.0]})):
        times = {"time": ["2026-03-02T09:00:00Z"], "longitude": [0.01 * n for n in range(1_000)]}
        grid = times | known | {member: wrong if member == "latitude" else [[wrong]]}
        body = {"source": "s", "issued_at": "2026-03-02T09:00:00Z", "grid": grid}
        with pytest.raises(ValidationError) as refused:
            ForecastDocument.model_validate(body)
        assert refused.value.error_count() < 10


AXES = [[0.0, 120.0, 240.0], [350.0, 355.0, 360.0], [-180.0, 0.0, 180.0], [179.0, 180.0, -179.0]]


@pytest.mark.parametrize("longitude", [*AXES, [179.5, 180.5, 181.0], [359.0, 1.0, 2.0]])
def test_a_grid_may_go_on_beyond_longitude_180(longitude: list[float]) -> None:
    values = [[[0.0, 0.0, 0.0]]]
    axes = {"time": ["2026-11-25T06:00:00Z"], "latitude": [0.0], "longitude": longitude}

    grid = {**axes, "wind_speed_mps": values, "wind_from_deg": values}
    about = {"source": "test", "issued_at": "2026-11-25T06:00:00Z"}

    forecast = forecast_of(ForecastDocument.model_validate({**about, "grid": grid}))

    assert 0.0 < forecast.longitude_deg[2] - forecast.longitude_deg[0] <= 360.0
    assert (np.diff(forecast.longitude_deg) > 0).all()


@pytest.mark.parametrize(
    ("longitude", "why"),
    [
        ([2.0, 1.0, 0.0], "east"),
        ([0.0, 0.0, 1.0], "east"),
        ([5.0, -5.0, -4.0], "east"),
        ([-180.0, 180.0, -179.0], "once"),
        ([10.0, 100.0, 360.5], "360"),
    ],
)
def test_a_grid_that_goes_west_is_refused(longitude: list[float], why: str) -> None:
    values = [[[0.0, 0.0, 0.0]]]
    axes = {"time": ["2026-11-25T06:00:00Z"], "latitude": [0.0], "longitude": longitude}

    with pytest.raises(ValidationError, match=rf"longitude(?s:.*){why}"):
        WeatherGrid.model_validate({**axes, "wind_speed_mps": values, "wind_from_deg": values})


@_one
async def test_forecasts_that_no_plan_could_use_are_refused(composition: Any) -> None:
    future = composition.clock.now() + timedelta(hours=2)
    past = {"issued_at": "2020-01-01T00:00:00Z"}
    old = reports(composition, "a", valid_at="2020-01-01T00:00:00Z") | past
    both = grid(composition) | {"reports": reports(composition, "a")["reports"]}
    unknown = reports(composition, "a", "nowhere")
    hole = reports(composition, "a", "b")
    hole["reports"][0]["valid_at"] = future.isoformat()
    twice = reports(composition, "a", "a")
    nowhere = reports(composition, "a")
    del nowhere["reports"][0]["station_id"]
    for body, field, detail in (
        (old, "reports", "all values are past"),
        (grid(composition) | {"issued_at": future.isoformat()}, "issued_at", "in the future"),
        (both, "forecast", "either a grid or reports"),
        (unknown, "reports.1.station_id", "no station 'nowhere'"),
        (hole, "reports", "has no report for"),
        (twice, "reports.1", "as an earlier report"),
        (nowhere, "reports.0", "needs a station_id, or latitude and longitude"),
        ([], "forecast", "must be an object"),
    ):
        answer = await put(composition, body)

        assert answer.status_code == 422, (field, answer.text)
        (fault,) = answer.json()["errors"]
        assert fault["field"] == field, fault
        assert detail in fault["detail"], fault


@_one
async def test_only_operators_change_the_weather(composition: Any) -> None:
    for caller in ("customer:c", "provider:p"):
        assert (await put(composition, grid(composition), caller=caller)).status_code == 403
        assert (await composition(caller, "DELETE", PATH)).status_code == 403
    unknown = await composition(OPERATOR, "PUT", "/v1/networks/nowhere/weather", grid(composition))
    assert unknown.status_code == 404


@_one
async def test_a_missing_forecast_and_an_unknown_network_have_different_details(
    composition: Any,
) -> None:
    calm = await composition("customer:c", "GET", PATH)
    unknown = await composition("customer:c", "GET", "/v1/networks/nowhere/weather")

    assert (calm.status_code, unknown.status_code) == (404, 404)
    assert calm.json()["detail"] == "no forecast for network 'row': its plans assume still air"
    assert unknown.json()["detail"] == "no network 'nowhere'"


@_one
async def test_wind_above_a_models_limit_closes_segments_to_its_drones(
    composition: Any, make: Any
) -> None:
    weak = make.candidate().model.model_copy(update={"max_wind_mps": 4.0})
    booked = await composition.book(make.candidate(1, model=weak), delivery_id="dlv_1")
    mission_id = booked.missions[0].mission_id

    answer = await put(composition, reports(composition, "a", "c", "e"))
    assert answer.status_code == 200, answer.text
    refused = await composition.book(make.candidate(2, model=weak), delivery_id="dlv_2")
    strong = await composition.book(make.candidate(3), delivery_id="dlv_3")

    (row,) = await composition.rows(
        f"SELECT trouble FROM missions WHERE mission_id = '{mission_id}'"
    )
    assert "WEATHER_AHEAD" in row.trouble
    assert strong.outcome == "BOOKED"
    # It waits until the wind has faded below its limit: half of 5 m/s after an hour.
    (mission,) = refused.missions
    first = next(step for step in mission.plan.steps if step.kind == "FLY")
    begins_at = mission.start_at + timedelta(seconds=first.start_s)
    faded_at = composition.clock.now() + timedelta(hours=1)
    assert abs(begins_at - faded_at) < timedelta(seconds=1)
    assert await composition.broken() == []
