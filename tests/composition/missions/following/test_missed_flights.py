"""A drone flies its whole mission while composition is away: no second drone may fly it."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

OPERATOR = "operator:op"
JOURNAL = 1


async def booked(composition: Any, drone: Any) -> Any:
    """The instruction of a mission of a drone that has sent a state before."""
    drone.stream = 0
    await composition.receive(drone.state(journal_session=JOURNAL))
    await composition.book()
    (instruction,) = await composition.sent()
    drone.stream = instruction.stream
    return instruction


async def flown_unnoticed(composition: Any, drone: Any) -> tuple[Any, list[Any]]:
    """A mission that its drone has flown while composition was away, and the unread events."""
    instruction = await booked(composition, drone)
    composition.clock.advance(timedelta(hours=12))
    composition.listening.begin()  # composition was restarted
    return instruction, drone.flown(instruction)


async def doubt_of(composition: Any, instruction: Any) -> str | None:
    answer = await composition(OPERATOR, "GET", f"/v1/missions/{instruction.mission_id}")
    doubt = answer.json()["mission"]["doubt"]
    return None if doubt is None else str(doubt["code"])


async def give_up(composition: Any, instruction: Any) -> Any:
    return await composition(
        OPERATOR,
        "POST",
        f"/v1/missions/{instruction.mission_id}/commands",
        {"command": "GIVE_UP", "reason": "the package is still at the pickup"},
    )


async def custodians(composition: Any) -> list[tuple[str, str]]:
    rows = await composition.rows("SELECT custodian_kind, mission_id FROM custody ORDER BY seq")
    return [tuple(row) for row in rows]


@pytest.mark.parametrize("rate", [1.0, 60.0, 600.0])
async def test_an_idle_drone_with_unread_events_keeps_its_mission_until_they_are_read(
    composition: Any, drone: Any, rate: float
) -> None:
    composition.clock.rate = rate
    instruction, events = await flown_unnoticed(composition, drone)

    await composition.receive(drone.state(journal_session=JOURNAL))
    await composition.overdue.step()

    assert await composition.state_of(instruction.mission_id) == "BOOKED"
    report_request = (await composition.sent())[-1]
    assert (report_request.kind, report_request.events_after_seq) == ("REPORT", 0)

    await composition.receive(*events)

    assert await composition.state_of(instruction.mission_id) == "COMPLETED"
    mission_id = instruction.mission_id
    assert await custodians(composition) == [
        ("STATION", mission_id),
        ("DRONE", mission_id),
        ("RECIPIENT", mission_id),
    ]
    assert await composition.broken() == []


async def test_the_same_attempt_books_no_other_drone_meanwhile(
    composition: Any, drone: Any, make: Any
) -> None:
    instruction, _ = await flown_unnoticed(composition, drone)
    await composition.receive(drone.state(journal_session=JOURNAL))
    await composition.overdue.step()

    again = await composition.book(make.candidate(1), make.candidate(2))

    assert [each.mission_id for each in again.missions] == [instruction.mission_id]


async def test_a_drone_that_went_offline_with_unread_events_leaves_its_mission_in_doubt(
    composition: Any, drone: Any
) -> None:
    instruction, _ = await flown_unnoticed(composition, drone)
    await composition.receive(drone.state(journal_session=JOURNAL), drone.connection("OFFLINE"))

    composition.clock.advance(timedelta(hours=1))
    await composition.overdue.step()

    assert await composition.state_of(instruction.mission_id) == "BOOKED"
    assert await doubt_of(composition, instruction) == "NO_ANSWER"


async def test_events_end_the_doubt(composition: Any, drone: Any) -> None:
    instruction, events = await flown_unnoticed(composition, drone)
    await composition.overdue.step()
    assert await doubt_of(composition, instruction) == "NO_ANSWER"

    await composition.receive(*events[:1])

    assert await doubt_of(composition, instruction) is None
    assert "LOADED" in [each.kind for each in await composition.reports()]


async def test_a_drone_that_lost_its_journal_after_the_flight_leaves_its_mission_in_doubt(
    composition: Any, drone: Any
) -> None:
    instruction, _ = await flown_unnoticed(composition, drone)
    drone.session, drone.stream, drone.event_seq = 2, 0, 0

    await composition.receive(drone.state(journal_session=JOURNAL + 1))
    await composition.overdue.step()

    assert await composition.state_of(instruction.mission_id) == "BOOKED"
    assert await doubt_of(composition, instruction) == "JOURNAL_LOST"
    # The instruction is withdrawn: the drone would fly the mission a second time.
    assert await composition.sent() == []
    assert await composition.broken() == []


async def test_a_restarted_drone_with_its_journal_proves_that_it_did_not_fly(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition, drone)
    composition.clock.advance(timedelta(hours=12))
    drone.session, drone.stream = 2, 0

    await composition.receive(drone.state(journal_session=JOURNAL))
    await composition.overdue.step()

    assert await composition.state_of(instruction.mission_id) == "REFUSED"


async def test_a_journal_lost_before_the_loading_gets_the_mission_again(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition, drone)
    await composition.receive(drone.ack(instruction, "RECEIVED"))
    drone.session, drone.stream = 2, 0

    await composition.receive(drone.state(journal_session=JOURNAL + 1))

    (again,) = await composition.sent()
    assert (again.stream, again.steps) == (2, instruction.steps)


@pytest.mark.parametrize("stream", [0, 1])
async def test_a_journal_lost_after_a_possible_hand_over_leaves_the_mission_in_doubt(
    composition: Any, drone: Any, stream: int
) -> None:
    """The drone shows our stream if it got an instruction before it sent its first state."""
    instruction = await booked(composition, drone)
    pick_up, *_ = drone.flown(instruction)
    drone.event_seq = 1
    await composition.receive(drone.ack(instruction), pick_up)
    composition.clock.advance(timedelta(hours=12))
    drone.session, drone.stream, drone.event_seq = 2, stream, 0

    await composition.receive(drone.state(journal_session=JOURNAL + 1))

    assert await composition.state_of(instruction.mission_id) == "ACTIVE"
    assert await doubt_of(composition, instruction) == "JOURNAL_LOST"


async def test_a_late_mission_in_doubt_is_not_reported_as_replanned(
    composition: Any, drone: Any
) -> None:
    """Customers would no longer see that its drone is out of contact."""
    instruction = await booked(composition, drone)
    pick_up, *_ = drone.flown(instruction)
    drone.event_seq = 1
    await composition.receive(drone.ack(instruction), pick_up)
    composition.clock.advance(timedelta(hours=12))
    drone.session, drone.stream, drone.event_seq = 2, 0, 0
    await composition.receive(drone.state(journal_session=JOURNAL + 1))

    composition.clock.advance(timedelta(hours=1))
    await composition.late_missions.step()

    last = (await composition.reports())[-1]
    assert (last.kind, last.activity) == ("ACTIVITY", "OUT_OF_CONTACT")


async def test_the_events_of_a_new_journal_count_from_one(composition: Any, drone: Any) -> None:
    """The drone restarts without its journal, and accepts a mission before it sends a state."""
    first = await booked(composition, drone)
    await composition.receive(
        drone.ack(first), *drone.flown(first), drone.state(journal_session=JOURNAL)
    )
    await composition.book(delivery_id="dlv_2")
    second = (await composition.sent())[-1]
    drone.session, drone.event_seq = 2, 0

    await composition.receive(drone.ack(second))
    state = drone.state(journal_session=JOURNAL + 1, mission_id=second.mission_id)
    await composition.receive(state)
    await composition.receive(*drone.flown(second))

    assert await composition.state_of(second.mission_id) == "COMPLETED"


async def test_a_refusal_by_a_drone_with_unread_events_does_not_end_the_mission(
    composition: Any, drone: Any
) -> None:
    instruction, events = await flown_unnoticed(composition, drone)
    await composition.receive(drone.state(journal_session=JOURNAL))

    await composition.receive(drone.ack(instruction, "REJECTED", code="EXPIRED"))

    assert await composition.state_of(instruction.mission_id) == "BOOKED"
    await composition.receive(*events)
    assert await composition.state_of(instruction.mission_id) == "COMPLETED"


async def test_a_cancellation_is_too_late_while_events_are_unread(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition, drone)
    drone.event_seq = 1
    await composition.receive(drone.state(journal_session=JOURNAL))

    answer = await composition(
        "service:gateway",
        "POST",
        f"/internal/deliveries/{instruction.delivery_id}/cancellations",
        {"cancellation_id": "c1", "reason": "changed my mind"},
    )

    assert answer.json()["released"] == []


async def test_an_operator_gives_up_a_mission_in_doubt(composition: Any, drone: Any) -> None:
    instruction, _ = await flown_unnoticed(composition, drone)
    await composition.overdue.step()

    answer = await give_up(composition, instruction)

    assert answer.status_code == 202, answer.text
    assert await composition.state_of(instruction.mission_id) == "REFUSED"
    assert await composition.reservations() == []
    assert await composition.broken() == []


async def test_a_mission_without_doubt_cannot_be_given_up(composition: Any, drone: Any) -> None:
    instruction = await booked(composition, drone)

    answer = await give_up(composition, instruction)

    assert (answer.status_code, answer.json()["code"]) == (409, "NOT_IN_DOUBT")


async def test_a_hand_over_after_the_mission_was_given_up_raises_an_alarm(
    composition: Any, drone: Any
) -> None:
    instruction, events = await flown_unnoticed(composition, drone)
    await composition.overdue.step()
    await give_up(composition, instruction)

    await composition.receive(*events)

    alarms = (await composition(OPERATOR, "GET", "/v1/alarms")).json()["items"]
    (alarm,) = [each for each in alarms if each["code"] == "LATE_HAND_OVER"]
    assert alarm["data"]["package_ids"] == ["p1"]
    assert "by the ledger it had none of them" in alarm["detail"]
    assert [kind for kind, _ in await custodians(composition)] == ["STATION"]
    assert await composition.broken() == []


@pytest.mark.parametrize(
    "forged",
    [
        {"station_id": "e"},
        {"step_id": 99},
        {"package_ids": ("p9",)},
        {"data": {}},
        {"started_at": datetime(2026, 1, 1, tzinfo=UTC)},
    ],
    ids=["elsewhere", "no such step", "another package", "no evidence", "before it was sent"],
)
async def test_a_late_hand_over_that_cannot_be_true_changes_no_custody(
    composition: Any, drone: Any, forged: dict[str, object]
) -> None:
    instruction, events = await flown_unnoticed(composition, drone)
    await composition.overdue.step()
    await give_up(composition, instruction)
    before = await custodians(composition)

    for event in events:
        is_hand_over = event.message.step_kind == "DELIVER"
        changed = event.message.model_copy(update=forged if is_hand_over else {})
        await composition.receive(replace(event, message=changed))

    alarms = (await composition(OPERATOR, "GET", "/v1/alarms")).json()["items"]
    assert "IMPLAUSIBLE" in [each["code"] for each in alarms]
    assert await custodians(composition) == before
    assert await composition.broken() == []
