"""Stories of interventions, from the request until the drone has flown the result."""

from datetime import timedelta
from typing import Any

import pytest

from skyway.contracts.flight_step import FlightStep

pytestmark = pytest.mark.databases("sqlite")


async def post(
    composition: Any, path: str, body: dict[str, Any], caller: str = "operator:op"
) -> Any:
    answer = await composition(caller, "POST", path, body)
    assert answer.is_success, answer.text
    return answer.json()


async def confirm(composition: Any, mission_id: str, **masses_kg: float) -> Any:
    packages = [{"package_id": name, "mass_kg": mass} for name, mass in masses_kg.items()]
    return await post(composition, f"/v1/missions/{mission_id}/loading", {"packages": packages})


async def give(composition: Any, mission_id: str, command: str, **members: Any) -> Any:
    body = {"command": command, "reason": "a crowd", **members}
    return await post(composition, f"/v1/missions/{mission_id}/commands", body)


async def cancel(composition: Any, *package_ids: str) -> Any:
    return await post(
        composition,
        "/internal/deliveries/dlv_1/cancellations",
        {"cancellation_id": "cnl_1", "package_ids": package_ids or None, "reason": "no need"},
        caller="service:gateway",
    )


async def planned_anew(composition: Any) -> Any:
    """Replan, and return the newest revision sent to the drone."""
    await composition.replanner.step()
    return [each for each in await composition.sent() if hasattr(each, "steps")][-1]


async def shown(composition: Any, mission_id: str) -> Any:
    return (await composition("operator:op", "GET", f"/v1/missions/{mission_id}")).json()


def kinds(steps: tuple[FlightStep, ...]) -> list[str]:
    return [step.kind for step in steps]


async def kept(composition: Any) -> list[tuple[str, str]]:
    rows = await composition.rows(
        "SELECT package_id, custodian_kind, custodian_id FROM custody ORDER BY package_id, seq"
    )
    return [(row.package_id, f"{row.custodian_kind} {row.custodian_id}") for row in rows]


async def test_after_the_confirmation_the_drone_gets_its_load_and_takes_off(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)
    await confirm(composition, instruction.mission_id, p1=0.42)

    revision = await planned_anew(composition)
    await composition.receive(drone.ack(revision))

    assert (revision.kind, revision.first_step) == ("MISSION", 2)
    assert [(each.package_id, each.mass_kg) for each in revision.loaded] == [("p1", 0.42)]
    progress = await shown(composition, instruction.mission_id)
    assert (progress["mission"]["loading"], progress["trouble"]) == ("CONFIRMED", None)
    assert await composition.broken() == []


