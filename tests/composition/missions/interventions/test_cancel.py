"""Cancellations: packages are stopped if possible; the answer says what becomes of each."""

import asyncio
from datetime import timedelta
from typing import Any

import pytest

pytestmark = pytest.mark.databases("sqlite")

PATH = "/internal/deliveries/dlv_1/cancellations"


async def cancel(
    composition: Any,
    *package_ids: str,
    cancellation_id: str = "cnl_1",
    caller: str = "service:gateway",
) -> Any:
    body = {
        "cancellation_id": cancellation_id,
        "package_ids": package_ids or None,
        "reason": "bought elsewhere",
    }
    return await composition(caller, "POST", PATH, body)


async def reports_of(composition: Any, kind: str) -> list[Any]:
    return [each for each in await composition.reports() if each.kind == kind]


async def shown(composition: Any, mission_id: str) -> Any:
    return (await composition("operator:op", "GET", f"/v1/missions/{mission_id}")).json()


async def test_a_delivery_cancelled_before_loading_never_leaves_the_pickup(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)

    answer = await cancel(composition)

    call_off = (await composition.sent())[-1]
    await composition.receive(drone.ack(call_off))

    assert answer.json() == {"released": [], "returning": ["p1"], "too_late": []}
    assert call_off.kind == "CANCEL"
    assert await composition.state_of(instruction.mission_id) == "CANCELLED"
    (released,) = await reports_of(composition, "RELEASED")
    (ended,) = await reports_of(composition, "ENDED")
    assert (released.package_ids, released.code) == (("p1",), "CANCELLED")
    assert (ended.mission_state, ended.code) == ("CANCELLED", "CANCELLED")
    assert await composition.reservations() == []
    assert await composition.broken() == []


async def test_packages_that_a_drone_out_of_reach_may_load_are_returning(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)
    await composition.receive(drone.connection("LOST"))

    answer = await cancel(composition)

    assert answer.json() == {"released": [], "returning": ["p1"], "too_late": []}
    assert await composition.state_of(instruction.mission_id) == "ACCEPTED"
    assert await composition.broken() == []


async def test_a_delivery_whose_mission_has_ended_is_not_closed_and_too_late_to_cancel(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)
    await composition.receive(*drone.flown(instruction))

    closed = await composition("service:gateway", "PUT", "/internal/deliveries/dlv_1/closed")
    answer = await cancel(composition)

    assert closed.json()["is_closed"] is False
    assert [each["state"] for each in closed.json()["missions"]] == ["COMPLETED"]
    assert answer.json()["too_late"] == ["p1"]
    assert await composition.broken() == []


async def test_a_cancelled_package_that_is_loaded_is_returned_at_the_pickup(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)
    await composition.receive(drone.connection("LOST"))
    await cancel(composition)

    await composition.replanner.step()

    revision = (await composition.sent())[-1]
    pickup = next(step for step in instruction.steps if step.kind == "PICK_UP")
    assert [
        (step.kind, step.station_id)
        for step in revision.steps
        if step.kind in ("PICK_UP", "RETURN", "DELIVER")
    ] == [("PICK_UP", pickup.station_id), ("RETURN", pickup.station_id)]


async def test_a_repeated_cancellation_gets_the_same_answer_and_does_nothing(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make, "b", "c")
    first = await cancel(composition, "p1")
    reports_before = len(await composition.reports())
    delivered = next(s.step_id for s in instruction.steps if s.kind == "DELIVER")
    await composition.receive(*drone.ended(instruction, instruction.steps[1:delivered]))
    delivered_reports = len(await composition.reports()) - reports_before

    second = await cancel(composition, "p1")
    another = await cancel(composition, "p1", cancellation_id="cnl_2")

    assert first.json() == second.json()
    assert first.json()["returning"] == ["p1"]
    assert another.json()["too_late"] == ["p1"]
    assert len(await composition.reports()) == reports_before + delivered_reports


