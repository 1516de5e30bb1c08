"""Only operators may hold, resume, divert, call home and cancel."""

from dataclasses import replace
from functools import partial
from typing import Any

import pytest
from skyway_composition.planning.solver_pool import SolverPool

from tests.composition.missions.replanning.failed_step import failed_at

pytestmark = pytest.mark.databases("sqlite")


async def give(
    composition: Any, mission_id: str, command: str, *, caller: str = "operator:op", **members: Any
) -> Any:
    body = {"command": command, "reason": "a crowd below", **members}
    return await composition(caller, "POST", f"/v1/missions/{mission_id}/commands", body)


async def shown(composition: Any, mission_id: str) -> Any:
    return (await composition("operator:op", "GET", f"/v1/missions/{mission_id}")).json()


async def test_a_hold_is_sent_to_the_drone(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)

    answer = await give(composition, instruction.mission_id, "HOLD")

    assert answer.status_code == 202
    hold = (await composition.sent())[-1]
    assert (hold.kind, hold.mission_id) == ("HOLD", instruction.mission_id)
    assert (hold.reason, hold.mission_revision) == ("a crowd below", 1)
    assert answer.json()["instruction_id"] == hold.instruction_id
    assert (await shown(composition, instruction.mission_id))["mission"]["is_held"]
    assert await composition.broken() == []


async def test_a_mission_whose_drone_refuses_to_hold_is_not_shown_as_held(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)
    await give(composition, instruction.mission_id, "HOLD")
    hold = (await composition.sent())[-1]

    await composition.receive(drone.ack(hold, "REJECTED", code="EXPIRED"))

    assert not (await shown(composition, instruction.mission_id))["mission"]["is_held"]
    (alarm,) = (await composition("operator:op", "GET", "/v1/alarms")).json()["items"]
    assert (alarm["code"], alarm["mission_id"]) == ("HOLD_REFUSED", instruction.mission_id)


