"""A drone reports hand-overs that it cannot have made: nothing is delivered, and nobody is paid."""

from datetime import timedelta
from typing import Any

import pytest

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