@pytest.mark.databases("sqlite", "postgresql")
async def test_two_concurrent_equal_cancellations_count_once(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    await begin.accepted(composition, drone, make)

    answers = await asyncio.gather(*(cancel(composition) for _ in range(4)))

    assert {each.status_code for each in answers} == {200}
    assert [each.json()["returning"] for each in answers] == [["p1"]] * 4
    assert len(await reports_of(composition, "RETURNING")) == 1


async def test_after_a_partial_cancellation_the_other_packages_get_a_new_plan(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make, "b", "c")

    answer = await cancel(composition, "p2")

    assert answer.json()["returning"] == ["p2"]
    progress = await shown(composition, instruction.mission_id)
    assert (progress["mission"]["state"], progress["trouble"]["code"]) == (
        "ACCEPTED",
        "PACKAGES_CANCELLED",
    )
    assert [each["package_id"] for each in progress["mission"]["packages"]] == ["p1"]
    ((request,),) = await composition.rows("SELECT request FROM missions")
    assert '"p2"' not in request


async def test_cancelled_packages_on_board_come_back(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make, "b", "c")

    answer = await cancel(composition, "p2")

    assert answer.json() == {"released": [], "returning": ["p2"], "too_late": []}
    progress = await shown(composition, instruction.mission_id)
    assert progress["aims"] == [{"package_id": "p2", "station_id": "a", "kind": "RETURN"}]
    assert progress["trouble"]["code"] == "CANCELLED"
    (returning,) = await reports_of(composition, "RETURNING")
    assert (returning.package_ids, returning.code) == (("p2",), "CANCELLED")


async def test_a_returning_package_is_reported_once(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    await begin.loaded(composition, drone, make, "b", "c")
    await cancel(composition, "p2")

    whole = await cancel(composition, cancellation_id="cnl_2")

    assert whole.json()["returning"] == ["p1", "p2"]
    assert [each.package_ids for each in await reports_of(composition, "RETURNING")] == [
        ("p2",),
        ("p1",),
    ]


async def test_packages_cancelled_during_loading_come_back(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)
    start_at = instruction.steps[0].planned_start_at
    composition.clock.advance(start_at - composition.clock.now())
    await composition.receive(begin.standing(drone, instruction))

    answer = await cancel(composition)

    assert answer.json() == {"released": [], "returning": ["p1"], "too_late": []}
    assert await composition.state_of(instruction.mission_id) == "ACTIVE"
    assert not any(each.kind == "CANCEL" for each in await composition.sent())


@pytest.mark.parametrize(("seconds_left", "is_called_off"), [(4, False), (6, True)])
async def test_a_cancellation_needs_five_seconds_to_reach_the_drone(
    composition: Any, drone: Any, make: Any, begin: Any, seconds_left: int, is_called_off: bool
) -> None:
    instruction = await begin.accepted(composition, drone, make)
    pick_up = next(step for step in instruction.steps if step.kind == "PICK_UP")
    wait = pick_up.planned_start_at - composition.clock.now()
    composition.clock.advance(wait - timedelta(seconds=seconds_left))

    answer = await cancel(composition)

    assert answer.json()["returning"] == ["p1"]
    assert any(each.kind == "CANCEL" for each in await composition.sent()) == is_called_off


async def test_packages_of_a_drone_that_has_not_answered_are_too_late(composition: Any) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    composition.clock.advance(instruction.steps[0].planned_start_at - composition.clock.now())

    answer = await cancel(composition)

    assert answer.json() == {"released": [], "returning": [], "too_late": ["p1"]}
    assert await composition.state_of(instruction.mission_id) == "BOOKED"


async def test_before_a_loader_confirms_all_packages_can_stay(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)

    answer = await cancel(composition)

    assert answer.json()["released"] == ["p1"]
    assert await composition.state_of(instruction.mission_id) == "CANCELLED"


async def test_packages_that_a_loader_has_confirmed_come_back(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)
    body = {"packages": [{"package_id": "p1", "mass_kg": 0.4}]}
    path = f"/v1/missions/{instruction.mission_id}/loading"
    await composition("operator:op", "POST", path, body)

    answer = await cancel(composition)

    assert answer.json()["returning"] == ["p1"]
    progress = await shown(composition, instruction.mission_id)
    assert [aim["kind"] for aim in progress["aims"]] == ["RETURN"]
    trouble = progress["trouble"]
    assert (trouble["code"], [each["package_id"] for each in trouble["loaded"]]) == (
        "CANCELLED",
        ["p1"],
    )


async def test_a_delivered_package_is_too_late_to_cancel(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)
    await composition.receive(*drone.flown(instruction))

    answer = await cancel(composition)

    assert answer.json() == {"released": [], "returning": [], "too_late": ["p1"]}


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_cancellation_reaches_all_missions_of_the_delivery_and_no_other(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    await composition.book(request=make.request("b"))
    others = await composition.book(make.candidate(2), delivery_id="dlv_2")
    request = make.request("b", "c")
    second = request.model_copy(update={"packages": request.packages[1:]})
    await composition.book(make.candidate(3), attempt=2, request=second)

    answer = await cancel(composition)

    assert answer.json()["returning"] == ["p1", "p2"]
    rows = await composition.rows("SELECT mission_id FROM instructions WHERE kind = 'CANCEL'")
    assert len(rows) == 2
    assert others.missions[0].mission_id not in {row.mission_id for row in rows}
    assert await composition.broken() == []


async def test_packages_that_were_never_booked_are_released(composition: Any) -> None:
    answer = await cancel(composition, "p7")

    assert answer.json() == {"released": ["p7"], "returning": [], "too_late": []}


async def test_only_services_may_cancel(composition: Any) -> None:
    for caller in ("operator:op", "customer:c", "provider:prv_1"):
        assert (await cancel(composition, caller=caller)).status_code == 403
