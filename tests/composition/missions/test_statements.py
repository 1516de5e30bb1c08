"""A booking and the messages of its drone need few statements: each statement costs time."""

from dataclasses import replace
from typing import Any

import pytest

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


@pytest.fixture
async def warm(composition: Any, drone: Any) -> Any:
    """A composition with its network in memory and a link to drone 1."""
    await composition.book(delivery_id="dlv_0")
    (instruction,) = await composition.sent()
    await composition.receive(drone.ack(instruction, "REJECTED", code="MALFORMED"))
    return composition


async def test_a_booking_needs_few_statements(warm: Any, statements: Any) -> None:
    with statements() as seen:
        await warm.book()

    assert len(seen) <= 12, seen


async def test_an_accepted_mission_needs_few_statements(
    warm: Any, drone: Any, statements: Any
) -> None:
    await warm.book()
    (instruction,) = await warm.sent()
    doing = {"mission_id": instruction.mission_id, "mission_revision": 1}
    state = drone.state(last_instruction_seq=2, **doing)

    with statements() as seen:
        await warm.receive(drone.ack(instruction, "RECEIVED"), drone.ack(instruction), state)

    assert await warm.state_of(instruction.mission_id) == "ACCEPTED"
    assert len(seen) <= 7, seen


async def test_a_loaded_mission_needs_few_statements(
    warm: Any, drone: Any, statements: Any
) -> None:
    await warm.book()
    (instruction,) = await warm.sent()
    await warm.receive(drone.ack(instruction))

    with statements() as seen:
        await warm.receive(*drone.ended(instruction, instruction.steps[:1]))

    assert await warm.state_of(instruction.mission_id) == "ACTIVE"
    # One of them reads the steps before: the hand-over is believed only if it fits them.
    assert len(seen) <= 12, seen


async def test_idle_drones_need_one_statement_without_locks(
    warm: Any, drone: Any, statements: Any
) -> None:
    idle = [replace(drone, drone_id=f"drn_{number}", stream=0) for number in range(2, 9)]
    await warm.receive(*(each.state() for each in idle))

    with statements() as seen:
        await warm.receive(*(each.state() for each in idle))

    assert len(seen) == 1, seen
    assert "UPDATE" not in seen[0]


async def test_a_whole_flight_in_one_batch_reads_its_steps_and_its_custody_once(
    warm: Any, drone: Any, statements: Any
) -> None:
    await warm.book()
    (instruction,) = await warm.sent()
    await warm.receive(drone.ack(instruction))

    with statements() as seen:
        await warm.receive(*drone.flown(instruction))

    assert await warm.state_of(instruction.mission_id) == "COMPLETED"
    assert (
        len([each for each in seen if "FROM mission_steps" in each and "UPDATE" not in each]) == 1
    )
    assert len([each for each in seen if "FROM custody" in each]) == 1
