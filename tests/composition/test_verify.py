"""What `verify` allows. What it finds: tests/verification."""

from typing import Any

import pytest
from sqlalchemy import text

from skyway.contracts.flight_step import FlyStep
from skyway.units import moment_to_ms


async def test_a_sound_database_has_no_violation(composition: Any) -> None:
    await composition.book()

    assert await composition.broken() == []


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
@pytest.mark.parametrize("has_begun", [False, True])
async def test_only_a_flight_that_has_begun_may_use_what_is_closed(
    composition: Any, drone: Any, has_begun: bool
) -> None:
    await composition.receive(drone.state(stream=0))
    await composition.book()
    (instruction,) = await composition.sent()
    flight = next(each for each in instruction.steps if isinstance(each, FlyStep))
    state = drone.state(
        mission_id=instruction.mission_id,
        mission_revision=1,
        activity="FLYING" if has_begun else "WAITING",
        step_id=flight.step_id,
        released_through=flight.step_id if has_begun else flight.step_id - 1,
    )
    await composition.receive(drone.ack(instruction), state)
    made_ms = moment_to_ms(flight.planned_start_at) - 1
    async with composition.db.write() as tx:
        columns = "closure_id, kind, network_id, station_id, to_station_id, from_ms, made_ms"
        ends = f"'{flight.from_id}', '{flight.to_id}'"
        values = f"'cls_1', 'SEGMENT', 'row', {ends}, {made_ms}, {made_ms}"
        await tx.execute(text(f"INSERT INTO closures ({columns}) VALUES ({values})"))

    broken = await composition.broken()

    assert ("I11 no live plan uses what is closed" in {name for name, _ in broken}) != has_begun
