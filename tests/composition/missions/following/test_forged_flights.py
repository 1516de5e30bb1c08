"""A drone reports hand-overs that it cannot have made: nothing is delivered, and nobody is paid."""

from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
from pydantic import ValidationError

from skyway.contracts.topics import EVENTS
from tests.composition.drone_messages import EVIDENCE

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

OPERATOR = "operator:op"


def hand_over(drone: Any, instruction: Any, **members: Any) -> Any:
    """The end of the delivery step as an honest drone reports it, except for `members`."""
    step = next(each for each in instruction.steps if each.kind == "DELIVER")
    honest = {
        "mission_id": instruction.mission_id,
        "mission_revision": instruction.mission_revision,
        "step_id": step.step_id,
        "step_kind": "DELIVER",
        "started_at": step.planned_start_at,
        "ended_at": step.planned_end_at,
        "station_id": step.station_id,
        "package_ids": ("p1",),
        "data": EVIDENCE,
    }
    return drone.event("STEP_ENDED", **(honest | members))


def steps_before_delivery(instruction: Any) -> list[Any]:
    kinds = [each.kind for each in instruction.steps]
    return list(instruction.steps[: kinds.index("DELIVER")])


async def assert_disbelieved(composition: Any, instruction: Any, *, because: str) -> None:
    """The mission is in doubt, and neither its custody nor its reports show a delivery."""
    path = f"/v1/missions/{instruction.mission_id}"
    mission = (await composition(OPERATOR, "GET", path)).json()["mission"]
    assert mission["state"] == "ACTIVE"
    assert mission["doubt"]["code"] == "IMPLAUSIBLE"
    assert because in mission["doubt"]["detail"]
    assert "DELIVERED" not in {each.kind for each in await composition.reports()}
    custodians = await composition.rows("SELECT custodian_kind FROM custody ORDER BY seq")
    assert "RECIPIENT" not in {kind for (kind,) in custodians}
    alarms = (await composition("provider:prv_1", "GET", "/v1/alarms")).json()["items"]
    assert [each["code"] for each in alarms] == ["MISSION_IN_DOUBT"]
    assert alarms[0]["data"]["event"]["step_kind"] == "DELIVER"
    assert await composition.broken() == []


