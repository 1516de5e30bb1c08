"""A drone that was silent for hours comes back with packages of an ended mission."""

from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
from sqlalchemy import text

from tests.composition.drone_messages import evidence_of

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


async def back_after_hours(composition: Any, drone: Any, **members: Any) -> Any:
    """The instruction of a mission that was given up while its drone was flying."""
    await composition.book()
    (instruction,) = await composition.sent()
    pick_up, *_ = drone.flown(instruction)
    drone.event_seq = 1
    composition.clock.advance(instruction.steps[0].planned_end_at - composition.clock.now())
    await composition.receive(drone.ack(instruction), pick_up, on(drone, instruction))
    composition.clock.advance(timedelta(hours=48))
    await composition.overdue.step()
    await composition(
        "operator:op",
        "POST",
        f"/v1/missions/{instruction.mission_id}/commands",
        {"command": "GIVE_UP", "reason": "nobody can find the drone"},
    )
    assert await composition.state_of(instruction.mission_id) == "ABORTED"
    await composition.receive(on(drone, instruction, **members))
    return instruction


def on(drone: Any, instruction: Any, **members: Any) -> Any:
    """The state of a drone on its first flight of this mission, changed by `members`."""
    values = {
        "mission_id": instruction.mission_id,
        "mission_revision": 1,
        "activity": "FLYING",
        "step_id": 2,
        "released_through": 2,
        "station_id": None,
        "package_ids": ("p1",),
        **members,
    }
    return drone.state(**values)


async def new_instructions(composition: Any) -> list[Any]:
    return [each for each in await composition.sent() if each.kind != "REPORT"]


async def test_the_drone_is_instructed_to_hold_and_an_alarm_is_raised(
    composition: Any, drone: Any
) -> None:
    first = await back_after_hours(composition, drone)
    await composition.receive(on(drone, first))

    kinds = [each.kind for each in await new_instructions(composition)]
    assert sorted(kinds) == ["CANCEL", "HOLD"]
    alarms = (await composition("operator:op", "GET", "/v1/alarms")).json()["items"]
    (alarm,) = [each for each in alarms if each["code"] == "FLIES_ON"]
    assert alarm["level"] == "CRITICAL"
    assert alarm["data"]["package_ids"] == ["p1"]


async def test_the_drone_leaves_all_packages_where_it_landed(composition: Any, drone: Any) -> None:
    first = await back_after_hours(composition, drone)
    for instruction in await new_instructions(composition):
        status = "ACCEPTED" if instruction.kind == "HOLD" else "REJECTED"
        await composition.receive(drone.ack(instruction, status))
    stands = {"activity": "WAITING", "station_id": "b", "is_held": True, "step_id": 3}

    await composition.receive(on(drone, first, **stands))
    await composition.receive(on(drone, first, **stands))

    (last,) = [each for each in await composition.sent() if each.kind == "MISSION"]
    (step,) = last.steps
    assert (last.mission_revision, last.first_step) == (2, 3)
    assert (step.kind, step.station_id, step.package_ids) == ("RETURN", "b", ("p1",))
    await composition.receive(drone.ack(last))
    left = drone.event(
        "STEP_ENDED",
        mission_id=first.mission_id,
        mission_revision=2,
        step_id=3,
        step_kind="RETURN",
        station_id="b",
        package_ids=("p1",),
    )
    await composition.receive(left)
    rows = await composition.rows("SELECT custodian_kind, custodian_id FROM custody ORDER BY seq")
    assert [tuple(row) for row in rows][1:] == [("DRONE", "drn_1"), ("STATION", "b")]
    assert await composition.broken() == []


async def test_the_drone_is_not_stopped_while_it_leaves_the_packages(
    composition: Any, drone: Any
) -> None:
    first = await back_after_hours(
        composition,
        drone,
        activity="DELIVERING",
        station_id="b",
        mission_revision=2,
        step_id=3,
        released_through=3,
    )

    assert first.mission_id
    assert "HOLD" not in [each.kind for each in await composition.sent()]


async def test_a_late_hand_over_of_loaded_packages_changes_their_custody(
    composition: Any, drone: Any
) -> None:
    instruction = await back_after_hours(composition, drone)

    await composition.receive(late_hand_over(drone, instruction, after=timedelta(hours=1)))

    assert [kind for kind, _ in await custodians(composition)] == ["STATION", "DRONE", "RECIPIENT"]
    assert "LATE_HAND_OVER" in await alarm_codes(composition)
    assert await composition.broken() == []


async def test_a_late_hand_over_that_is_too_fast_changes_no_custody(
    composition: Any, drone: Any
) -> None:
    instruction = await back_after_hours(composition, drone)

    await composition.receive(late_hand_over(drone, instruction, after=timedelta(seconds=2)))

    assert [kind for kind, _ in await custodians(composition)] == ["STATION", "DRONE"]
    assert "IMPLAUSIBLE" in await alarm_codes(composition)


async def test_packages_that_were_left_at_a_station_may_be_delivered_late(
    composition: Any, drone: Any
) -> None:
    """The drone was last seen at the pickup, and flew on out of contact."""
    instruction = await back_after_hours(composition, drone)
    async with composition.db.write() as tx:
        await tx.execute(
            text(
                "INSERT INTO custody SELECT delivery_id, package_id, 3, 'STATION', 'a', mission_id,"
                " at_ms FROM custody WHERE seq = 2"
            )
        )

    await composition.receive(late_hand_over(drone, instruction, after=timedelta(hours=1)))

    assert (await custodians(composition))[2:] == [("STATION", "a"), ("RECIPIENT", "c")]
    assert await composition.broken() == []


async def test_a_drone_that_refused_its_mission_takes_no_package_from_another(
    composition: Any, drone: Any, make: Any
) -> None:
    await composition.book()
    (refused,) = await composition.sent()
    await composition.receive(drone.ack(refused, "REJECTED", code="NOT_AT_START"))
    await composition.book(make.candidate(2), attempt=2)
    other = type(drone)(composition, drone_id="drn_2")
    (flown,) = await composition.sent("drn_2")
    pick_up, *_ = other.flown(flown)
    await composition.receive(other.ack(flown), pick_up)

    for _ in range(2):
        await composition.receive(late_hand_over(drone, refused, after=timedelta(hours=1)))

    assert await custodians(composition) == [("STATION", "a"), ("DRONE", "drn_2")]
    assert await alarm_codes(composition) == ["LATE_HAND_OVER"]
    assert await composition.broken() == []


def late_hand_over(drone: Any, instruction: Any, *, after: timedelta) -> Any:
    """The end of the delivery step, some time after the planned end of the loading."""
    loading = instruction.steps[0]
    step = next(each for each in instruction.steps if each.kind == "DELIVER")
    at = loading.planned_end_at + after
    (ended,) = drone.ended(
        instruction, [step.model_copy(update={"planned_start_at": at, "planned_end_at": at})]
    )
    message = ended.message.model_copy(update={"data": evidence_of(step, instruction.steps)})
    return replace(ended, message=message)


async def custodians(composition: Any) -> list[tuple[str, str]]:
    rows = await composition.rows("SELECT custodian_kind, custodian_id FROM custody ORDER BY seq")
    return [tuple(row) for row in rows]


async def alarm_codes(composition: Any) -> list[str]:
    alarms = (await composition("operator:op", "GET", "/v1/alarms")).json()["items"]
    return [each["code"] for each in alarms if each["code"] not in ("FLIES_ON", "MISSION_IN_DOUBT")]
