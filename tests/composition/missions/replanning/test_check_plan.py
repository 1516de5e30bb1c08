"""When the plan of a drone is checked, and what its drone may use before it needs another."""

import json
from datetime import timedelta
from typing import Any

import pytest
from sqlalchemy import Engine, event

from tests.composition.missions.replanning.test_in_flight import (
    FOR_TWO_FLIGHTS_J,
    flying,
    take_off,
)

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

HEALTH = {
    "voltage_v": 22.0,
    "current_a": 1.0,
    "soc_error": 0.01,
    "cell_spread_v": 0.01,
    "temperature_c": 20.0,
    "state_of_health": 1.0,
    "range_m": 10_000.0,
}

WORN = {"still_air_factor": 1.1, "state_of_health": 0.9}


@pytest.fixture
async def ready(composition: Any, drone: Any) -> dict[str, Any]:
    """The state of a drone that waits to begin an accepted mission."""
    await composition.receive(drone.state(stream=0))
    await composition.book()
    (instruction,) = await composition.sent()
    await composition.receive(drone.ack(instruction))
    return {"mission_id": instruction.mission_id, "mission_revision": 1, "step_id": 1}


async def troubles(composition: Any) -> list[str | None]:
    return [row.trouble for row in await composition.rows("SELECT trouble FROM missions")]


async def test_the_plan_of_an_unchanged_waiting_drone_is_not_checked(
    composition: Any, drone: Any, ready: Any
) -> None:
    seen: list[str] = []

    def note(_connection: Any, _cursor: Any, statement: str, *_: Any) -> None:
        seen.append(statement)

    event.listen(Engine, "before_cursor_execute", note)
    try:
        await composition.receive(drone.state(**ready), drone.state(**ready))
    finally:
        event.remove(Engine, "before_cursor_execute", note)

    assert [each for each in seen if "mission_steps" in each] == []
    assert await troubles(composition) == [None]


@pytest.mark.parametrize(
    "said",
    [
        {"soc": 0.5},
        {"health": HEALTH | {"consumption_factor": 1.8}},
    ],
)
async def test_a_drone_in_worse_condition_than_booked_needs_another_plan(
    composition: Any, drone: Any, ready: Any, said: dict[str, Any]
) -> None:
    await composition.receive(drone.state(**ready | said))

    (trouble,) = await troubles(composition)
    assert trouble is not None
    assert "MORE_ENERGY" in trouble


@pytest.mark.parametrize(("factor", "needs_another"), [(1.0, False), (1.8, True)])
async def test_a_drone_that_says_its_battery_is_dead_is_judged_by_what_it_uses(
    composition: Any, drone: Any, ready: Any, factor: float, needs_another: bool
) -> None:
    wind = {"east_mps": -4.0, "north_mps": 0.0}
    said = {"state_of_health": 0.0, "wind": wind, "consumption_factor": factor}
    await composition.receive(drone.state(**ready | {"soc": 0.9, "health": HEALTH | said}))

    (trouble,) = await troubles(composition)
    assert (trouble is not None) is needs_another


@pytest.mark.parametrize(("learned", "needs_another"), [({}, True), (WORN, False)])
async def test_a_drone_that_uses_what_was_learned_about_it_keeps_its_plan(
    composition: Any, drone: Any, make: Any, learned: dict[str, float], needs_another: bool
) -> None:
    await composition.receive(drone.state(stream=0))
    await composition.book(make.candidate(learned=learned))
    (instruction,) = await composition.sent()
    await composition.receive(drone.ack(instruction))
    ready = {"mission_id": instruction.mission_id, "mission_revision": 1, "step_id": 1}

    used = {"health": HEALTH | {"consumption_factor": 1.25}}
    await composition.receive(drone.state(**ready | used))

    (trouble,) = await troubles(composition)
    assert (trouble is not None) is needs_another


@pytest.mark.parametrize(("wind_mps", "needs_another"), [(0.0, True), (5.0, False)])
async def test_a_drone_that_uses_what_the_forecast_says_keeps_its_plan(
    composition: Any, drone: Any, wind_mps: float, needs_another: bool
) -> None:
    now = composition.clock.now().isoformat()
    wind = {"valid_at": now, "wind_speed_mps": wind_mps, "wind_from_deg": 90.0}
    reports = [{"station_id": station, **wind} for station in "ace"]
    forecast = {"source": "test", "issued_at": now, "reports": reports}
    await composition("operator:op", "PUT", "/v1/networks/row/weather", forecast)
    await composition.receive(drone.state(stream=0))
    await composition.book()
    (instruction,) = await composition.sent()
    await composition.receive(drone.ack(instruction))
    ready = {"mission_id": instruction.mission_id, "mission_revision": 1, "step_id": 1}

    used = {"health": HEALTH | {"consumption_factor": 1.25}}
    await composition.receive(drone.state(**ready | used))

    (trouble,) = await troubles(composition)
    assert (trouble is not None) is needs_another


