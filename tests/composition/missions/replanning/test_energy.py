"""New plans have the energy that drones use, as their reports and refusals say."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.planning.problem_for import planned_more, used_more

from skyway.contracts.drone_report import Wind
from skyway.contracts.flight_step import RechargeStep
from skyway.drone.charging import recharge_time_s
from skyway.drone.flight import flight_energy_j
from skyway.drone.models import PAPER_SCENARIO as MODEL
from skyway.geo import Position, distance_m
from tests.composition.missions.replanning.failed_step import alarms, failed_at, health, stands_at_b

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

OPERATOR = "operator:op"
B, C = Position(0.17986, 0.0), Position(2 * 0.17986, 0.0)


async def put_wind(composition: Any, from_east_mps: float) -> None:
    """Put the forecast of this wind for the next day."""
    times = [(composition.clock.now() + timedelta(hours=each)).isoformat() for each in (0, 12)]
    wind = {"wind_speed_mps": from_east_mps, "wind_from_deg": 90.0}
    reports = [{"station_id": each, "valid_at": at, **wind} for each in "ace" for at in times]
    forecast = {"source": "test", "issued_at": times[0], "reports": reports}
    await composition(OPERATOR, "PUT", "/v1/networks/row/weather", forecast)


@pytest.mark.parametrize(("risk", "margin"), [(None, 0.35), (0.001, 0.45)])
async def test_a_drone_in_headwind_gets_a_plan_that_it_can_fly(
    composition: Any, drone: Any, make: Any, risk: float | None, margin: float
) -> None:
    # Without a forecast the largest margin (0.4) counts at this risk, and the drone needs more.
    await composition.publish(make.network(reserve_risk=risk))
    first = await failed_at(composition, drone, 4, "b", "INSUFFICIENT_ENERGY", soc=0.6)
    in_wind = stands_at_b(drone, first, released_through=3, soc=0.6, health=health(1.31))
    await composition.receive(in_wind)

    await composition.replanner.step()

    shown = await composition(OPERATOR, "GET", f"/v1/missions/{first.mission_id}")
    mission = shown.json()["mission"]
    assert (mission["revision"], mission["margins"]["energy_margin"]) == (2, margin)
    assert ("risk" in mission["margins"]) == (risk is not None)
    (flight,) = [each for each in mission["plan"]["steps"] if each["kind"] == "FLY"]
    as_modelled_j = flight_energy_j(MODEL, length_m=distance_m(B, C), load_kg=0.4)
    assert flight["energy_j"] == pytest.approx((1 + margin) * as_modelled_j, rel=1e-3)
    revision = [each for each in await composition.sent() if each.kind == "MISSION"][-1]
    assert isinstance(revision.steps[0], RechargeStep)


@pytest.mark.parametrize(
    ("east_mps", "own", "foreseen_mps", "margin"),
    [(-7.0, 1.0, 0.0, 0.5), (7.0, 1.0, 0.0, 0.15), (7.0, 1.31, 0.0, 0.35), (-4.0, 1.0, 4.0, 0.15)],
)
async def test_a_new_plan_has_the_energy_for_wind_that_its_weather_lacks_and_for_calm_air(
    composition: Any, drone: Any, east_mps: float, own: float, foreseen_mps: float, margin: float
) -> None:
    first = await failed_at(composition, drone, 4, "b", "BATTERY_SHORT", soc=0.6, detail="short")
    speed_mps = MODEL.speed_full_mps
    wind = {"wind": Wind(east_mps=east_mps, north_mps=0.0), "still_air_factor": own}
    felt = health(speed_mps / (speed_mps + east_mps)).model_copy(update=wind)
    await composition.receive(stands_at_b(drone, first, released_through=4, soc=0.6, health=felt))
    # The forecast is newer than the plan.
    composition.clock.advance(timedelta(minutes=5))
    await put_wind(composition, foreseen_mps)

    await composition.replanner.step()

    shown = await composition(OPERATOR, "GET", f"/v1/missions/{first.mission_id}")
    assert shown.json()["mission"]["margins"]["energy_margin"] == margin


async def test_a_drone_that_refuses_for_lack_of_energy_gets_a_plan_with_more_a_minute_later(
    composition: Any, drone: Any
) -> None:
    first = await failed_at(composition, drone, 4, "b", "INSUFFICIENT_ENERGY", soc=0.6)
    stands = stands_at_b(drone, first, released_through=3, soc=0.6)
    await composition.receive(stands)

    margins = []
    for _ in range(3):
        composition.clock.advance(timedelta(minutes=1))
        await composition.replanner.step()
        *_, revision = await composition.sent()
        shown = await composition(OPERATOR, "GET", f"/v1/missions/{revision.mission_id}")
        margins.append(shown.json()["mission"]["margins"]["energy_margin"])
        refusal = drone.ack(revision, status="REJECTED", code="INSUFFICIENT_ENERGY")
        await composition.receive(refusal)
        await composition.replanner.step()
        assert (await composition.sent())[-1:] in ([], [revision])

    assert margins == pytest.approx([0.2, 0.25, 0.3])


@pytest.mark.long
@pytest.mark.parametrize(("others", "last"), [(0, "ABORTED"), (9, "ACTIVE")])
async def test_a_drone_that_refuses_ten_plans_in_a_row_for_lack_of_energy_is_given_up(
    composition: Any, drone: Any, others: int, last: str
) -> None:
    first = await failed_at(composition, drone, 4, "b", "INSUFFICIENT_ENERGY", soc=0.6)
    await composition.receive(stands_at_b(drone, first, released_through=3, soc=0.6))

    states = []
    for number in range(10):
        composition.clock.advance(timedelta(minutes=1))
        await composition.replanner.step()
        *_, revision = await composition.sent()
        code = "EXPIRED" if number < others else "INSUFFICIENT_ENERGY"
        await composition.receive(drone.ack(revision, status="REJECTED", code=code))
        states.append(await composition.state_of(first.mission_id))

    assert states == ["ACTIVE"] * 9 + [last]
    given_up = [("URGENT", "REVISIONS_REFUSED")] if last == "ABORTED" else []
    assert [(each["level"], each["code"]) for each in await alarms(composition)] == given_up
    assert (await composition.reservations() == []) == bool(given_up)
    assert await composition.broken() == []


@pytest.mark.parametrize(("charging", "longer"), [(None, 1.0), (1.1, 1.0), (0.5, 2.0)])
async def test_a_drone_that_reports_slow_charging_gets_longer_sessions_in_its_next_plan(
    composition: Any, drone: Any, charging: float | None, longer: float
) -> None:
    first = await failed_at(
        composition, drone, 4, "b", "BATTERY_SHORT", soc=0.3, detail="too little"
    )
    stands = stands_at_b(
        drone, first, released_through=4, soc=0.3, health=health(1.0, charging=charging)
    )
    await composition.receive(stands)

    await composition.replanner.step()

    (revision,) = await composition.sent()
    session = revision.steps[0]
    planned_s = (session.planned_end_at - session.planned_start_at).total_seconds()
    by_model_s = recharge_time_s(MODEL, 0.3, session.until_soc)
    assert planned_s == pytest.approx(longer * by_model_s, rel=1e-3)


@pytest.mark.parametrize(
    ("factor", "used", "planned"),
    [(0.9, 0.0, 0.0), (1.02, 0.0, 0.0), (1.03, 0.03, 0.05), (1.31, 0.31, 0.35), (9.0, 3.0, 3.05)],
)
def test_higher_energy_use_is_planned_with_headroom_within_bounds(
    migrated_url: str, factor: float, used: float, planned: float
) -> None:
    assert used_more(factor) == pytest.approx(used)
    assert planned_more(factor) == pytest.approx(planned)