class HoldingSolver(SolverPool):
    """An operator holds the mission while a plan is made for it."""

    def __init__(self, composition: Any, mission_id: str) -> None:
        super().__init__(threads=1, time_limit_s=30.0)
        self._hold = partial(give, composition, mission_id, "HOLD")
        self._is_held = False

    async def compose(self, *arguments: Any, **options: Any) -> Any:
        if not self._is_held:
            self._is_held = True
            assert (await self._hold()).status_code == 202
        return await super().compose(*arguments, **options)


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_plan_in_progress_does_not_end_a_hold(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    mission_id = instruction.mission_id
    await composition.receive(
        drone.event("ALARM", mission_id=mission_id, code="PLAN_WANTED", detail="head wind")
    )

    async with HoldingSolver(composition, mission_id) as solver:
        replanner = replace(composition.replanner, context=composition.parts.planning_with(solver))
        for _ in range(2):
            await replanner.step()

    assert [each.kind for each in await composition.sent()] == ["HOLD"]
    assert (await shown(composition, mission_id))["mission"]["is_held"]


async def test_a_resumed_drone_gets_a_resume_and_another_plan(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)
    await give(composition, instruction.mission_id, "HOLD")

    answer = await give(composition, instruction.mission_id, "RESUME")

    assert answer.status_code == 202
    assert (await composition.sent())[-1].kind == "RESUME"
    progress = await shown(composition, instruction.mission_id)
    assert not progress["mission"]["is_held"]
    assert progress["trouble"]["code"] == "HELD_UP"


@pytest.mark.parametrize(
    ("commands", "code"),
    [(("RESUME",), "NOT_HELD"), (("HOLD", "HOLD"), "ALREADY_HELD")],
)
async def test_a_command_must_fit_the_mission(
    composition: Any, drone: Any, make: Any, begin: Any, commands: tuple[str, ...], code: str
) -> None:
    instruction = await begin.accepted(composition, drone, make)

    answers = [await give(composition, instruction.mission_id, each) for each in commands]

    assert (answers[-1].status_code, answers[-1].json()["code"]) == (409, code)


async def test_a_diverted_drone_holds_immediately_and_again_at_its_landing(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)

    answer = await give(composition, instruction.mission_id, "DIVERT", station_id="b")

    assert answer.status_code == 202
    assert (await composition.sent())[-1].instruction_id == answer.json()["instruction_id"]
    progress = await shown(composition, instruction.mission_id)
    assert (progress["trouble"]["code"], progress["trouble"]["land_at"]) == ("DIVERTED", "b")
    assert progress["mission"]["is_held"]


async def test_resuming_ends_a_diversion(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    await give(composition, instruction.mission_id, "DIVERT", station_id="b")

    await give(composition, instruction.mission_id, "RESUME")

    progress = await shown(composition, instruction.mission_id)
    assert (progress["trouble"]["code"], progress["trouble"]["land_at"]) == ("HELD_UP", None)


@pytest.mark.parametrize(
    ("command", "members"),
    [
        ("DIVERT", {}),
        ("DIVERT", {"station_id": "nowhere"}),
        ("HOLD", {"station_id": "b"}),
        ("LAND", {}),
        ("HOLD", {"reason": ""}),
    ],
)
async def test_a_command_with_missing_or_extra_fields_is_refused(
    composition: Any,
    drone: Any,
    make: Any,
    begin: Any,
    command: str,
    members: dict[str, str],
) -> None:
    instruction = await begin.accepted(composition, drone, make)

    answer = await give(composition, instruction.mission_id, command, **members)

    assert answer.status_code == 422
    assert (await shown(composition, instruction.mission_id))["trouble"] is None


async def test_a_drone_called_home_brings_back_what_is_on_board(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make, "b", "c")

    answer = await give(composition, instruction.mission_id, "RETURN_HOME")

    assert (answer.status_code, answer.json()["instruction_id"]) == (202, None)
    progress = await shown(composition, instruction.mission_id)
    assert progress["trouble"]["code"] == "CALLED_HOME"
    assert [(aim["package_id"], aim["station_id"], aim["kind"]) for aim in progress["aims"]] == [
        ("p1", "a", "RETURN"),
        ("p2", "a", "RETURN"),
    ]
    (report,) = [each for each in await composition.reports() if each.kind == "RETURNING"]
    assert (report.package_ids, report.code) == (("p1", "p2"), "CALLED_HOME")


async def test_an_empty_drone_is_not_called_home(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)

    answer = await give(composition, instruction.mission_id, "RETURN_HOME")

    assert (answer.status_code, answer.json()["code"]) == (409, "NOTHING_ON_BOARD")


async def test_a_mission_cancelled_before_loading_is_over(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)

    answer = await give(composition, instruction.mission_id, "CANCEL")
    call_off = (await composition.sent())[-1]
    await composition.receive(drone.ack(call_off))

    assert (answer.status_code, call_off.kind) == (202, "CANCEL")
    assert await composition.state_of(instruction.mission_id) == "CANCELLED"
    report = (await composition.reports())[-1]
    assert (report.kind, report.code) == ("ENDED", "CANCELLED_BY_OPERATOR")
    assert await composition.reservations() == []


async def test_a_mission_cancelled_with_packages_on_board_brings_them_back(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)

    answer = await give(composition, instruction.mission_id, "CANCEL")

    assert answer.status_code == 202
    progress = await shown(composition, instruction.mission_id)
    assert progress["mission"]["state"] == "ACTIVE"
    assert progress["trouble"]["code"] == "CANCELLED_BY_OPERATOR"
    assert [aim["kind"] for aim in progress["aims"]] == ["RETURN"]


async def test_a_mission_on_its_way_home_is_not_cancelled(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make, "b")
    delivered = next(s.step_id for s in instruction.steps if s.kind == "DELIVER")
    events = drone.flown(instruction)[:delivered]
    drone.event_seq = delivered
    await composition.receive(*events)

    answer = await give(composition, instruction.mission_id, "CANCEL")

    assert (answer.status_code, answer.json()["code"]) == (409, "TOO_LATE")


@pytest.mark.parametrize("command", ["HOLD", "RESUME", "RETURN_HOME", "CANCEL"])
async def test_a_command_to_an_ended_mission_is_refused(
    composition: Any, drone: Any, make: Any, begin: Any, command: str
) -> None:
    instruction = await begin.accepted(composition, drone, make)
    await composition.receive(*drone.flown(instruction))

    answer = await give(composition, instruction.mission_id, command)

    assert (answer.status_code, answer.json()["code"]) == (409, "MISSION_OVER")


async def test_a_command_during_a_confirmed_loading_is_refused(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)
    body = {"packages": [{"package_id": "p1", "mass_kg": 0.4}]}
    path = f"/v1/missions/{instruction.mission_id}/loading"
    await composition("operator:op", "POST", path, body)

    answer = await give(composition, instruction.mission_id, "HOLD")

    assert (answer.status_code, answer.json()["code"]) == (409, "BEING_LOADED")


async def test_only_operators_may_command(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)

    answers = [
        await give(composition, instruction.mission_id, "HOLD", caller=caller)
        for caller in ("provider:prv_1", "customer:c")
    ]
    unknown = await give(composition, "msn_0", "HOLD")

    assert [each.status_code for each in (*answers, unknown)] == [403, 403, 404]
    assert not (await shown(composition, instruction.mission_id))["mission"]["is_held"]


async def test_an_operators_command_does_not_wait_because_the_drone_has_too_little_energy(
    composition: Any, drone: Any
) -> None:
    first = await failed_at(composition, drone, 4, "b", "INSUFFICIENT_ENERGY", soc=0.6)
    await composition.replanner.step()
    *_, revision = await composition.sent()
    answer = await give(composition, first.mission_id, "RETURN_HOME")
    assert answer.status_code == 202, answer.text

    refusal = drone.ack(revision, status="REJECTED", code="INSUFFICIENT_ENERGY")
    await composition.receive(refusal)
    await composition.replanner.step()

    *_, obeyed = await composition.sent()
    assert obeyed.mission_revision > revision.mission_revision
