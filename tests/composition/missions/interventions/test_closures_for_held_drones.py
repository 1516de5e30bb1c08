"""A held or diverted drone does not land at a station that has closed."""

from typing import Any

import pytest

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

#: With twice the scenario's battery a drone flies over a station, and lands at the one after it.
FOR_TWO_FLIGHTS_J = 1_800_000.0


async def post(composition: Any, path: str, body: dict[str, Any]) -> None:
    answer = await composition("operator:op", "POST", path, body)
    assert answer.is_success, answer.text


async def give(composition: Any, mission_id: str, command: str, **members: Any) -> None:
    body = {"command": command, "reason": "a crowd", **members}
    await post(composition, f"/v1/missions/{mission_id}/commands", body)


async def close(composition: Any, station_id: str) -> None:
    await post(composition, f"/v1/stations/{station_id}/closures", {"reason": "a storm"})


async def fly_over_b(composition: Any, drone: Any, make: Any) -> Any:
    """The instruction of a drone that flies over b, to land at c."""
    candidate = make.candidate()
    model = candidate.model.model_copy(update={"battery_j": FOR_TWO_FLIGHTS_J})
    await composition.book(candidate.model_copy(update={"model": model}), request=make.request("e"))
    (first,) = await composition.sent()
    pick_up = first.steps[0]
    composition.clock.advance(pick_up.planned_end_at - composition.clock.now())
    flying = drone.state(
        mission_id=first.mission_id,
        mission_revision=1,
        activity="FLYING",
        step_id=2,
        released_through=3,
        station_id=None,
        package_ids=("p1",),
    )
    await composition.receive(drone.ack(first), *drone.ended(first, [pick_up]), flying)
    return first


async def mission(composition: Any) -> Any:
    (listed,) = (await composition("operator:op", "GET", "/v1/missions")).json()["items"]
    path = f"/v1/missions/{listed['mission_id']}"
    return (await composition("operator:op", "GET", path)).json()


async def test_a_held_drone_lands_before_a_closed_station_and_waits(
    composition: Any, drone: Any, make: Any
) -> None:
    first = await fly_over_b(composition, drone, make)
    await give(composition, first.mission_id, "HOLD")
    await composition.receive(drone.ack((await composition.sent())[-1]))

    await close(composition, "c")
    await composition.replanner.step()

    (divert,) = await composition.sent()
    assert (divert.kind, divert.last_valid_step) == ("DIVERT", 2)
    assert [(each.kind, each.station_id) for each in divert.steps] == [("WAIT", "b")]
    await composition.receive(drone.ack(divert))
    progress = await mission(composition)
    assert (progress["mission"]["is_held"], progress["trouble"]) == (True, None)
    assert await composition.broken() == []


async def test_a_held_drone_with_an_open_landing_gets_no_new_plan(
    composition: Any, drone: Any, make: Any
) -> None:
    first = await fly_over_b(composition, drone, make)
    await give(composition, first.mission_id, "HOLD")
    await composition.receive(drone.ack((await composition.sent())[-1]))

    await close(composition, "d")
    await composition.replanner.step()

    assert await composition.sent() == []


async def test_a_diverted_drone_waits_at_the_nearest_station_if_its_target_closes(
    composition: Any, drone: Any, make: Any
) -> None:
    first = await fly_over_b(composition, drone, make)
    await give(composition, first.mission_id, "DIVERT", station_id="b")
    await composition.replanner.step()
    hold, divert = await composition.sent()
    assert [(each.kind, each.station_id) for each in divert.steps] == [("WAIT", "b")]

    # The drone has not answered yet.
    await close(composition, "b")
    await composition.receive(drone.ack(hold), drone.ack(divert))
    await composition.replanner.step()

    (another,) = await composition.sent()
    flight, wait = another.steps
    assert (another.kind, flight.kind, wait.kind) == ("DIVERT", "FLY", "WAIT")
    assert (flight.to_id, flight.lands) == (wait.station_id, True)
    assert await composition.broken() == []
