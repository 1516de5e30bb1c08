"""Following drones whose messages come late, twice, out of order or not at all."""

from collections.abc import AsyncIterator
from dataclasses import dataclass, replace
from datetime import timedelta
from typing import Any

import pytest
from skyway_composition import alarm_store
from skyway_composition.missions.following.follow import Follower
from skyway_composition.tables import outbox

from skyway.contracts.topics import Topic
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.mqtt.client import Received
from skyway.runtime.sql.database import Database

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


@dataclass
class OneBatch:
    """`Subscriber` on which one batch arrives."""

    batch: list[Received[Any]]

    async def batches(self, *_: Topic[Any], **__: Any) -> AsyncIterator[list[Received[Any]]]:
        yield self.batch


def kinds(reports: list[Any]) -> list[str]:
    return [report.kind for report in reports]


async def booked(composition: Any) -> Any:
    """The instruction of a new mission."""
    await composition.book()
    (instruction,) = await composition.sent()
    return instruction


async def test_an_accepted_mission_is_reported_and_no_longer_sent(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)

    await composition.receive(drone.ack(instruction, "RECEIVED"), drone.ack(instruction))

    assert await composition.sent() == []
    assert kinds(await composition.reports()) == ["ACCEPTED"]
    assert kinds(await composition.reports("registry")) == ["ACCEPTED"]
    assert await composition.state_of(instruction.mission_id) == "ACCEPTED"


async def test_nothing_is_dropped_while_the_database_is_away(
    composition: Any, drone: Any, migrated_url: str
) -> None:
    instruction = await booked(composition)
    away = Database(migrated_url, outbox=outbox)
    parts = replace(composition.parts, db=away)
    follower = Follower(
        parts.handler,
        OneBatch([drone.ack(instruction)]),
        doorkeeper=parts.signatures,
        clock=composition.clock,
        quarantine=parts.quarantine,
        listening=parts.listening,
    )

    for _ in range(10):
        with pytest.raises(ServiceUnavailable):
            await follower.step()
    async with away:
        await follower.step()

    assert await composition.state_of(instruction.mission_id) == "ACCEPTED"


async def test_a_received_but_unanswered_mission_is_sent_again(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)

    await composition.receive(drone.ack(instruction, "RECEIVED"))

    assert await composition.sent() == [instruction]


async def test_an_ack_counts_once(composition: Any, drone: Any) -> None:
    instruction = await booked(composition)
    ack = drone.ack(instruction)

    await composition.receive(ack, ack)
    await composition.receive(drone.ack(instruction), drone.ack(instruction, "RECEIVED"))
    await composition.receive(drone.ack(instruction, "REJECTED", code="OVERWEIGHT"))

    assert kinds(await composition.reports()) == ["ACCEPTED"]
    assert await composition.state_of(instruction.mission_id) == "ACCEPTED"


async def test_a_refused_mission_frees_its_drone_and_pads(
    composition: Any, drone: Any, make: Any
) -> None:
    instruction = await booked(composition)

    await composition.receive(drone.ack(instruction, "REJECTED", code="OVERWEIGHT"))

    (report,) = await composition.reports()
    assert (report.kind, report.code, report.mission_state) == ("REFUSED", "OVERWEIGHT", "REFUSED")
    assert await composition.reservations() == []
    again = await composition.book(make.candidate(), attempt=2)
    assert again.outcome == "BOOKED"
    assert await composition.broken() == []


async def test_a_sequence_gap_does_not_refuse_the_mission(composition: Any, drone: Any) -> None:
    instruction = await booked(composition)

    await composition.receive(drone.ack(instruction, "REJECTED", code="SEQUENCE_GAP"))

    assert await composition.state_of(instruction.mission_id) == "BOOKED"
    assert await composition.sent() == [instruction]


async def test_a_whole_flight_is_reported_and_frees_drone_and_pads(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)

    await composition.receive(drone.ack(instruction))
    await composition.receive(*drone.flown(instruction))

    reports = await composition.reports()
    assert kinds(reports) == ["ACCEPTED", "LOADING", "LOADED", "DELIVERED", "ENDED"]
    assert [report.seq for report in reports] == [1, 2, 3, 4, 5]
    assert reports[2].package_ids == reports[3].package_ids == ("p1",)
    assert reports[4].mission_state == "COMPLETED"
    assert reports[4].data["flown"]["flight_s"] > 0
    assert await composition.reservations() == []
    assert await composition.broken() == []


async def test_a_package_passes_from_station_to_drone_to_recipient(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)

    await composition.receive(*drone.flown(instruction))

    chain = await composition.rows("SELECT seq, custodian_kind, custodian_id FROM custody")
    assert [tuple(row) for row in chain] == [
        (1, "STATION", "a"),
        (2, "DRONE", "drn_1"),
        (3, "RECIPIENT", "c"),
    ]


