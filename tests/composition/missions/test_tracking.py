"""A delivery's track: ended, present and planned steps, and no flights for other customers."""

from typing import Any

import pytest

pytestmark = pytest.mark.databases("sqlite")

GATEWAY = "service:gateway"
TRACK = "/internal/deliveries/dlv_1/track"


async def booked(composition: Any) -> Any:
    await composition.book()
    (instruction,) = await composition.sent()
    return instruction


async def tracked(composition: Any) -> Any:
    answer = await composition(GATEWAY, "GET", TRACK)
    assert answer.status_code == 200, answer.text
    return answer.json()["missions"]


async def test_a_planned_mission_shows_its_way_to_the_last_delivery(composition: Any) -> None:
    await booked(composition)

    (mission,) = await tracked(composition)

    steps = mission["steps"]
    assert (steps[0]["kind"], steps[-1]["kind"]) == ("PICK_UP", "DELIVER")
    assert [step["package_ids"] for step in (steps[0], steps[-1])] == [["p1"], ["p1"]]
    assert {step["status"] for step in steps} == {"PLANNED"}
    assert (mission["position"], mission["soc"]) == (None, None)


async def test_each_step_shows_the_place_where_it_happens(composition: Any, make: Any) -> None:
    await booked(composition)

    (mission,) = await tracked(composition)

    flights = [step for step in mission["steps"] if step["kind"] == "FLY"]
    assert flights[0]["from_position"] == [0.0, 0.0]
    assert flights[0]["to_position"] == flights[1]["from_position"]
    delivered = mission["steps"][-1]
    assert delivered["station_id"] == "c"
    assert delivered["from_position"] == delivered["to_position"] == flights[-1]["to_position"]


async def test_ended_steps_show_their_real_times(composition: Any, drone: Any) -> None:
    instruction = await booked(composition)
    pick_up, fly, *_ = drone.flown(instruction)
    await composition.receive(drone.ack(instruction), pick_up, fly)

    (mission,) = await tracked(composition)

    assert [step["status"] for step in mission["steps"]][:3] == ["ENDED", "ENDED", "PLANNED"]
    assert mission["steps"][1]["end_at"] == fly.message.model_dump(mode="json")["ended_at"]


async def test_the_step_under_way_and_the_position_come_from_the_drones_state(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    state = {"mission_id": instruction.mission_id, "step_id": 2, "activity": "FLYING"}
    pick_up, *_ = drone.flown(instruction)
    drone.event_seq = 1
    await composition.receive(
        drone.ack(instruction),
        pick_up,
        drone.state(**state, station_id=None, position=(0.1, 0.0), soc=0.9),
    )

    (mission,) = await tracked(composition)

    assert [step["status"] for step in mission["steps"]][:3] == ["ENDED", "UNDER_WAY", "PLANNED"]
    assert (mission["position"], mission["soc"]) == ([0.1, 0.0], 0.9)


async def test_the_position_of_a_drone_on_its_way_home_is_hidden(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    flown = drone.flown(instruction)
    last = max(n for n, step in enumerate(instruction.steps, 1) if step.kind == "DELIVER")
    assert last < len(instruction.steps)
    drone.event_seq = last
    home = {"mission_id": instruction.mission_id, "step_id": last + 1, "activity": "FLYING"}
    await composition.receive(
        drone.ack(instruction),
        *flown[:last],
        drone.state(**home, station_id=None, position=(0.1, 0.0), soc=0.9),
    )

    (mission,) = await tracked(composition)

    assert (mission["position"], mission["soc"]) == (None, None)
    assert mission["steps"][-1]["kind"] == "DELIVER"


async def test_the_position_of_a_drone_on_another_mission_is_hidden(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    await composition.receive(
        drone.ack(instruction), *drone.flown(instruction), drone.state(mission_id="msn_other")
    )

    (mission,) = await tracked(composition)

    assert mission["position"] is None
    assert {step["status"] for step in mission["steps"]} == {"ENDED"}
    assert mission["steps"][-1]["kind"] == "DELIVER"


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_refused_mission_is_not_in_the_track(
    composition: Any, drone: Any, make: Any
) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.ack(instruction, "REJECTED", code="OVERWEIGHT"))
    await composition.book(make.candidate(2), attempt=2)

    (mission,) = await tracked(composition)

    assert mission["drone_id"] == "drn_2"


async def test_an_ended_mission_shows_no_planned_steps(composition: Any, drone: Any) -> None:
    instruction = await booked(composition)
    pick_up, *_ = drone.flown(instruction)
    drone.event_seq = 1
    ended = drone.event("MISSION_ENDED", mission_id=instruction.mission_id)
    await composition.receive(drone.ack(instruction), pick_up, ended)

    (mission,) = await tracked(composition)

    assert [step["kind"] for step in mission["steps"]] == ["PICK_UP"]


async def test_a_delivery_without_missions_has_an_empty_track(composition: Any) -> None:
    assert await tracked(composition) == []


async def test_only_services_may_read_tracks(composition: Any) -> None:
    for caller in ("operator:op", "customer:c", "provider:prv_1"):
        assert (await composition(caller, "GET", TRACK)).status_code == 403
