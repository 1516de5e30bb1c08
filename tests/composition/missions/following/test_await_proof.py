"""A drone waits for the proofs of a hand-over; the gateway says which proofs are there."""

import asyncio
from datetime import timedelta
from typing import Any

import pytest

from skyway.contracts.flight_step import DeliverStep, ReturnStep

pytestmark = pytest.mark.databases("sqlite")

GATEWAY = "service:gateway"


def proven_request(make: Any, *methods: str | None, **limits: Any) -> Any:
    """One package for c by each method, None without a proof."""
    request = make.request(*("c" for _ in methods))
    packages = [
        {
            **each.model_dump(mode="json"),
            "dropoff_verification": method and {"method": method, **limits},
        }
        for each, method in zip(request.packages, methods, strict=True)
    ]
    return type(request).model_validate({**request.model_dump(mode="json"), "packages": packages})


async def landed(composition: Any, drone: Any, make: Any, request: Any) -> tuple[Any, DeliverStep]:
    """The instruction of a drone that stands at c, and its DELIVER."""
    await composition.book(make.candidate(), request=request)
    (instruction,) = await composition.sent()
    deliver = next(each for each in instruction.steps if isinstance(each, DeliverStep))
    before = instruction.steps[: deliver.step_id - 1]
    composition.clock.advance(before[-1].planned_end_at - composition.clock.now())
    await composition.receive(drone.ack(instruction), *drone.ended(instruction, before))
    return instruction, deliver


def said(drone: Any, event: str, instruction: Any, step: DeliverStep, **members: Any) -> Any:
    """An event of the drone about its DELIVER, which it began as planned."""
    about = {
        "mission_id": instruction.mission_id,
        "mission_revision": 1,
        "step_id": step.step_id,
        "step_kind": "DELIVER",
        "started_at": step.planned_start_at,
        "station_id": "c",
    }
    return drone.event(event, **about, **members)


def gave_up(drone: Any, instruction: Any, step: DeliverStep, **members: Any) -> Any:
    """The end of a wait after which only p2 was handed over."""
    evidence = {"load_before_kg": 0.8, "load_after_kg": 0.4}
    done = {"code": "RECIPIENT_ABSENT", "package_ids": ("p2",), "data": evidence, **members}
    return said(drone, "STEP_FAILED", instruction, step, **done)


async def awaited(composition: Any, drone: Any, make: Any, *methods: str | None) -> Any:
    """The same once the drone has said that it waits."""
    instruction, step = await landed(composition, drone, make, proven_request(make, *methods))
    await composition.receive(said(drone, "HAND_OVER_AWAITED", instruction, step))
    return instruction, step


async def give(composition: Any, package_id: str = "p1") -> Any:
    path = "/internal/deliveries/dlv_1/proofs"
    return await composition(GATEWAY, "POST", path, {"package_id": package_id})


async def last_report(composition: Any) -> Any:
    return (await composition.reports())[-1]


@pytest.mark.databases("sqlite", "postgresql")
async def test_the_gateway_learns_who_must_give_a_proof_and_until_when(
    composition: Any, drone: Any, make: Any
) -> None:
    _, step = await awaited(composition, drone, make, "PIN", None)

    report = await last_report(composition)
    assert (report.kind, report.package_ids, report.station_id) == ("PROOF_AWAITED", ("p1",), "c")
    assert report.until_at == step.planned_start_at + timedelta(seconds=300)
    assert await composition.broken() == []


@pytest.mark.databases("sqlite", "postgresql")
async def test_the_drone_is_instructed_when_a_proof_is_there(
    composition: Any, drone: Any, make: Any
) -> None:
    _, step = await awaited(composition, drone, make, "PIN", "SIGNATURE")

    answer = await give(composition, "p2")

    assert answer.status_code == 200
    sent = (await composition.sent())[-1]
    assert (sent.kind, sent.step_id, sent.package_ids) == ("HAND_OVER", step.step_id, ("p2",))
    assert sent.expires_at - step.planned_start_at > timedelta(seconds=299)


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_proof_that_is_given_again_is_not_sent_again(
    composition: Any, drone: Any, make: Any
) -> None:
    await awaited(composition, drone, make, "PIN")

    answers = await asyncio.gather(*(give(composition) for _ in range(4)))
    answers.append(await give(composition))

    assert len({answer.text for answer in answers}) == 1
    assert [each.kind for each in await composition.sent()] == ["HAND_OVER"]


