"""A cancelled package counts as released only once its drone cannot load it any more."""

from datetime import timedelta
from typing import Any

import pytest

pytestmark = pytest.mark.databases("sqlite")

PATH = "/internal/deliveries/dlv_1/cancellations"


async def cancel(composition: Any, *package_ids: str, cancellation_id: str = "cnl_1") -> Any:
    body = {
        "cancellation_id": cancellation_id,
        "package_ids": package_ids or None,
        "reason": "bought elsewhere",
    }
    return (await composition("service:gateway", "POST", PATH, body)).json()


async def released(composition: Any) -> list[tuple[str, ...]]:
    return [each.package_ids for each in await composition.reports() if each.kind == "RELEASED"]


async def sent_last(composition: Any, kind: str) -> Any:
    return [each for each in await composition.sent() if each.kind == kind][-1]


def load(composition: Any, drone: Any, instruction: Any) -> Any:
    """The end of the PICK_UP, after the time that it takes."""
    steps = instruction.steps
    number = next(number for number, step in enumerate(steps, 1) if step.kind == "PICK_UP")
    composition.clock.advance(steps[number - 1].planned_end_at - composition.clock.now())
    return drone.ended(instruction, steps[:number])


async def test_a_package_is_released_once_its_drone_has_cancelled_the_mission(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)

    answer = await cancel(composition)

    assert answer == {"released": [], "returning": ["p1"], "too_late": []}
    assert await composition.state_of(instruction.mission_id) == "ACCEPTED"
    assert await released(composition) == []

    await composition.receive(drone.ack(await sent_last(composition, "CANCEL")))

    assert await released(composition) == [("p1",)]
    assert await composition.state_of(instruction.mission_id) == "CANCELLED"
    assert await composition.reservations() == []
    assert await composition.broken() == []


async def test_a_drone_that_loads_before_it_reads_the_cancel_brings_the_package_back(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)
    await cancel(composition)
    call_off = await sent_last(composition, "CANCEL")

    await composition.receive(*load(composition, drone, instruction))
    await composition.receive(drone.ack(call_off, "REJECTED", code="STEP_RELEASED"))
    await composition.replanner.step()

    assert await released(composition) == []
    assert await composition.state_of(instruction.mission_id) == "ACTIVE"
    revision = (await composition.sent())[-1]
    assert [step.kind for step in revision.steps if step.kind in ("DELIVER", "RETURN")] == [
        "RETURN"
    ]
    assert await composition.broken() == []


async def test_a_loaded_package_is_planned_back_before_the_cancel_is_answered(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)
    await cancel(composition)
    await composition.replanner.step()
    assert (await composition.sent())[-1].kind == "CANCEL"

    await composition.receive(*load(composition, drone, instruction))
    await composition.replanner.step()

    assert (await composition.sent())[-1].kind in ("MISSION", "DIVERT")


async def test_a_hand_over_after_a_late_cancel_ends_the_mission_as_delivered(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)
    await cancel(composition)

    await composition.receive(*drone.flown(instruction))
    refused = drone.ack(await sent_last(composition, "CANCEL"), "REJECTED", code="STALE_REVISION")
    await composition.receive(refused)

    assert await released(composition) == []
    assert await composition.state_of(instruction.mission_id) == "COMPLETED"
    assert await composition.rows("SELECT code FROM alarms") == []
    assert await composition.broken() == []


async def test_a_cancelled_booking_waits_for_the_answer_of_its_drone(
    composition: Any, drone: Any
) -> None:
    await composition.book()
    (instruction,) = await composition.sent()

    answer = await cancel(composition)
    await composition.receive(drone.ack(instruction))
    await composition.replanner.step()

    assert answer["returning"] == ["p1"]
    assert (await composition.sent())[-1].kind == "CANCEL"

    await composition.receive(drone.ack(await sent_last(composition, "CANCEL")))

    assert await released(composition) == [("p1",)]
    assert await composition.state_of(instruction.mission_id) == "CANCELLED"


async def test_one_package_is_released_once_the_drone_has_a_plan_without_it(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    await begin.accepted(composition, drone, make, "b", "c")

    answer = await cancel(composition, "p2")
    again = await cancel(composition, "p2", cancellation_id="cnl_2")
    await composition.replanner.step()
    revision = (await composition.sent())[-1]

    assert answer == again == {"released": [], "returning": ["p2"], "too_late": []}
    assert [
        [each.package_id for each in step.packages]
        for step in revision.steps
        if step.kind == "PICK_UP"
    ] == [["p1"]]
    assert await released(composition) == []

    await composition.receive(drone.ack(revision))

    assert await released(composition) == [("p2",)]
    assert await composition.broken() == []


async def test_one_package_that_is_loaded_nevertheless_is_brought_back(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make, "b", "c")
    await cancel(composition, "p2")
    await composition.replanner.step()
    refused = drone.ack((await composition.sent())[-1], "REJECTED", code="STEP_RELEASED")

    await composition.receive(*load(composition, drone, instruction), refused)
    await composition.replanner.step()

    assert await released(composition) == []
    ends = [
        (step.kind, tuple(step.package_ids))
        for step in (await composition.sent())[-1].steps
        if step.kind in ("DELIVER", "RETURN")
    ]
    assert sorted(ends) == [("DELIVER", ("p1",)), ("RETURN", ("p2",))]
    assert await composition.broken() == []


async def test_a_whole_cancellation_also_releases_what_was_cancelled_before(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    await begin.accepted(composition, drone, make, "b", "c")
    await cancel(composition, "p2")

    answer = await cancel(composition, cancellation_id="cnl_2")
    await composition.receive(drone.ack(await sent_last(composition, "CANCEL")))

    assert sorted(answer["returning"]) == ["p1", "p2"]
    assert [sorted(each) for each in await released(composition)] == [["p1", "p2"]]
    assert await composition.broken() == []


@pytest.mark.parametrize("wait_s", [30, 90])
async def test_planning_waits_for_the_answer_until_the_cancel_expires(
    composition: Any, drone: Any, make: Any, begin: Any, wait_s: int
) -> None:
    await begin.accepted(composition, drone, make)
    await cancel(composition)

    composition.clock.advance(timedelta(seconds=wait_s))
    await composition.replanner.step()

    is_planned = (await composition.sent())[-1].kind == "MISSION"
    assert is_planned == (wait_s > 60)