@pytest.mark.parametrize(
    "changes",
    [
        {"faults": ["BATTERY_LOW"], "soc": 0.5},
        {"health": HEALTH | {"consumption_factor": 1.8}},
    ],
)
async def test_a_state_after_an_alarm_is_checked_against_the_plan(
    composition: Any, drone: Any, ready: Any, changes: dict[str, Any]
) -> None:
    await composition.receive(drone.state(**ready))
    alarm = drone.event(
        "ALARM",
        mission_id=ready["mission_id"],
        mission_revision=1,
        code="BATTERY_LOW",
        level="URGENT",
    )

    await composition.receive(alarm, drone.state(**ready | changes))

    (trouble,) = await troubles(composition)
    assert trouble is not None
    assert "MORE_ENERGY" in trouble


async def test_the_first_state_of_a_drone_is_checked_against_the_plan(
    composition: Any, drone: Any
) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    mission = {"mission_id": instruction.mission_id, "mission_revision": 1, "step_id": 1}

    await composition.receive(drone.ack(instruction), drone.state(**mission, soc=0.5))

    (trouble,) = await troubles(composition)
    assert trouble is not None
    assert "MORE_ENERGY" in trouble


async def test_the_plan_of_a_drone_that_has_not_begun_in_time_is_checked(
    composition: Any, drone: Any, ready: Any
) -> None:
    (row,) = await composition.rows("SELECT released_ms - start_ms AS lasts FROM missions")
    composition.clock.advance(timedelta(milliseconds=row.lasts))

    await composition.receive(drone.state(**ready))

    (trouble,) = await troubles(composition)
    assert trouble is not None
    assert "LATE" in trouble


async def test_a_drone_that_falls_silent_before_it_begins_is_found_late(
    composition: Any, drone: Any, ready: Any
) -> None:
    (row,) = await composition.rows("SELECT released_ms - start_ms AS lasts FROM missions")
    await composition.receive(drone.state(**ready))
    composition.clock.advance(timedelta(milliseconds=row.lasts))

    await composition.late_missions.step()

    (trouble,) = await troubles(composition)
    assert trouble is not None
    assert "LATE" in trouble


@pytest.mark.parametrize(("soc", "expected"), [(1.0, None), (0.2, "MORE_ENERGY")])
async def test_a_drone_in_flight_gets_a_new_plan_only_if_its_next_landing_needs_one(
    composition: Any, drone: Any, make: Any, soc: float, expected: str | None
) -> None:
    first = await take_off(composition, drone, "e", make=make, battery_j=FOR_TWO_FLIGHTS_J)
    over, landing = first.steps[1:3]
    assert (over.lands, landing.lands) == (False, True)
    used = {"health": HEALTH | {"consumption_factor": 1.25}}

    await composition.receive(flying(drone, first, over.step_id, soc=soc, **used))

    assert await trouble_code(composition) == expected


@pytest.mark.parametrize(("factor", "expected"), [(1.13, None), (1.25, "MORE_ENERGY")])
async def test_a_drone_that_charges_gets_a_new_plan_for_the_flights_after_its_session(
    composition: Any, drone: Any, make: Any, factor: float, expected: str | None
) -> None:
    first = await take_off(composition, drone, "e", make=make)
    flight, recharge = first.steps[1:3]
    assert (flight.lands, recharge.kind) == (True, "RECHARGE")
    composition.clock.advance(flight.planned_end_at - composition.clock.now())
    used = {"health": HEALTH | {"consumption_factor": factor}}

    await composition.receive(
        *drone.ended(first, [flight]),
        flying(
            drone,
            first,
            recharge.step_id,
            activity="RECHARGING",
            station_id=recharge.station_id,
            **used,
        ),
    )

    assert await trouble_code(composition) == expected


async def trouble_code(composition: Any) -> str | None:
    """Why the mission needs another plan; None if it needs none."""
    ((trouble,),) = await composition.rows("SELECT trouble FROM missions")
    return None if trouble is None else str(json.loads(trouble)["code"])