@pytest.mark.parametrize("case", ["before the landing", "another package", "after the wait"])
async def test_a_proof_that_no_drone_waits_for_is_refused(
    composition: Any, drone: Any, make: Any, case: str
) -> None:
    if case == "before the landing":
        await landed(composition, drone, make, proven_request(make, "PIN"))
    else:
        await awaited(composition, drone, make, "PIN", None)
    if case == "after the wait":
        composition.clock.advance(timedelta(seconds=301))

    answer = await give(composition, "p2" if case == "another package" else "p1")

    assert (answer.status_code, answer.json()["code"]) == (409, "NOT_AWAITED")


async def test_a_proof_for_a_mission_that_is_over_is_refused(
    composition: Any, drone: Any, make: Any
) -> None:
    instruction, _ = await awaited(composition, drone, make, "PIN")
    away = drone.event("STEP_FAILED", mission_id=instruction.mission_id, position=(0.3, 0.0))
    await composition.receive(away)

    answer = await give(composition)

    assert (answer.status_code, answer.json()["code"]) == (409, "MISSION_OVER")


async def test_only_the_gateway_gives_proofs(composition: Any, drone: Any, make: Any) -> None:
    await awaited(composition, drone, make, "PIN")

    path = "/internal/deliveries/dlv_1/proofs"
    answer = await composition("operator:op", "POST", path, {"package_id": "p1"})

    assert answer.status_code == 403


async def test_a_proven_package_is_delivered(composition: Any, drone: Any, make: Any) -> None:
    instruction, step = await awaited(composition, drone, make, "PIN")
    await give(composition)

    await composition.receive(*drone.ended(instruction, [step]))

    report = await last_report(composition)
    assert (report.kind, report.package_ids) == ("DELIVERED", ("p1",))
    assert await composition.broken() == []


async def test_a_hand_over_without_its_proof_is_not_believed(
    composition: Any, drone: Any, make: Any
) -> None:
    instruction, step = await awaited(composition, drone, make, "PIN", "PIN")
    await give(composition, "p2")

    await composition.receive(*drone.ended(instruction, [step]))

    (alarm,) = (await composition("operator:op", "GET", "/v1/alarms")).json()["items"]
    assert alarm["code"] == "MISSION_IN_DOUBT"
    assert "no proof is there of p1" in alarm["detail"]
    assert "DELIVERED" not in [each.kind for each in await composition.reports()]
    assert await composition.broken() == []


async def test_what_has_its_proof_is_delivered_and_the_rest_goes_back(
    composition: Any, drone: Any, make: Any
) -> None:
    instruction, step = await awaited(composition, drone, make, "PIN", "PIN")
    await give(composition, "p2")
    composition.clock.advance(timedelta(seconds=330))
    await composition.receive(gave_up(drone, instruction, step))
    await composition.replanner.step()

    kinds = [(each.kind, each.package_ids) for each in await composition.reports()]
    assert [*kinds[-3:-1]] == [("DELIVERED", ("p2",)), ("RETURNING", ("p1",))]
    revision = (await composition.sent())[-1]
    (back,) = [each for each in revision.steps if isinstance(each, ReturnStep)]
    assert back.package_ids == ("p1",)
    assert await composition.broken() == []


async def test_a_failed_hand_over_of_a_package_without_proof_is_not_believed(
    composition: Any, drone: Any, make: Any
) -> None:
    instruction, step = await awaited(composition, drone, make, "PIN", "PIN")
    await composition.receive(gave_up(drone, instruction, step))

    (alarm,) = (await composition("operator:op", "GET", "/v1/alarms")).json()["items"]
    assert alarm["code"] == "MISSION_IN_DOUBT"


async def test_a_drone_that_waits_before_it_can_be_there_is_not_believed(
    composition: Any, drone: Any, make: Any
) -> None:
    instruction, step = await landed(composition, drone, make, proven_request(make, "PIN"))
    elsewhere = said(drone, "HAND_OVER_AWAITED", instruction, step)
    moved = elsewhere.message.model_copy(update={"station_id": "b"})

    await composition.receive(type(elsewhere)(elsewhere.topic, elsewhere.ids, moved, False))

    assert "PROOF_AWAITED" not in [each.kind for each in await composition.reports()]
    (alarm,) = (await composition("operator:op", "GET", "/v1/alarms")).json()["items"]
    assert alarm["code"] == "MISSION_IN_DOUBT"


async def test_a_wait_that_is_reported_again_changes_nothing(
    composition: Any, drone: Any, make: Any
) -> None:
    instruction, step = await awaited(composition, drone, make, "PIN")
    before = await composition.reports()

    await composition.receive(said(drone, "HAND_OVER_AWAITED", instruction, step))

    assert await composition.reports() == before


