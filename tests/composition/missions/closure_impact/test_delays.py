"""The dry run of a closure says how much later the packages of the missions come."""

from datetime import timedelta
from typing import Any

import pytest

pytestmark = pytest.mark.databases("sqlite")

OPERATOR = "operator:op"

PATHS = ("/v1/stations/b/closures", "/v1/segments/a/b/closures", "/v1/ground-stops")


async def dry_run(composition: Any, path: str, **body: Any) -> Any:
    answer = await composition(OPERATOR, "POST", f"{path}?dry_run=true", {"reason": "fog", **body})
    assert answer.status_code == 200, answer.text
    return answer.json()


def end(composition: Any, hours: int) -> str:
    return str((composition.clock.now() + timedelta(hours=hours)).isoformat())


async def begin_loaded(composition: Any, drone: Any, make: Any) -> Any:
    """A mission to c whose drone has its package on board at a."""
    await composition.book(make.candidate(), request=make.request("c"))
    (instruction,) = await composition.sent()
    await composition.receive(drone.ack(instruction))
    composition.clock.advance(instruction.steps[0].planned_end_at - composition.clock.now())
    pick_up, *_ = drone.flown(instruction)
    drone.event_seq = 1
    on_board = drone.state(
        mission_id=instruction.mission_id,
        mission_revision=1,
        activity="WAITING",
        step_id=2,
        released_through=1,
        package_ids=["p1"],
    )
    await composition.receive(pick_up, on_board)
    return instruction


@pytest.mark.parametrize("path", PATHS)
async def test_a_closure_with_an_end_delays_packages_until_about_its_end(
    composition: Any, drone: Any, make: Any, path: str
) -> None:
    await begin_loaded(composition, drone, make)

    preview = await dry_run(composition, path, until=end(composition, 2))

    (hit,) = preview["affected_missions"]
    assert (hit["delay"]["plan"], hit["delay"]["code"]) == ("NEW_PLAN", None)
    assert 5_000 < hit["delay"]["later_by_s"] <= 7_200
    assert preview["missions_without_delay"] == 0


async def test_the_delay_is_that_of_the_plan_made_after_the_closure(
    composition: Any, drone: Any, make: Any
) -> None:
    instruction = await begin_loaded(composition, drone, make)
    body = {"until": end(composition, 2)}
    (hit,) = (await dry_run(composition, PATHS[0], **body))["affected_missions"]

    await composition(OPERATOR, "POST", PATHS[0], {"reason": "fog", **body})
    await composition.replanner.step()

    before = next(step for step in instruction.steps if step.kind == "DELIVER")
    after = next(step for step in (await composition.sent())[-1].steps if step.kind == "DELIVER")
    later_by = after.planned_end_at - before.planned_end_at
    assert hit["delay"]["later_by_s"] == pytest.approx(later_by.total_seconds(), abs=1)


async def test_packages_that_come_back_have_no_delay(
    composition: Any, drone: Any, make: Any
) -> None:
    await begin_loaded(composition, drone, make)

    (hit,) = (await dry_run(composition, "/v1/stations/c/closures"))["affected_missions"]

    assert (hit["delay"]["plan"], hit["delay"]["later_by_s"]) == ("NEW_PLAN", None)


async def test_a_ground_stop_without_an_end_is_named_as_the_reason(
    composition: Any, drone: Any, make: Any
) -> None:
    await begin_loaded(composition, drone, make)

    (hit,) = (await dry_run(composition, "/v1/ground-stops"))["affected_missions"]

    assert (hit["delay"]["plan"], hit["delay"]["code"]) == ("NO_PLAN_YET", "GROUND_STOP")
    assert hit["delay"]["later_by_s"] is None


async def test_a_dry_run_plans_for_the_first_missions_only(
    composition: Any, make: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("skyway_composition.missions.closure_impact.impact.MOST_PLANNED", 1)
    for number in (1, 2):
        await composition.book(make.candidate(number), delivery_id=f"dlv_{number}")

    preview = await dry_run(composition, PATHS[0])

    planned, unplanned = preview["affected_missions"]
    assert (planned["delay"]["plan"], planned["delay"]["code"]) == ("NO_PLAN_YET", "NOT_ANSWERED")
    assert unplanned["delay"] is None
    assert preview["missions_without_delay"] == 1
