"""Drones that say nothing: given up in bounded time, never while they may fly."""

from datetime import timedelta
from typing import Any

import pytest

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

EXPIRY = timedelta(seconds=61)
ACK_ON_ITS_WAY = timedelta(seconds=10)


async def booked(composition: Any) -> Any:
    await composition.book()
    (instruction,) = await composition.sent()
    return instruction


async def sweep_after(composition: Any, span: timedelta) -> None:
    composition.clock.advance(span)
    await composition.overdue.step()


async def test_a_lost_drone_that_never_answered_is_given_up(composition: Any, drone: Any) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.connection("LOST"))

    await sweep_after(composition, EXPIRY + ACK_ON_ITS_WAY)

    (report,) = await composition.reports()
    assert (report.kind, report.code) == ("REFUSED", "NO_ANSWER")
    assert await composition.state_of(instruction.mission_id) == "REFUSED"
    assert await composition.reservations() == []


async def test_the_word_of_a_lost_drone_may_still_be_on_its_way(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.connection("LOST"))

    await sweep_after(composition, EXPIRY)

    assert await composition.state_of(instruction.mission_id) == "BOOKED"
    await composition.receive(drone.ack(instruction))
    assert await composition.state_of(instruction.mission_id) == "ACCEPTED"


async def test_before_the_instruction_expires_nobody_is_given_up(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.connection("LOST"))

    await sweep_after(composition, timedelta(seconds=59))

    assert await composition.state_of(instruction.mission_id) == "BOOKED"


async def test_a_silent_drone_may_still_have_taken_the_mission(composition: Any) -> None:
    instruction = await booked(composition)

    await sweep_after(composition, EXPIRY)

    assert await composition.state_of(instruction.mission_id) == "BOOKED"


async def test_a_drone_that_does_something_else_after_the_expiry_is_free(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    composition.clock.advance(EXPIRY)
    await composition.receive(drone.state())

    await composition.overdue.step()

    assert await composition.state_of(instruction.mission_id) == "REFUSED"


async def test_a_drone_that_flies_it_without_our_knowing_is_left_alone(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    composition.clock.advance(EXPIRY)
    await composition.receive(drone.state(mission_id=instruction.mission_id))

    await composition.overdue.step()

    assert await composition.state_of(instruction.mission_id) == "BOOKED"


async def test_a_booking_that_nobody_ever_answers_ends_in_bounded_time(composition: Any) -> None:
    instruction = await booked(composition)

    await sweep_after(composition, timedelta(days=1))

    assert await composition.state_of(instruction.mission_id) == "REFUSED"


async def test_a_drone_silent_long_after_its_plan_is_aborted_with_what_it_carries(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    pick_up, *_ = drone.flown(instruction)
    await composition.receive(drone.ack(instruction), pick_up)

    await sweep_after(composition, timedelta(days=1))

    report = (await composition.reports())[-1]
    assert (report.kind, report.code, report.mission_state) == ("ENDED", "SILENT", "ABORTED")
    assert report.stranded_package_ids == ("p1",)
    assert await composition.reservations() == []
    assert await composition.broken() == []


async def test_a_late_drone_that_still_flies_is_not_aborted(composition: Any, drone: Any) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.ack(instruction))
    composition.clock.advance(timedelta(days=1))
    await composition.receive(drone.state(mission_id=instruction.mission_id))

    await composition.overdue.step()

    assert await composition.state_of(instruction.mission_id) == "ACCEPTED"


async def test_a_drone_that_flies_what_was_given_up_is_called_off_again_and_again(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.connection("LOST"))
    await sweep_after(composition, EXPIRY + ACK_ON_ITS_WAY)
    flying = {"mission_id": instruction.mission_id, "mission_revision": 1}

    await composition.receive(drone.state(**flying))
    (_, first) = await composition.sent()
    await composition.receive(drone.state(**flying))
    await composition.receive(drone.ack(first, "REJECTED", code="STEP_RELEASED"))
    # Its answer changes its state: told at once, they would talk for ever.
    await composition.receive(drone.state(**flying))
    assert [each.kind for each in await composition.sent()] == ["MISSION"]
    composition.clock.advance(first.expires_at - composition.clock.now() + timedelta(seconds=1))
    await composition.receive(drone.state(**flying))

    *_, again = await composition.sent()
    assert (first.kind, again.kind) == ("CANCEL", "CANCEL")
    assert again.seq == first.seq + 1


async def test_a_state_that_names_a_mission_of_nobody_calls_nothing_off(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)

    await composition.receive(drone.state(mission_id="msn_of_nobody"))

    assert await composition.sent() == [instruction]
