"""A mission that waits for the end of a closure goes on when the closure is lifted."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.calendar.commit import WorldChanged
from skyway_composition.missions.replanning import go_sooner
from skyway_composition.missions.replanning.find_plan import NoPlanYet, PlanFinder
from skyway_composition.missions.replanning.go_sooner import WaitingMissions
from skyway_composition.missions.replanning.situation import read_situation
from skyway_composition.missions.replanning.store import Waiting
from skyway_composition.missions.replanning.store import waiting as waiting_missions

from skyway.contracts.flight_step import FlyStep
from skyway.ids import DroneId, MissionId
from tests.composition.missions.replanning.failed_step import failed_at, stands_at_b

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

OPERATOR = "operator:op"
CLOSURES = "/v1/segments/b/c/closures"


async def close(composition: Any, *, hours: float) -> str:
    """Close the way from b to c for so long; returns the path of the closure."""
    until = composition.clock.now() + timedelta(hours=hours)
    body = {"until": until.isoformat()}
    made = await composition(OPERATOR, "POST", CLOSURES, body)
    assert made.status_code == 201, made.text
    return f"{CLOSURES}/{made.json()['closure_id']}"


async def waits_at_b(composition: Any, drone: Any) -> tuple[str, Any]:
    """A drone at b waits for the way to c; the path of the closure, and the drone's plan."""
    first = await failed_at(composition, drone, 4, "b", "BATTERY_SHORT", soc=0.6, detail="short")
    await composition.receive(stands_at_b(drone, first, released_through=4, soc=0.6))
    closure = await close(composition, hours=9)
    await composition.replanner.step()
    (plan,) = await composition.sent()
    assert departure(plan) > composition.clock.now() + timedelta(hours=8)
    await composition.receive(drone.ack(plan))
    return closure, plan


def departure(plan: Any) -> Any:
    """When the drone begins its first flight."""
    return next(each.planned_start_at for each in plan.steps if isinstance(each, FlyStep))


async def test_a_drone_that_waits_goes_on_when_the_closure_is_lifted(
    composition: Any, drone: Any
) -> None:
    closure, before = await waits_at_b(composition, drone)
    waiting = WaitingMissions(composition.parts)
    composition.clock.advance(timedelta(hours=2))
    await waiting.step()
    assert await composition.sent() == []

    await composition(OPERATOR, "DELETE", closure)
    await waiting.step()

    (after,) = await composition.sent()
    assert departure(after) < departure(before) - timedelta(hours=4)
    await composition.receive(drone.ack(after))
    await waiting.step()
    assert await composition.sent() == []
    replanned = [each for each in await composition.reports() if each.kind == "REPLANNED"]
    assert [each.code for each in replanned] == ["BATTERY_SHORT", "CONDITIONS_CHANGED"]
    assert await composition.broken() == []


async def test_a_drone_that_waits_keeps_its_plan_if_no_other_is_sooner(
    composition: Any, drone: Any
) -> None:
    await waits_at_b(composition, drone)
    waiting = WaitingMissions(composition.parts)

    other = await close(composition, hours=9)
    await waiting.step()
    await composition(OPERATOR, "DELETE", other)
    await waiting.step()

    assert await composition.sent() == []
    assert await composition.broken() == []


@pytest.mark.parametrize(
    ("place", "name", "answer"),
    [(go_sooner, "commit", WorldChanged()), (PlanFinder, "find", NoPlanYet("BUSY"))],
)
async def test_a_mission_that_gets_no_plan_yet_is_planned_again_at_the_next_look(
    composition: Any,
    drone: Any,
    monkeypatch: pytest.MonkeyPatch,
    place: object,
    name: str,
    answer: object,
) -> None:
    closure, _ = await waits_at_b(composition, drone)
    waiting = WaitingMissions(composition.parts)
    await composition(OPERATOR, "DELETE", closure)

    async def not_yet(*_: object) -> object:
        return answer

    with monkeypatch.context() as patched:
        patched.setattr(place, name, not_yet)
        await waiting.step()
    assert await composition.sent() == []
    await waiting.step()

    assert len(await composition.sent()) == 1


async def test_an_error_of_one_mission_does_not_keep_the_others_waiting(
    composition: Any, drone: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    closure, _ = await waits_at_b(composition, drone)
    waiting = WaitingMissions(composition.parts)
    await composition(OPERATOR, "DELETE", closure)

    async def with_a_broken_one(*given: Any, **named: Any) -> frozenset[Waiting]:
        broken = Waiting(MissionId(""), DroneId("broken"), 1, 0)
        return await waiting_missions(*given, **named) | {broken}

    async def read(context: Any, drone_id: DroneId) -> Any:
        if drone_id == "broken":
            raise ValueError(drone_id)
        return await read_situation(context, drone_id)

    monkeypatch.setattr(go_sooner, "waiting", with_a_broken_one)
    monkeypatch.setattr(go_sooner, "read_situation", read)
    with pytest.raises(ExceptionGroup, match="waiting missions not planned"):
        await waiting.step()

    assert len(await composition.sent()) == 1