async def test_a_pin_of_the_keypad_goes_to_the_gateway_and_stays_nowhere_else(
    composition: Any, drone: Any, make: Any
) -> None:
    instruction, step = await awaited(composition, drone, make, "PIN", "PHOTO")

    await composition.receive(said(drone, "PIN_ENTERED", instruction, step, pin="4711"))

    report = await last_report(composition)
    assert (report.kind, report.package_ids, report.pin) == ("PIN_ENTERED", ("p1",), "4711")
    rows = await composition.rows("SELECT payload FROM outbox WHERE channel = 'gateway'")
    assert sum("4711" in str(row.payload) for row in rows) == 1
    for table in ("mission_steps", "cut_steps", "alarms", "drone_links", "quarantine", "proofs"):
        assert "4711" not in str(await composition.rows(f"SELECT * FROM {table}"))


async def test_the_quarantine_keeps_no_pin(composition: Any, drone: Any, make: Any) -> None:
    instruction, step = await awaited(composition, drone, make, "PIN")
    typed = said(drone, "PIN_ENTERED", instruction, step, pin="4711")

    composition.parts.quarantine.add(typed, "AHEAD", "it speaks of the future")
    await composition.parts.quarantine.step()

    ((payload,),) = await composition.rows("SELECT payload FROM quarantine")
    assert b'"pin":"***"' in bytes(payload)
    assert b"4711" not in bytes(payload)


async def test_a_pin_for_nobody_in_particular_is_not_passed_on(
    composition: Any, drone: Any, make: Any
) -> None:
    instruction, step = await awaited(composition, drone, make, "PIN", "PIN")

    await composition.receive(
        said(drone, "PIN_ENTERED", instruction, step, pin="1"),
        said(drone, "PIN_ENTERED", instruction, step, pin="2", package_ids=("p2",)),
    )

    entered = [each for each in await composition.reports() if each.kind == "PIN_ENTERED"]
    assert [(each.package_ids, each.pin) for each in entered] == [(("p2",), "2")]


async def test_a_drone_passes_on_ten_pins_for_a_package(
    composition: Any, drone: Any, make: Any
) -> None:
    instruction, step = await awaited(composition, drone, make, "PIN")

    for number in range(12):
        await composition.receive(said(drone, "PIN_ENTERED", instruction, step, pin=f"{number}"))

    entered = [each for each in await composition.reports() if each.kind == "PIN_ENTERED"]
    assert [each.pin for each in entered] == [f"{number}" for number in range(10)]


async def test_a_proof_that_comes_in_vain_raises_an_alarm(
    composition: Any, drone: Any, make: Any
) -> None:
    await awaited(composition, drone, make, "PIN")
    await give(composition)
    sent = (await composition.sent())[-1]

    await composition.receive(drone.ack(sent, "REJECTED", code="NOT_AWAITED"))

    (alarm,) = (await composition("operator:op", "GET", "/v1/alarms")).json()["items"]
    assert (alarm["code"], alarm["level"]) == ("PROOF_REFUSED", "WARNING")


async def test_plans_and_steps_count_the_time_of_a_proof(
    composition: Any, drone: Any, make: Any
) -> None:
    _, step = await landed(composition, drone, make, proven_request(make, "PIN", wait_s=45))

    assert step.planned_end_at - step.planned_start_at == timedelta(seconds=60)
    assert (step.dropoff_s, step.recipient_wait_s) == (30.0, 45.0)
    assert [(each.package_id, each.method) for each in step.verification] == [("p1", "PIN")]


@pytest.mark.parametrize("done", [("p2",), ()], ids=["one proof", "no proof"])
async def test_a_wait_that_ends_after_the_mission_was_given_up_delivers_what_is_proven(
    composition: Any, drone: Any, make: Any, done: tuple[str, ...]
) -> None:
    instruction, step = await awaited(composition, drone, make, "PIN", "PIN")
    await give(composition, "p2")
    composition.clock.advance(timedelta(hours=48))
    await composition.overdue.step()
    path = f"/v1/missions/{instruction.mission_id}/commands"
    command = {"command": "GIVE_UP", "reason": "nobody can find the drone"}
    assert (await composition("operator:op", "POST", path, command)).is_success

    ended = gave_up(drone, instruction, step, package_ids=done)
    await composition.receive(ended)

    recipients = "SELECT package_id FROM custody WHERE custodian_kind = 'RECIPIENT'"
    assert [row.package_id for row in await composition.rows(recipients)] == [*done]
    assert await composition.broken() == []


async def test_a_drone_that_is_not_believed_gets_no_proof(
    composition: Any, drone: Any, make: Any
) -> None:
    instruction, step = await awaited(composition, drone, make, "PIN")
    await composition.receive(*drone.ended(instruction, [step]))

    answer = await give(composition)

    assert (answer.status_code, answer.json()["code"]) == (409, "NOT_AWAITED")
