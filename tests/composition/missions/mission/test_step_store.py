"""Cut steps: their ends are kept when other steps get their numbers."""

from datetime import timedelta
from typing import Any

from skyway_composition.missions.mission.step_store import (
    LiveSteps,
    ended_events,
    flown_totals,
    keep_cut_step,
    steps_of,
)
from sqlalchemy import text

from skyway.ids import MissionId
from skyway.units import moment_to_ms


async def totals(composition: Any, mission_id: MissionId) -> dict[str, float]:
    async with composition.db.read() as connection:
        steps = await steps_of(connection, mission_id)
        return flown_totals(await ended_events(connection, mission_id, steps))


async def test_a_cut_recharge_counts_once_before_and_after_its_row_is_replaced(
    composition: Any, drone: Any
) -> None:
    booking = await composition.book()
    mission_id = booking.missions[0].mission_id
    [instruction] = await composition.sent()
    steps = instruction.steps
    number = next(i for i, step in enumerate(steps) if step.kind == "RECHARGE")
    ends = drone.flown(instruction)[: number + 1]
    cut_at = steps[number].planned_start_at + timedelta(seconds=100)
    cut = {"code": "CUT", "ended_at": cut_at}
    ends[-1] = drone.event(
        "STEP_ENDED",
        mission_id=mission_id,
        mission_revision=1,
        step_id=steps[number].step_id,
        step_kind="RECHARGE",
        started_at=steps[number].planned_start_at,
        **cut,
    )
    async with composition.db.write() as tx:
        await keep_cut_step(tx, mission_id, ends[-1].message)
        # A repeated event changes nothing.
        await keep_cut_step(tx, mission_id, ends[-1].message)

    assert await composition.rows("SELECT cuts FROM missions") == [(1,)]
    assert (await totals(composition, mission_id))["recharging_s"] == 100.0
    async with composition.db.write() as tx:
        ended = "UPDATE mission_steps SET status = 'ENDED', event = :event WHERE step_id = :step_id"
        values = {"event": ends[-1].message.model_dump_json(), "step_id": steps[number].step_id}
        await tx.execute(text(ended), values)
    assert (await totals(composition, mission_id))["recharging_s"] == 100.0


async def test_the_end_of_a_cut_step_is_saved_when_it_is_reported(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    mission_id, second = instruction.mission_id, instruction.steps[1]
    command = {"command": "RETURN_HOME", "reason": "the customer has called"}
    await composition("operator:op", "POST", f"/v1/missions/{mission_id}/commands", command)
    await composition.replanner.step()
    await composition.receive(
        drone.event(
            "STEP_ENDED",
            mission_id=mission_id,
            mission_revision=1,
            step_id=second.step_id,
            step_kind="WAIT",
            station_id="a",
            started_at=second.planned_start_at,
            ended_at=second.planned_start_at + timedelta(seconds=30),
            code="CUT",
        ),
    )

    [row] = await composition.rows("SELECT kind, station_id, ended_ms - started_ms FROM cut_steps")
    assert tuple(row) == ("WAIT", "a", 30_000)
    assert (await totals(composition, mission_id))["waiting_s"] == 30.0
    assert await composition.broken() == []


async def test_the_steps_of_live_missions_are_those_of_the_database_after_each_change(
    composition: Any, drone: Any
) -> None:
    await composition.book()
    [instruction] = await composition.sent()
    steps, mission_id = instruction.steps, instruction.mission_id
    [ended] = drone.ended(instruction, steps[:1])

    async with composition.db.write() as tx:
        live = LiveSteps(tx, [mission_id])
        assert await live.planned(mission_id, ended.message) == steps[0]

        async def is_as_stored() -> bool:
            return await live.of(mission_id) == await steps_of(tx.connection, mission_id)

        await live.end(mission_id, ended.message, status="ENDED")
        assert await is_as_stored()
        assert await live.planned(mission_id, ended.message) is None
        assert await live.ended_events(mission_id) == [ended.message]
        next_end_ms = moment_to_ms(steps[1].planned_end_at)
        assert await live.next_ends_ms() == {mission_id: next_end_ms}
        await live.change(
            mission_id, steps[2].model_copy(update={"planned_start_at": steps[1].planned_start_at})
        )
        assert await is_as_stored()
        await live.replace(mission_id, steps[2:4], first_step=3, revision=2)
        assert await is_as_stored()
        await live.replace_planned(mission_id, steps[1:3], revision=3)
        assert await is_as_stored()
        assert [each.revision for each in await live.of(mission_id)] == [1, 3, 3]


async def test_a_step_of_a_later_revision_is_not_ended_by_an_event_of_an_earlier_one(
    composition: Any, drone: Any
) -> None:
    await composition.book()
    [instruction] = await composition.sent()
    [ended] = drone.ended(instruction, instruction.steps[:1])

    async with composition.db.write() as tx:
        live = LiveSteps(tx, [instruction.mission_id])
        await live.replace_planned(instruction.mission_id, instruction.steps, revision=2)

        assert await live.planned(instruction.mission_id, ended.message) is None