async def test_a_delivery_cancelled_in_flight_is_returned(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    await begin.loaded(composition, drone, make)
    assert (await cancel(composition))["returning"] == ["p1"]

    revision = await planned_anew(composition)
    drone.event_seq = 1
    await composition.receive(drone.ack(revision), *drone.flown(revision))

    assert "RETURN" in kinds(revision.steps)
    assert "DELIVER" not in kinds(revision.steps)
    assert (await kept(composition))[-1] == ("p1", "STATION a")
    reports = await composition.reports()
    assert [each.kind for each in reports][-2:] == ["RETURNED", "ENDED"]
    assert await composition.broken() == []


async def test_one_package_of_two_comes_back_and_the_other_arrives(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    await begin.loaded(composition, drone, make, "b", "c")
    await cancel(composition, "p2")

    revision = await planned_anew(composition)
    drone.event_seq = 1
    await composition.receive(drone.ack(revision), *drone.flown(revision))

    last = dict(await kept(composition))
    assert last == {"p1": "RECIPIENT b", "p2": "STATION a"}
    assert await composition.broken() == []


async def test_packages_cancelled_during_the_take_off_instruction_come_back(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)
    await confirm(composition, instruction.mission_id, p1=0.4)
    planned = await planned_anew(composition)
    assert (await cancel(composition))["returning"] == ["p1"]

    await composition.receive(drone.ack(planned))

    progress = await shown(composition, instruction.mission_id)
    assert progress["mission"]["loading"] == "CONFIRMED"
    assert progress["trouble"]["code"] == "CANCELLED"
    pick_up, *_ = drone.flown(instruction)
    drone.event_seq = 1
    await composition.receive(
        pick_up, begin.standing(drone, instruction, activity="WAITING", step_id=2)
    )
    assert "RETURN" in kinds((await planned_anew(composition)).steps)


async def test_the_drone_avoids_a_closure_made_during_the_take_off_instruction(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)
    await confirm(composition, instruction.mission_id, p1=0.4)
    planned = await planned_anew(composition)
    await post(composition, "/v1/stations/c/closures", {"reason": "fire"})

    await composition.receive(drone.ack(planned))
    revision = await planned_anew(composition)

    assert [each.package_id for each in planned.loaded] == ["p1"]
    assert (revision.mission_revision, revision.loaded) == (3, None)
    assert "c" not in {each.to_id for each in revision.steps if each.kind == "FLY"}


async def test_a_closure_before_the_take_off_instruction_keeps_the_measured_load(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.at_pickup(composition, drone, make, "b", "c")
    await confirm(composition, instruction.mission_id, p1=0.4, p2=0.4)
    await post(composition, "/v1/stations/c/closures", {"reason": "fire"})

    planned = await planned_anew(composition)
    await composition.receive(drone.ack(planned))

    assert [each.package_id for each in planned.loaded] == ["p1", "p2"]
    progress = await shown(composition, instruction.mission_id)
    assert (progress["mission"]["loading"], progress["trouble"]) == ("CONFIRMED", None)


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_package_cancelled_in_time_is_not_loaded(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    await begin.accepted(composition, drone, make, "b", "c")
    await cancel(composition, "p2")

    revision = await planned_anew(composition)
    await composition.receive(drone.ack(revision), *drone.flown(revision))

    (pick_up,) = [step for step in revision.steps if step.kind == "PICK_UP"]
    assert [each.package_id for each in pick_up.packages] == ["p1"]
    assert dict(await kept(composition)) == {"p1": "RECIPIENT b", "p2": "STATION a"}
    assert await composition.broken() == []


async def test_a_cancelled_package_that_was_loaded_anyway_comes_back(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make, "b", "c")
    assert (await cancel(composition, "p2"))["returning"] == ["p2"]
    pick_up, *_ = drone.flown(instruction)
    drone.event_seq = 1
    composition.clock.advance(instruction.steps[0].planned_end_at - composition.clock.now())
    state = begin.standing(drone, instruction, activity="WAITING", step_id=2)
    await composition.receive(pick_up, state)

    revision = await planned_anew(composition)
    await composition.receive(drone.ack(revision), *drone.flown(revision))

    assert [where for package_id, where in await kept(composition) if package_id == "p2"] == [
        "STATION a",
        "DRONE drn_1",
        "STATION a",
    ]
    returned = [each for each in await composition.reports() if each.kind == "RETURNED"]
    assert [each.package_ids for each in returned] == [("p2",)]
    assert await composition.broken() == []


async def test_a_diverted_drone_lands_at_its_station_and_stays_there(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    await give(composition, instruction.mission_id, "DIVERT", station_id="b")

    revision = await planned_anew(composition)
    await composition.receive(drone.ack(revision))

    assert (revision.steps[-1].kind, revision.steps[-1].station_id) == ("WAIT", "b")
    assert revision.steps[-1].until_at > composition.clock.now() + timedelta(days=1)
    # A hold after the new steps would keep the drone from flying them.
    assert [each.kind for each in await composition.sent()] == ["HOLD"]
    assert {each.to_id for each in revision.steps if each.kind == "FLY"} == {"b"}
    progress = await shown(composition, instruction.mission_id)
    assert (progress["mission"]["is_held"], progress["trouble"]) == (True, None)


async def test_a_diverted_drone_delivers_after_a_resume(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    await give(composition, instruction.mission_id, "DIVERT", station_id="b")
    there = await planned_anew(composition)
    *flights, _, _ = drone.flown(there)
    drone.event_seq = 1 + len(flights)
    composition.clock.advance(timedelta(hours=2))
    at_b = {
        "mission_id": instruction.mission_id,
        "mission_revision": there.mission_revision,
        "activity": "WAITING",
        "station_id": "b",
        "step_id": there.steps[-1].step_id,
        "released_through": there.steps[-1].step_id,
        "package_ids": ["p1"],
        "soc": 0.6,
    }
    await composition.receive(drone.ack(there), *flights, drone.state(**at_b))

    await give(composition, instruction.mission_id, "RESUME")
    onward = await planned_anew(composition)
    await composition.receive(drone.ack(onward), *drone.flown(onward))

    assert dict(await kept(composition)) == {"p1": "RECIPIENT c"}
    assert await composition.state_of(instruction.mission_id) == "COMPLETED"
    assert await composition.broken() == []


async def test_a_drone_that_cannot_be_diverted_stays_held_with_its_packages(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    await post(composition, "/v1/stations/b/closures", {"reason": "fire"})
    await give(composition, instruction.mission_id, "DIVERT", station_id="c")

    await composition.replanner.step()

    progress = await shown(composition, instruction.mission_id)
    assert (progress["mission"]["state"], progress["mission"]["is_held"]) == ("ACTIVE", True)
    assert (progress["proposal"], progress["trouble"]["land_at"]) == (None, None)
    assert (await composition.sent())[-1].kind == "HOLD"
    alarms = (await composition("operator:op", "GET", "/v1/alarms")).json()["items"]
    assert [alarm["code"] for alarm in alarms] == ["DIVERSION_IMPOSSIBLE"]
    assert await composition.broken() == []

    # The next command is planned immediately.
    await give(composition, instruction.mission_id, "RESUME")
    assert (await planned_anew(composition)).mission_revision == 2
