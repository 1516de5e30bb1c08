"""Operators and failsafes: a command waits for a failsafe unless it overrides the failsafe."""

from datetime import timedelta
from typing import Any

import pytest

from skyway.contracts.flight_step import FlyStep

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

OPERATOR = "operator:op"
ESCAPE = {"fault": "BATTERY_SHORT", "failsafe": "DIVERT", "station_id": "a"}


async def give(composition: Any, mission_id: str, command: str, **members: Any) -> Any:
    body = {"command": command, "reason": "a crowd", **members}
    return await composition(OPERATOR, "POST", f"/v1/missions/{mission_id}/commands", body)


async def flying(composition: Any, drone: Any, make: Any, begin: Any, **members: Any) -> Any:
    """The instruction of a drone on its first flight, with an active failsafe if one is given."""
    instruction = await begin.loaded(composition, drone, make)
    await composition.receive(in_flight(drone, instruction, **members))
    return instruction


def in_flight(drone: Any, instruction: Any, **members: Any) -> Any:
    first = next(each for each in instruction.steps if isinstance(each, FlyStep))
    values = {
        "mission_id": instruction.mission_id,
        "mission_revision": instruction.mission_revision,
        "activity": "FLYING",
        "step_id": first.step_id,
        "released_through": first.step_id,
        "station_id": None,
        "package_ids": ("p1",),
        "position": first.from_position,
        **members,
    }
    return drone.state(**values)


async def with_steps(composition: Any) -> list[Any]:
    return [each for each in await composition.sent() if hasattr(each, "steps")]


@pytest.mark.parametrize("command", ["HOLD", "RESUME", "CANCEL"])
async def test_only_commands_with_new_steps_can_override_a_failsafe(
    composition: Any, drone: Any, make: Any, begin: Any, command: str
) -> None:
    instruction = await flying(composition, drone, make, begin)

    answer = await give(composition, instruction.mission_id, command, overrides_failsafe=True)

    assert answer.status_code == 422


async def test_a_command_waits_for_a_failsafe_and_the_answer_says_so(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await flying(composition, drone, make, begin, failsafe=ESCAPE)

    answer = await give(composition, instruction.mission_id, "RETURN_HOME")
    await composition.replanner.step()

    assert answer.json()["waits_for"] == ESCAPE
    assert await with_steps(composition) == []


async def test_a_waiting_command_is_carried_out_after_the_failsafe(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await flying(composition, drone, make, begin, failsafe=ESCAPE)
    await give(composition, instruction.mission_id, "DIVERT", station_id="b")
    landed = drone.event(
        "STEP_FAILED",
        mission_id=instruction.mission_id,
        mission_revision=1,
        step_id=2,
        station_id="a",
        soc=0.9,
        code="BATTERY_SHORT",
    )

    await composition.receive(landed)
    await composition.replanner.step()

    (revision,) = await with_steps(composition)
    flights = [each.to_id for each in revision.steps if isinstance(each, FlyStep)]
    assert (flights, revision.steps[-1].kind) == (["b"], "WAIT")


@pytest.mark.parametrize(
    ("command", "members"), [("RETURN_HOME", {}), ("DIVERT", {"station_id": "b"})]
)
async def test_a_command_that_overrides_the_failsafe_is_sent_immediately(
    composition: Any, drone: Any, make: Any, begin: Any, command: str, members: Any
) -> None:
    instruction = await flying(composition, drone, make, begin, failsafe=ESCAPE)

    answer = await give(
        composition, instruction.mission_id, command, overrides_failsafe=True, **members
    )
    await composition.replanner.step()

    assert answer.json()["waits_for"] is None
    (sent,) = await with_steps(composition)
    assert (sent.kind, sent.overrides_failsafe, sent.last_valid_step) == (command, True, 2)
    assert await composition.broken() == []


async def test_a_refused_command_raises_an_alarm_and_is_tried_again(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await flying(composition, drone, make, begin)
    await give(composition, instruction.mission_id, "RETURN_HOME")
    await composition.replanner.step()
    (sent,) = await with_steps(composition)

    # The failsafe began before the instruction arrived.
    await composition.receive(
        in_flight(drone, instruction, failsafe=ESCAPE),
        drone.ack(sent, "REJECTED", code="FAILSAFE_ACTIVE"),
    )
    composition.clock.advance(timedelta(seconds=3))
    await composition.replanner.step()
    (alarm,) = (await composition(OPERATOR, "GET", "/v1/alarms")).json()["items"]
    waiting = await with_steps(composition)
    await composition.receive(in_flight(drone, instruction))
    composition.clock.advance(timedelta(seconds=3))
    await composition.replanner.step()

    assert (alarm["code"], alarm["level"]) == ("FAILSAFE_ACTIVE", "WARNING")
    assert "DIVERT for BATTERY_SHORT" in alarm["detail"]
    assert waiting == []
    (again,) = await with_steps(composition)
    assert (again.kind, again.mission_revision) == ("RETURN_HOME", sent.mission_revision + 1)


async def test_a_failsafe_that_cannot_be_overridden_is_tried_once(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    down = {"fault": "BATTERY_EMPTY", "failsafe": "LAND_NOW", "station_id": None}
    instruction = await flying(composition, drone, make, begin, failsafe=down)
    await give(composition, instruction.mission_id, "RETURN_HOME", overrides_failsafe=True)
    await composition.replanner.step()
    (sent,) = await with_steps(composition)

    await composition.receive(drone.ack(sent, "REJECTED", code="FAILSAFE_ACTIVE"))
    composition.clock.advance(timedelta(seconds=3))
    await composition.replanner.step()

    assert await with_steps(composition) == []


async def test_a_drone_is_called_home_once(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await flying(composition, drone, make, begin)

    answers = [await give(composition, instruction.mission_id, "RETURN_HOME")]
    answers.append(await give(composition, instruction.mission_id, "RETURN_HOME"))
    await composition.replanner.step()
    answers.append(await give(composition, instruction.mission_id, "RETURN_HOME"))
    (sent,) = await with_steps(composition)
    await composition.receive(drone.ack(sent))
    answers.append(await give(composition, instruction.mission_id, "RETURN_HOME"))

    assert [each.status_code for each in answers] == [202, 409, 409, 409]
    assert answers[-1].json()["type"].endswith("ALREADY_CALLED_HOME") or (
        "ALREADY_CALLED_HOME" in answers[-1].text
    )
