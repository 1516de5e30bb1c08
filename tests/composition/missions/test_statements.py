"""Booking a delivery and hearing its drone take few statements: each holds up all others."""

from dataclasses import replace
from typing import Any

import pytest

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


@pytest.fixture
async def known(composition: Any, drone: Any) -> Any:
    """A composition that has its network at hand, and knows of drone 1."""
    await composition.book(delivery_id="dlv_0")
    (instruction,) = await composition.sent()
    await composition.receive(drone.ack(instruction, "REJECTED", code="MALFORMED"))
    return composition


async def test_a_booking_takes_few_statements(known: Any, statements: Any) -> None:
    with statements() as seen:
        await known.book()

    assert len(seen) <= 11, seen


async def test_an_accepted_mission_takes_few_statements(
    known: Any, drone: Any, statements: Any
) -> None:
    await known.book()
    (instruction,) = await known.sent()
    doing = {"mission_id": instruction.mission_id, "mission_revision": 1}
    state = drone.state(last_instruction_seq=2, **doing)

    with statements() as seen:
        await known.receive(drone.ack(instruction, "RECEIVED"), drone.ack(instruction), state)

    assert await known.state_of(instruction.mission_id) == "ACCEPTED"
    assert len(seen) <= 7, seen


async def test_a_loaded_mission_takes_few_statements(
    known: Any, drone: Any, statements: Any
) -> None:
    await known.book()
    (instruction,) = await known.sent()
    await known.receive(drone.ack(instruction))

    with statements() as seen:
        await known.receive(*drone.ended(instruction, instruction.steps[:1]))

    assert await known.state_of(instruction.mission_id) == "ACTIVE"
    assert len(seen) <= 11, seen


async def test_drones_that_stand_idle_take_one_statement_that_locks_nothing(
    known: Any, drone: Any, statements: Any
) -> None:
    idle = [replace(drone, drone_id=f"drn_{number}", stream=0) for number in range(2, 9)]
    await known.receive(*(each.state() for each in idle))

    with statements() as seen:
        await known.receive(*(each.state() for each in idle))

    assert len(seen) == 1, seen
    assert "UPDATE" not in seen[0]