async def test_a_delivery_two_seconds_after_the_booking_is_not_believed(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    soon = composition.clock.now() + timedelta(seconds=2)
    for step in steps_before_delivery(instruction)[1:]:
        forged = step.model_copy(update={"planned_start_at": soon, "planned_end_at": soon})
        await composition.receive(*drone.ended(instruction, [forged]))

    await composition.receive(hand_over(drone, instruction, started_at=soon, ended_at=soon))

    await assert_disbelieved(composition, instruction, because="the drone needs at least")


async def test_a_delivery_before_the_flight_is_not_believed(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)

    await composition.receive(hand_over(drone, instruction))

    await assert_disbelieved(composition, instruction, because="(FLY) has not ended before")


@pytest.mark.parametrize("name", ["NaN", "Infinity", "1e999"])
def test_a_message_with_a_number_that_is_none_is_not_read(drone: Any, name: str) -> None:
    text = drone.event("ALARM", data={"load": [{"load_before_kg": 12345}]}).payload

    with pytest.raises(ValidationError):
        EVENTS.read(text.replace(b"12345", name.encode()))


async def test_steps_that_nothing_has_cut_are_not_believed(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    flight = next(each for each in instruction.steps if each.kind == "FLY")

    await composition.receive(*cut(drone, instruction, [flight]))

    doubt = (await composition(OPERATOR, "GET", path_of(instruction))).json()["mission"]["doubt"]
    assert (doubt["code"], "no later one was sent" in doubt["detail"]) == ("IMPLAUSIBLE", True)
    assert await composition.rows("SELECT * FROM cut_steps") == []


async def test_cut_flights_make_no_delivery_before_the_drone_can_be_there(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    await called_home(composition, instruction)
    flights = [each for each in steps_before_delivery(instruction) if each.kind != "PICK_UP"]
    soon = composition.clock.now() + timedelta(seconds=2)

    await composition.receive(
        *cut(drone, instruction, flights),
        hand_over(drone, instruction, started_at=soon, ended_at=soon),
    )

    await assert_disbelieved(composition, instruction, because="it was at a")


async def test_a_drone_that_was_diverted_delivers_later(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    await called_home(composition, instruction)
    flights = [each for each in steps_before_delivery(instruction) if each.kind != "PICK_UP"]

    await composition.receive(*cut(drone, instruction, flights), hand_over(drone, instruction))

    assert "DELIVERED" in {each.kind for each in await composition.reports()}
    assert await composition.broken() == []


@pytest.mark.parametrize("kind", ["STEP_ENDED", "STEP_FAILED"])
async def test_packages_that_were_never_loaded_are_not_delivered(
    composition: Any, drone: Any, make: Any, begin: Any, kind: str
) -> None:
    instruction = await begin.accepted(composition, drone, make)
    pick_up, *rest = steps_before_delivery(instruction)
    (ended,) = drone.ended(instruction, [pick_up])
    # Ended with a package that is not of the step, or failed.
    changes = {"event": kind, "package_ids": ("p9",)}
    not_loaded = replace(ended, message=ended.message.model_copy(update=changes))

    await composition.receive(not_loaded, *drone.ended(instruction, rest))
    await composition.receive(hand_over(drone, instruction))

    await assert_disbelieved(composition, instruction, because="none of p1 on board")


async def test_a_mission_does_not_end_or_fail_before_it_was_sent(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    long_ago = composition.clock.now() - timedelta(days=400)

    await composition.receive(
        drone.event("MISSION_ENDED", mission_id=instruction.mission_id, ended_at=long_ago)
    )

    doubt = (await composition(OPERATOR, "GET", path_of(instruction))).json()["mission"]["doubt"]
    assert doubt["detail"].startswith("the end of the mission cannot be true")


async def called_home(composition: Any, instruction: Any) -> None:
    """A RETURN_HOME is on its way to the drone, which has not answered."""
    command = {"command": "RETURN_HOME", "reason": "the customer has called"}
    await composition(OPERATOR, "POST", f"{path_of(instruction)}/commands", command)
    await composition.replanner.step()


def cut(drone: Any, instruction: Any, steps: list[Any]) -> list[Any]:
    """These steps, ended early two seconds from now."""
    soon = drone.composition.clock.now() + timedelta(seconds=2)
    times = {"planned_start_at": soon, "planned_end_at": soon}
    ended = drone.ended(instruction, [each.model_copy(update=times) for each in steps])
    return [
        replace(each, message=each.message.model_copy(update={"code": "CUT"})) for each in ended
    ]


def path_of(instruction: Any) -> str:
    return f"/v1/missions/{instruction.mission_id}"


async def test_a_flight_before_the_mission_was_sent_is_not_believed(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    flight = next(each for each in instruction.steps if each.kind == "FLY")

    await composition.receive(
        *drone.ended(instruction, [flight], late_by=-timedelta(hours=2)),
    )

    path = f"/v1/missions/{instruction.mission_id}"
    doubt = (await composition(OPERATOR, "GET", path)).json()["mission"]["doubt"]
    assert "the mission was sent at" in doubt["detail"]


@pytest.mark.parametrize(
    ("members", "because"),
    [
        ({"station_id": "a"}, "it is reported at a, not at "),
        ({"data": {}}, "it has no evidence"),
        ({"data": {"load_before_kg": 1.0, "load_after_kg": 1.0}}, "did not fall"),
        ({"data": {"load_before_kg": "1", "load_after_kg": None}}, "it has no evidence"),
        ({"data": {"load_before_kg": True, "load_after_kg": False}}, "it has no evidence"),
        ({"data": {"load_before_kg": 1.0, "load_after_kg": -1.0}}, "it has no evidence"),
        ({"data": {"load_before_kg": 10**400, "load_after_kg": 0}}, "it has no evidence"),
        ({"data": {"load_before_kg": 1.0, "load_after_kg": 0.999}}, "packages weigh 0.4 kg"),
        ({"data": {"load_before_kg": 3.0, "load_after_kg": 0.0}}, "packages weigh 0.4 kg"),
    ],
)
async def test_a_delivery_elsewhere_or_without_evidence_is_not_believed(
    composition: Any, drone: Any, make: Any, begin: Any, members: Any, because: str
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    flights = [each for each in steps_before_delivery(instruction) if each.kind != "PICK_UP"]
    await composition.receive(*drone.ended(instruction, flights))

    await composition.receive(hand_over(drone, instruction, **members))

    await assert_disbelieved(composition, instruction, because=because)


async def test_further_reports_of_a_drone_that_is_not_believed_change_nothing(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    await composition.receive(hand_over(drone, instruction))

    ended = drone.event(
        "MISSION_ENDED",
        mission_id=instruction.mission_id,
        ended_at=instruction.steps[-1].planned_end_at,
        station_id="b",
    )
    await composition.receive(hand_over(drone, instruction), ended, drone.state())

    await assert_disbelieved(composition, instruction, because="has not ended before")


async def test_an_operator_ends_the_mission_of_a_drone_that_is_not_believed(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    await composition.receive(hand_over(drone, instruction))

    answer = await composition(
        OPERATOR,
        "POST",
        f"/v1/missions/{instruction.mission_id}/commands",
        {"command": "GIVE_UP", "reason": "the drone never left the pickup"},
    )

    assert answer.status_code == 202, answer.text
    assert await composition.state_of(instruction.mission_id) == "ABORTED"
    assert await composition.broken() == []
