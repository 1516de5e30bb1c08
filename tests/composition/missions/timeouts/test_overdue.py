"""Missions of silent drones end only when the drones surely do not fly; others are in doubt."""

from datetime import timedelta
from typing import Any

import pytest

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

EXPIRY = timedelta(seconds=61)
ACK_ON_ITS_WAY = timedelta(seconds=10)


async def booked(composition: Any) -> Any:
    await composition.book()
    (instruction,) = await composition.sent()
    return instruction


async def doubt_of(composition: Any, instruction: Any) -> str | None:
    answer = await composition("operator:op", "GET", f"/v1/missions/{instruction.mission_id}")
    doubt = answer.json()["mission"]["doubt"]
    return None if doubt is None else str(doubt["code"])


async def no_shows(composition: Any) -> Any:
    return (await composition("operator:op", "GET", "/v1/stats/missions")).json()["no_shows"]


async def sweep_after(composition: Any, span: timedelta) -> None:
    composition.clock.advance(span)
    await composition.overdue.step()


async def test_an_expired_booking_of_a_disconnected_drone_is_given_up(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.connection("LOST"))

    await sweep_after(composition, EXPIRY + ACK_ON_ITS_WAY)

    (report,) = await composition.reports()
    assert (report.kind, report.code) == ("REFUSED", "NO_ANSWER")
    assert await composition.state_of(instruction.mission_id) == "REFUSED"
    assert await composition.reservations() == []
    assert await no_shows(composition) == {"prv_1": 1}


async def test_a_booking_is_kept_while_a_late_ack_may_still_arrive(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.connection("LOST"))

    await sweep_after(composition, EXPIRY)

    assert await composition.state_of(instruction.mission_id) == "BOOKED"
    await composition.receive(drone.ack(instruction))
    assert await composition.state_of(instruction.mission_id) == "ACCEPTED"


async def test_no_booking_is_given_up_before_its_instruction_expires(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.connection("LOST"))

    await sweep_after(composition, timedelta(seconds=59))

    assert await composition.state_of(instruction.mission_id) == "BOOKED"


async def test_an_expired_booking_of_a_silent_drone_is_kept_at_first(composition: Any) -> None:
    instruction = await booked(composition)

    await sweep_after(composition, EXPIRY)

    assert await composition.state_of(instruction.mission_id) == "BOOKED"


async def test_a_drone_that_reports_another_activity_after_the_expiry_is_free(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    composition.clock.advance(EXPIRY)
    await composition.receive(drone.state())

    await composition.overdue.step()

    assert await composition.state_of(instruction.mission_id) == "REFUSED"


async def test_a_state_from_before_the_expiry_does_not_free_the_drone(
    composition: Any, drone: Any
) -> None:
    """The instruction may reach the drone after this state, and the drone may load then."""
    instruction = await booked(composition)
    await composition.receive(drone.state())

    await sweep_after(composition, EXPIRY + ACK_ON_ITS_WAY)

    assert await composition.state_of(instruction.mission_id) == "BOOKED"


async def test_a_drone_that_flies_an_expired_booking_is_left_alone(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    composition.clock.advance(EXPIRY)
    await composition.receive(drone.state(mission_id=instruction.mission_id))

    await composition.overdue.step()

    assert await composition.state_of(instruction.mission_id) == "BOOKED"


async def test_an_unanswered_booking_waits_in_doubt_for_its_drone(composition: Any) -> None:
    instruction = await booked(composition)

    await sweep_after(composition, timedelta(days=1))

    assert await composition.state_of(instruction.mission_id) == "BOOKED"
    assert await doubt_of(composition, instruction) == "NO_ANSWER"
    (alarm,) = (await composition("operator:op", "GET", "/v1/alarms")).json()["items"]
    assert (alarm["code"], alarm["level"]) == ("MISSION_IN_DOUBT", "CRITICAL")
    (report,) = await composition.reports()
    assert (report.kind, report.activity) == ("ACTIVITY", "OUT_OF_CONTACT")


async def test_a_mission_is_put_in_doubt_once(composition: Any) -> None:
    await booked(composition)

    await sweep_after(composition, timedelta(days=1))
    await sweep_after(composition, timedelta(days=1))

    assert len(await composition.reports()) == 1


async def test_a_mission_of_a_long_silent_drone_keeps_its_packages_in_doubt(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    pick_up, *_ = drone.flown(instruction)
    await composition.receive(drone.ack(instruction), pick_up)

    await sweep_after(composition, timedelta(days=1))

    assert await composition.state_of(instruction.mission_id) == "ACTIVE"
    assert await doubt_of(composition, instruction) == "SILENT"
    assert await composition.reservations() != []
    assert await composition.broken() == []


async def test_a_lost_drone_proves_nothing_to_a_process_that_did_not_listen(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    composition.clock.advance(timedelta(seconds=1))
    composition.listening.begin()  # as after a restart
    await composition.receive(drone.connection("LOST"))

    await sweep_after(composition, EXPIRY + ACK_ON_ITS_WAY)

    assert await composition.state_of(instruction.mission_id) == "BOOKED"


async def test_a_mission_of_a_late_but_flying_drone_is_not_aborted(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.ack(instruction))
    composition.clock.advance(timedelta(days=1))
    await composition.receive(drone.state(mission_id=instruction.mission_id))

    await composition.overdue.step()

    assert await composition.state_of(instruction.mission_id) == "ACCEPTED"


async def test_a_drone_that_flies_a_given_up_mission_gets_repeated_cancels(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.connection("LOST"))
    await sweep_after(composition, EXPIRY + ACK_ON_ITS_WAY)
    flying = {"mission_id": instruction.mission_id, "mission_revision": 1}

    await composition.receive(drone.state(**flying))
    (_, first) = await composition.sent()
    await composition.receive(drone.state(**flying))
    await composition.receive(drone.ack(first, "REJECTED", code="STEP_RELEASED"))
    # The answer changes the drone's state: an immediate CANCEL would repeat without end.
    await composition.receive(drone.state(**flying))
    assert [each.kind for each in await composition.sent()] == ["MISSION"]
    composition.clock.advance(first.expires_at - composition.clock.now() + timedelta(seconds=1))
    await composition.receive(drone.state(**flying))

    *_, again = await composition.sent()
    assert (first.kind, again.kind) == ("CANCEL", "CANCEL")
    assert again.seq == first.seq + 1


async def test_a_state_with_an_unknown_mission_sends_no_cancel(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)

    await composition.receive(drone.state(mission_id="msn_of_nobody"))

    assert await composition.sent() == [instruction]


async def test_a_silent_drone_that_is_given_up_did_not_come(composition: Any, drone: Any) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.ack(instruction))
    await sweep_after(composition, timedelta(days=1))
    before = await no_shows(composition)

    await composition(
        "operator:op",
        "POST",
        f"/v1/missions/{instruction.mission_id}/commands",
        {"command": "GIVE_UP", "reason": "nobody has seen the drone"},
    )

    assert (before, await no_shows(composition)) == ({}, {"prv_1": 1})
    composition.clock.advance(timedelta(days=7, seconds=1))
    assert await no_shows(composition) == {}


async def test_a_drone_that_refuses_its_mission_has_come(composition: Any, drone: Any) -> None:
    instruction = await booked(composition)

    await composition.receive(
        drone.ack(instruction, "REJECTED", code="NOT_AT_START", detail="moved")
    )

    assert await composition.state_of(instruction.mission_id) == "REFUSED"
    assert await no_shows(composition) == {}
