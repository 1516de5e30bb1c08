"""Deliveries that ended long ago are deleted whole, and only when nothing needs them any more."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.tables import (
    custody,
    cut_steps,
    deliveries,
    instructions,
    mission_steps,
    missions,
)
from sqlalchemy import func, select

from skyway.contracts.forgotten_deliveries import FORGOTTEN_PATH

GATEWAY = "service:gateway"


async def forget(composition: Any, *delivery_ids: str) -> list[str]:
    """The deliveries that are kept."""
    body = {"delivery_ids": list(delivery_ids)}
    answer = await composition(None, "POST", FORGOTTEN_PATH, body)
    assert answer.status_code == 200, answer.text
    kept: list[str] = answer.json()["kept"]
    return kept


async def flown(composition: Any, drone: Any, delivery_id: str = "dlv_1") -> Any:
    """The instruction of a mission that is over and reported."""
    await composition.book(delivery_id=delivery_id)
    [instruction] = await composition.sent()
    await composition.receive(drone.ack(instruction))
    composition.clock.advance(instruction.steps[-1].planned_end_at - composition.clock.now())
    await composition.receive(*drone.flown(instruction))
    landed = {"last_instruction_seq": instruction.seq, "station_id": "a"}
    await composition.receive(drone.state(**landed))
    await reports_arrive(composition)
    return instruction


async def reports_arrive(composition: Any) -> None:
    async with composition.db.write() as tx:
        sent = composition.db.outbox.c.channel.in_(("gateway", "registry"))
        await tx.execute(composition.db.outbox.delete().where(sent))


async def stored(composition: Any) -> dict[str, int]:
    """How many rows the tables of deliveries have."""
    tables = (deliveries, missions, mission_steps, cut_steps, custody, instructions)
    async with composition.db.read() as connection:
        return {
            table.name: (
                await connection.execute(select(func.count()).select_from(table))
            ).scalar_one()
            for table in tables
        }


async def test_a_delivery_is_deleted_with_its_parts(composition: Any, drone: Any) -> None:
    await flown(composition, drone)

    assert await forget(composition, "dlv_1") == []

    left = {name: rows for name, rows in (await stored(composition)).items() if rows}
    assert left == {"instructions": 1}
    assert await composition.broken() == []


async def test_a_delivery_may_be_deleted_twice(composition: Any, drone: Any) -> None:
    await flown(composition, drone)
    await forget(composition, "dlv_1")

    assert await forget(composition, "dlv_1", "dlv_unknown") == []


async def test_other_deliveries_stay_whole(composition: Any, drone: Any) -> None:
    await flown(composition, drone)
    await flown(composition, drone, "dlv_2")
    before = await stored(composition)

    await forget(composition, "dlv_1")

    after = await stored(composition)
    assert after["missions"] == before["missions"] - 1
    assert await composition.broken() == []


async def test_an_open_mission_keeps_its_delivery(composition: Any) -> None:
    await composition.book()

    assert await forget(composition, "dlv_1") == ["dlv_1"]
    assert await composition.broken() == []


async def test_a_waiting_report_keeps_its_delivery(composition: Any, drone: Any) -> None:
    instruction = await flown(composition, drone)
    async with composition.db.write() as tx:
        tx.report("gateway", "/internal/any", instruction, stream=instruction.mission_id)

    assert await forget(composition, "dlv_1") == ["dlv_1"]


async def test_a_drone_that_reports_the_mission_keeps_its_delivery(
    composition: Any, drone: Any
) -> None:
    instruction = await flown(composition, drone)
    carried = {"mission_id": instruction.mission_id, "mission_revision": 1, "activity": "DOWN"}
    await composition.receive(drone.state(**carried))
    await answer_all(composition, drone)
    await reports_arrive(composition)

    assert await forget(composition, "dlv_1") == ["dlv_1"]


async def answer_all(composition: Any, drone: Any) -> None:
    while waiting := await composition.sent():
        for instruction in waiting:
            await composition.receive(drone.ack(instruction))


async def test_a_no_show_keeps_its_delivery_for_seven_days(composition: Any, drone: Any) -> None:
    await composition.book()
    composition.clock.advance(timedelta(minutes=2))
    await composition.receive(drone.state())
    await composition.overdue.step()
    await answer_all(composition, drone)
    await reports_arrive(composition)
    assert len(await composition.rows("SELECT * FROM no_shows")) == 1

    assert await forget(composition, "dlv_1") == ["dlv_1"]
    composition.clock.advance(timedelta(days=7, seconds=1))
    assert await forget(composition, "dlv_1") == []
    assert await composition.rows("SELECT * FROM no_shows") == []


async def test_the_next_instruction_follows_the_deleted_ones(composition: Any, drone: Any) -> None:
    first = await flown(composition, drone)
    await forget(composition, "dlv_1")

    await composition.book(delivery_id="dlv_2")

    [instruction] = await composition.sent()
    assert instruction.seq == first.seq + 1
    assert await composition.broken() == []


async def test_the_instruction_before_an_unanswered_one_stays(composition: Any, drone: Any) -> None:
    """The drone's answer is checked against it."""
    await flown(composition, drone)
    await composition.book(delivery_id="dlv_2")

    await forget(composition, "dlv_1")

    rows = await composition.rows("SELECT seq, status FROM instructions ORDER BY seq")
    (before, _), (last, status) = rows[-2:]
    assert (last, status) == (before + 1, "SENT")


async def test_the_last_instruction_is_deleted_after_a_later_one(
    composition: Any, drone: Any
) -> None:
    await flown(composition, drone)
    await forget(composition, "dlv_1")
    await flown(composition, drone, "dlv_2")

    await forget(composition, "dlv_2")

    assert (await stored(composition))["instructions"] == 1
    assert await composition.broken() == []


async def test_a_drone_that_lost_its_journal_gets_a_new_stream_after_the_deletion(
    composition: Any, drone: Any
) -> None:
    await flown(composition, drone)
    await flown(composition, drone, "dlv_2")
    await forget(composition, "dlv_1", "dlv_2")
    await composition.book(delivery_id="dlv_3")
    [instruction] = await composition.sent()
    drone.session, drone.event_seq = 2, 0
    await composition.receive(drone.state())
    gap = {"code": "SEQUENCE_GAP", "data": {"expected_seq": 1, "stream": 1}}

    await composition.receive(drone.ack(instruction, "REJECTED", **gap))

    assert {each.stream for each in await composition.sent()} == {2}


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
async def test_only_the_gateway_may_delete_deliveries(composition: Any) -> None:
    answer = await composition(
        "provider:prv_1", "POST", FORGOTTEN_PATH, {"delivery_ids": ["dlv_1"]}
    )

    assert answer.status_code == 403