async def test_events_that_come_twice_count_once(composition: Any, drone: Any) -> None:
    instruction = await booked(composition)
    events = drone.flown(instruction)

    for _ in range(2):
        for event in events:
            await composition.receive(event, event)

    assert kinds(await composition.reports()) == [
        "ACCEPTED",
        "LOADING",
        "LOADED",
        "DELIVERED",
        "ENDED",
    ]


async def test_an_alarm_that_comes_twice_is_raised_once(composition: Any, drone: Any) -> None:
    alarm = drone.event("ALARM", code="GPS_LOST", level="CRITICAL")

    await composition.receive(alarm, alarm)
    await composition.receive(alarm)

    alarms = (await composition("operator:op", "GET", "/v1/alarms")).json()["items"]
    assert [each["code"] for each in alarms] == ["GPS_LOST"]


async def test_a_drone_that_raises_alarm_after_alarm_hides_no_others(
    composition: Any, drone: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(alarm_store, "MOST_OPEN_OF_DRONE", 3)
    other = replace(drone, drone_id="drn_2")

    for number in range(10):
        await composition.receive(drone.event("ALARM", detail=f"no. {number}", level="WARNING"))
    await composition.receive(drone.event("ALARM", code="GPS_LOST", level="CRITICAL"))
    await composition.receive(other.event("ALARM", code="GEOFENCE", level="WARNING"))

    alarms = (await composition("operator:op", "GET", "/v1/alarms")).json()["items"]
    shown = [(each["code"], each["detail"][:5]) for each in alarms]
    assert shown[:2] == [("GEOFENCE", "the d"), ("GPS_LOST", "the d")]
    assert shown[2:] == [("ALARM", f"no. {number}") for number in (2, 1, 0)]


async def test_a_provider_with_many_drones_hides_no_alarms_of_others(
    composition: Any, drone: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(alarm_store, "MOST_OPEN_OF_PROVIDER", 3)

    for number in range(5):
        own = replace(drone, drone_id=f"drn_{number}")
        await composition.receive(own.event("ALARM", code="GPS_LOST"))
    other = replace(drone, drone_id="drn_9", provider_id="prv_2")
    await composition.receive(other.event("ALARM", code="GPS_LOST"))

    alarms = (await composition("operator:op", "GET", "/v1/alarms")).json()["items"]
    assert [each["drone_id"] for each in alarms] == ["drn_9", "drn_2", "drn_1", "drn_0"]


@pytest.mark.parametrize(
    "code", ["SENDER_PUT_OUT", "FORGED_MESSAGES", "IMPLAUSIBLE", "DRONE_JUMPED", "SMOKE"]
)
async def test_a_drone_opens_no_alarm_with_a_code_of_ours(
    composition: Any, drone: Any, code: str
) -> None:
    await composition.receive(drone.event("ALARM", code=code, detail="look"))

    (alarm,) = (await composition("operator:op", "GET", "/v1/alarms")).json()["items"]
    assert (alarm["code"], alarm["detail"]) == ("ALARM", f"{code}: look")


async def test_a_missing_event_is_requested_before_later_ones_count(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.ack(instruction))
    pick_up, *others = drone.flown(instruction)

    await composition.receive(*others)

    (report,) = await composition.sent()
    assert (report.kind, report.events_after_seq, report.seq) == ("REPORT", 0, 2)
    assert kinds(await composition.reports()) == ["ACCEPTED"]
    await composition.receive(drone.ack(report), pick_up, *others)
    assert kinds(await composition.reports())[-1] == "ENDED"


async def test_missing_events_are_requested_again_only_after_a_while(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.ack(instruction))
    _, *others = drone.flown(instruction)

    await composition.receive(*others)
    await composition.receive(*others)
    asked_at_once = len(await composition.sent())
    composition.clock.advance(timedelta(seconds=6))
    await composition.receive(*others)

    assert (asked_at_once, len(await composition.sent())) == (1, 2)


async def test_a_state_with_a_higher_event_number_requests_the_missing_events(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.ack(instruction))

    await composition.receive(drone.state(last_event_seq=3, mission_id=instruction.mission_id))

    assert [sent.kind for sent in await composition.sent()] == ["REPORT"]


async def test_after_a_connect_events_of_drones_on_missions_are_requested(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.ack(instruction))

    await composition.handler.ask_live_drones(composition.listening.owns)

    assert [sent.kind for sent in await composition.sent()] == ["REPORT"]


async def test_an_older_state_changes_nothing(composition: Any, drone: Any) -> None:
    instruction = await booked(composition)
    older = drone.state(station_id="a")
    newer = drone.state(station_id="b")

    await composition.receive(newer, older)

    mission = await composition("operator:op", "GET", f"/v1/missions/{instruction.mission_id}")
    assert mission.json()["drone_state"]["station_id"] == "b"


async def test_the_last_will_of_an_old_connection_changes_nothing(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)

    await composition.receive(
        drone.connection("ONLINE", 1), drone.connection("ONLINE", 2), drone.connection("LOST", 1)
    )

    mission = await composition("operator:op", "GET", f"/v1/missions/{instruction.mission_id}")
    assert mission.json()["drone_connection"]["status"] == "ONLINE"


async def test_the_last_will_of_the_present_connection_counts(composition: Any, drone: Any) -> None:
    instruction = await booked(composition)

    await composition.receive(drone.connection("ONLINE", 1), drone.connection("LOST", 1))

    mission = await composition("operator:op", "GET", f"/v1/missions/{instruction.mission_id}")
    assert mission.json()["drone_connection"]["status"] == "LOST"


async def test_messages_under_another_providers_name_are_dropped(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    drone.provider_id = "prv_2"

    await composition.receive(drone.ack(instruction), *drone.flown(instruction))

    assert await composition.reports() == []
    assert await composition.sent() == [instruction]


async def test_each_activity_with_packages_on_board_is_reported_once(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    pick_up, *_ = drone.flown(instruction)
    drone.event_seq = 1
    flying = {"mission_id": instruction.mission_id, "activity": "FLYING", "step_id": 2}

    await composition.receive(drone.ack(instruction), pick_up)
    await composition.receive(drone.state(**flying), drone.state(**flying))
    await composition.receive(drone.state(**flying | {"activity": "RECHARGING", "station_id": "b"}))

    reports = [report for report in await composition.reports() if report.kind == "ACTIVITY"]
    assert [(report.activity, report.station_id) for report in reports] == [
        ("FLYING", "a"),
        ("RECHARGING", "b"),
    ]


async def test_a_late_drone_changes_the_arrival_times(composition: Any, drone: Any) -> None:
    booking = await composition.book()
    (instruction,) = await composition.sent()
    to_recharge, last_flight = instruction.steps[:3], instruction.steps[3]
    late = timedelta(seconds=90)

    await composition.receive(
        *drone.ended(instruction, to_recharge),
        *drone.ended(instruction, [last_flight], late_by=late, soc=0.75),
    )

    (delayed,) = [report for report in await composition.reports() if report.etas]
    (planned,) = booking.missions[0].packages
    assert abs(delayed.etas[0].eta_at - planned.eta_at - late) < timedelta(seconds=1)


async def test_a_drone_with_an_empty_journal_gets_its_mission_in_a_new_stream(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.ack(instruction, "RECEIVED"))
    drone.session, drone.stream = 2, 0

    await composition.receive(drone.state())

    (again,) = await composition.sent()
    assert (again.stream, again.seq) == (2, 1)
    assert again.steps == instruction.steps
    drone.stream = 2
    await composition.receive(drone.ack(again))
    assert await composition.state_of(instruction.mission_id) == "ACCEPTED"
    assert await composition.broken() == []


async def test_a_state_before_the_first_instruction_opens_no_new_stream(
    composition: Any, drone: Any
) -> None:
    drone.stream = 0
    early = drone.state()
    instruction = await booked(composition)
    drone.stream = 1
    await composition.receive(drone.ack(instruction, "RECEIVED"))

    await composition.receive(early)

    assert await composition.sent() == [instruction]


async def test_a_drone_with_a_higher_stream_number_gets_a_stream_after_it(
    composition: Any, drone: Any
) -> None:
    drone.stream, drone.event_seq = 7, 41
    await composition.receive(drone.state(last_instruction_seq=3))

    instruction = await booked(composition)

    assert (instruction.stream, instruction.seq) == (8, 1)
    assert instruction.events_confirmed_seq == 41


async def test_a_drone_that_accepts_too_late_gets_a_cancel(composition: Any, drone: Any) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.connection("LOST"))
    composition.clock.advance(timedelta(minutes=2))
    await composition.overdue.step()

    await composition.receive(drone.ack(instruction))

    (cancel,) = await composition.sent()
    assert (cancel.kind, cancel.mission_id, cancel.seq) == ("CANCEL", instruction.mission_id, 2)


async def test_an_old_event_does_not_reset_the_newest_event_number(
    composition: Any, drone: Any
) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.ack(instruction))
    first, second, third, *_ = drone.flown(instruction)

    await composition.receive(first, second, first, third)

    assert await composition.sent() == []
    (link,) = await composition.rows("SELECT last_event_seq FROM drone_links")
    assert link.last_event_seq == 3


async def test_a_refusal_after_the_acceptance_changes_nothing(composition: Any, drone: Any) -> None:
    instruction = await booked(composition)
    await composition.receive(drone.state(), drone.ack(instruction))

    await composition.receive(drone.ack(instruction, "REJECTED", code="EXPIRED"))

    mission = await composition("operator:op", "GET", f"/v1/missions/{instruction.mission_id}")
    assert mission.json()["waits_for_revision"] is None
