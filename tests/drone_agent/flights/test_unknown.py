"""A restart in the middle of a hand-over, with vehicles that do or do not know its result."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_drone_agent.simulated.vehicle import SimulatedVehicle
from skyway_drone_agent.vehicle import Outcome, StepRun

HAND_OVERS: list[str] = []


class Forgetful(SimulatedVehicle):
    """Does not know after a restart whether a hand-over was done; it counts hand-overs."""

    def recall(self, run: StepRun) -> bool | None:
        return None

    async def perform(self, run: StepRun) -> Outcome:
        if run.step.kind in ("PICK_UP", "DELIVER", "RETURN"):
            HAND_OVERS.append(run.step.kind)
        return await super().perform(run)


class Mindful(Forgetful):
    """Knows that the hand-over was done."""

    def recall(self, run: StepRun) -> bool | None:
        return True


async def die_in(world: Any, cloud: Any, trip: Any, activity: str) -> None:
    """Kill the agent in the middle of the step, and start it again."""
    HAND_OVERS.clear()
    await world.start()
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: bool(world.states) and world.states[-1].activity == activity)
    await world.kill()
    await world.pass_time(timedelta(seconds=5))
    await world.start()


@pytest.mark.parametrize(
    ("activity", "kind", "step_id"),
    [
        ("LOADING", "PICK_UP", 1),
        ("DELIVERING", "DELIVER", 4),
    ],
)
async def test_an_uncertain_hand_over_is_reported_as_unknown_and_not_repeated(
    world: Any, cloud: Any, trip: Any, activity: str, kind: str, step_id: int
) -> None:
    world.vehicle_type = Forgetful
    await die_in(world, cloud, trip, activity)
    await world.pass_time(timedelta(hours=3))

    failed = world.events[-1]
    assert (failed.event, failed.code, failed.step_id) == ("STEP_FAILED", "UNKNOWN", step_id)
    assert failed.station_id is not None
    assert HAND_OVERS.count(kind) == 1
    assert world.states[-1].activity == "WAITING"

    await world.kill()
    await world.start()
    await world.pass_time(timedelta(hours=3))
    assert (len(world.events), HAND_OVERS.count(kind)) == (step_id, 1)


async def test_a_package_that_may_be_on_board_is_brought_back(
    world: Any, cloud: Any, trip: Any, steps: Any
) -> None:
    world.vehicle_type = Forgetful
    await die_in(world, cloud, trip, "DELIVERING")
    await world.pass_until(lambda: world.events[-1].code == "UNKNOWN")
    assert world.states[-1].package_ids == ("p1", "p2")

    back = steps(at=world.clock.now(), first_step=5)
    back.fly("shop", "home", length_m=9_000, duration_s=600).bring_back("home", "p1", "p2")
    await world.send(cloud.mission(back.made, revision=2))
    await world.pass_until(lambda: world.is_over)

    assert world.states[-1].package_ids == ()


async def test_a_finished_hand_over_is_reported_and_not_repeated(
    world: Any, cloud: Any, trip: Any
) -> None:
    world.vehicle_type = Mindful
    await die_in(world, cloud, trip, "DELIVERING")
    await world.pass_until(lambda: world.is_over)

    assert [event.step_id for event in world.events] == [*range(1, 9), None]
    delivered = world.events[3]
    assert (delivered.code, delivered.package_ids) == (None, ("p1",))
    assert HAND_OVERS == ["PICK_UP", "DELIVER", "DELIVER"]


async def test_an_unfinished_hand_over_is_continued(world: Any, cloud: Any, trip: Any) -> None:
    await die_in(world, cloud, trip, "DELIVERING")
    await world.pass_until(lambda: world.is_over)

    delivered = world.events[3]
    assert delivered.ended_at - delivered.started_at == timedelta(seconds=30)


async def test_after_a_restart_the_drone_still_waits_for_the_loader(
    world: Any, cloud: Any, steps: Any
) -> None:
    world.vehicle_type = Mindful
    trip = steps().pick_up("home", awaits_confirmation=True, p1=1.0)
    trip.fly("home", "shop", length_m=6000, duration_s=430).deliver("shop", "p1")
    await die_in(world, cloud, trip.made, "LOADING")
    await world.pass_time(timedelta(hours=3))

    assert (world.events, world.states[-1].activity) == ([], "LOADING")
