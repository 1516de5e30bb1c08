"""The flight before a diversion: the steps after it decide whether it lands."""

from typing import Any

import pytest
from skyway_composition.missions.mission.record import Proposal
from skyway_composition.missions.mission.step_store import steps_of
from skyway_composition.missions.mission.store import get
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.propose import adjust_last_flight

from skyway.contracts.flight_step import FlyStep, WaitStep
from skyway.ids import InstructionId, MissionId

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


async def joined(composition: Any, step: Any) -> bool:
    """Whether the first flight of a mission lands when this step follows it."""
    async with composition.db.write() as tx:
        record = await get(tx.connection, MissionId("msn_000001"), provider_id=None)
        assert record is not None
        proposal = Proposal(
            instruction_id=InstructionId("ins_9"),
            first_step=step.step_id,
            mission=record.mission,
            steps=(step,),
            code="STATION_CLOSED",
            detail="closed",
        )
        work = await MissionUnitOfWork.lock(composition.parts, tx, [record.drone_id])
        await adjust_last_flight(work, record.mission_id, proposal)
    async with composition.db.read() as connection:
        steps = await steps_of(connection, MissionId("msn_000001"))
    (flight,) = [each.step for each in steps if each.step.step_id == step.step_id - 1]
    assert isinstance(flight, FlyStep)
    rows = await composition.rows("SELECT lands FROM mission_steps WHERE step_id = 2")
    assert [bool(row.lands) for row in rows] == [flight.lands]
    return flight.lands


async def test_a_flight_lands_before_a_wait_but_not_before_a_flight(composition: Any) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    flight, stop = instruction.steps[1:3]
    assert isinstance(flight, FlyStep)
    assert flight.lands
    onward = flight.model_copy(update={"step_id": 3})
    wait = WaitStep(
        step_id=3,
        planned_start_at=stop.planned_start_at,
        planned_end_at=stop.planned_end_at,
        station_id=flight.to_id,
        until_at=stop.planned_end_at,
    )

    assert not await joined(composition, onward)
    assert await joined(composition, wait)
