"""What a drone refuses, what it takes, and in which order."""

from datetime import timedelta
from typing import Any

import pytest

from skyway.contracts.flight_step import PackageOnBoard
from skyway.contracts.instruction import RefusalCode
from skyway.ids import PackageId


def test_a_mission_the_drone_can_fly_is_accepted(desk: Any, trip: Any) -> None:
    answer = desk.send(desk.cloud.mission(trip))

    assert answer.status == "ACCEPTED"
    assert desk.received_ids == [answer.instruction_id]


def test_steps_that_do_not_follow_are_malformed(desk: Any, trip: Any) -> None:
    answer = desk.send(desk.cloud.mission([trip[0], *trip[2:]]))

    assert answer.code == RefusalCode.MALFORMED
    assert answer.detail == "step 1 is followed by step 3"


def test_an_unreadable_field_is_malformed_and_named(desk: Any, trip: Any) -> None:
    answer = desk.send_raw(
        desk.cloud.mission(trip), lambda raw: raw["steps"][1].update(length_m=-5)
    )

    assert answer.code == RefusalCode.MALFORMED
    assert "length_m" in str(answer.detail)


def test_a_kind_of_instruction_of_a_later_version_is_malformed(desk: Any, trip: Any) -> None:
    answer = desk.send_raw(desk.cloud.mission(trip), lambda raw: raw.update(kind="LOITER"))

    assert answer.code == RefusalCode.MALFORMED


def test_a_kind_of_step_of_a_later_version_is_unsupported(desk: Any, trip: Any) -> None:
    answer = desk.send_raw(
        desk.cloud.mission(trip), lambda raw: raw["steps"][3].update(kind="WINCH")
    )

    assert answer.code == RefusalCode.UNSUPPORTED_STEP


def test_an_instruction_without_identity_is_dropped(desk: Any) -> None:
    desk.inbox.handle({"kind": "MISSION"})

    assert desk.answers == []
    assert desk.journal.records == []


def test_an_expired_instruction_is_refused_and_uses_up_its_number(desk: Any, trip: Any) -> None:
    past = desk.clock.now() - timedelta(seconds=1)
    late = desk.send(desk.cloud.mission(trip, expires_at=past))
    next_one = desk.send(desk.cloud.mission(trip))

    assert late.code == RefusalCode.EXPIRED
    assert next_one.status == "ACCEPTED"


def test_a_second_mission_is_refused_while_one_is_not_over(desk: Any, trip: Any) -> None:
    desk.send(desk.cloud.mission(trip))

    answer = desk.send(desk.cloud.mission(trip, mission_id="msn_2"))

    assert answer.code == RefusalCode.OTHER_MISSION_ACTIVE
    assert answer.data == {"mission_id": "msn_1"}


def test_a_revision_that_is_not_newer_is_stale(desk: Any, trip: Any) -> None:
    desk.send(desk.cloud.mission(trip, revision=2))

    answer = desk.send(desk.cloud.mission(trip, revision=2))

    assert answer.code == RefusalCode.STALE_REVISION


def test_a_revision_of_a_mission_that_is_over_is_stale(desk: Any, trip: Any) -> None:
    desk.drone_is(ended_mission_ids=("msn_1",))

    answer = desk.send(desk.cloud.mission(trip, revision=2))

    assert answer.code == RefusalCode.STALE_REVISION


def test_a_mission_that_begins_elsewhere_is_refused(desk: Any, trip: Any) -> None:
    desk.drone_is(station_id="shop")

    answer = desk.send(desk.cloud.mission(trip))

    assert answer.code == RefusalCode.NOT_AT_START
    assert answer.data == {"station_id": "shop"}


def test_too_heavy_a_load_is_refused_with_its_limit(desk: Any, steps: Any) -> None:
    heavy = steps().pick_up("home", p1=1.5, p2=0.6)

    answer = desk.send(desk.cloud.mission(heavy.made))

    assert answer.code == RefusalCode.OVERWEIGHT
    assert answer.data["mass_kg"] == pytest.approx(2.1)
    assert answer.data["limit_kg"] == 2.0


def test_a_stretch_beyond_the_battery_is_refused_with_its_numbers(desk: Any, trip: Any) -> None:
    desk.drone_is(soc=0.35)

    answer = desk.send(desk.cloud.mission(trip))

    assert answer.code == RefusalCode.INSUFFICIENT_ENERGY
    assert answer.data["have_j"] == pytest.approx(0.25 * 360_000)
    assert answer.data["need_j"] == pytest.approx(2 * 400 * 100 * 1.25**1.5 + 1000)
    assert answer.data["step_id"] == 3


def test_a_plan_that_arrives_exactly_at_the_reserve_is_accepted(desk: Any, trip: Any) -> None:
    needed = (2 * 400 * 100 * 1.25**1.5 + 1000) / 360_000
    desk.drone_is(soc=0.1 + needed)

    assert desk.send(desk.cloud.mission(trip)).status == "ACCEPTED"


def test_a_gap_is_refused_without_end_and_then_filled(desk: Any, trip: Any) -> None:
    first, second = desk.cloud.report_request(0), desk.cloud.mission(trip)

    early = desk.send(second)
    assert (early.code, early.data["expected_seq"]) == (RefusalCode.SEQUENCE_GAP, 1)
    assert desk.journal.records == []

    assert desk.send(first).status == "ACCEPTED"
    assert desk.send(second).status == "ACCEPTED"


def test_a_duplicate_gets_the_same_answer_and_is_not_journaled(desk: Any, trip: Any) -> None:
    mission = desk.cloud.mission(trip)
    first = desk.send(mission)

    again = desk.send(mission)

    assert again == first
    assert len(desk.journal.records) == 1
    assert len(desk.received_ids) == 1


def test_a_refusal_is_repeated_too(desk: Any, trip: Any) -> None:
    desk.drone_is(station_id="shop")
    mission = desk.cloud.mission(trip)
    first = desk.send(mission)
    desk.drone_is(station_id="home")

    assert desk.send(mission) == first


def test_another_instruction_under_a_number_already_used_is_refused(desk: Any, trip: Any) -> None:
    desk.send(desk.cloud.report_request(0))

    answer = desk.send(desk.cloud.mission(trip, seq=1))

    assert answer.code == RefusalCode.STALE_REVISION
    assert desk.recorder.logbook.mission is None


def test_a_new_stream_begins_at_one_on_an_empty_journal(desk: Any, trip: Any) -> None:
    too_far_on = desk.send(desk.cloud.mission(trip, stream=3, seq=7))
    first = desk.send(desk.cloud.mission(trip, stream=3, seq=1))

    assert too_far_on.code == RefusalCode.SEQUENCE_GAP
    assert too_far_on.data["expected_seq"] == 1
    assert first.status == "ACCEPTED"
    assert (desk.recorder.logbook.stream, desk.recorder.logbook.last_instruction_seq) == (3, 1)


def test_an_earlier_stream_is_over(desk: Any, trip: Any) -> None:
    desk.send(desk.cloud.report_request(0, stream=3, seq=1))

    answer = desk.send(desk.cloud.mission(trip, stream=2, seq=2))

    assert answer.code == RefusalCode.STALE_REVISION


def test_a_report_request_has_events_sent_again(desk: Any) -> None:
    assert desk.send(desk.cloud.report_request(after_seq=5)).status == "ACCEPTED"

    assert desk.resent_after == [5]


def test_a_mission_that_has_not_begun_can_be_cancelled(desk: Any, trip: Any) -> None:
    desk.send(desk.cloud.mission(trip))

    desk.send(desk.cloud.cancel())

    assert desk.answers[-1].status == "ACCEPTED"
    assert desk.recorder.logbook.mission is None
    assert desk.send(desk.cloud.mission(trip, mission_id="msn_2")).status == "ACCEPTED"


def test_a_mission_that_has_begun_cannot_be_cancelled(desk: Any, trip: Any) -> None:
    desk.send(desk.cloud.mission(trip))
    mission = desk.recorder.logbook.mission
    assert mission is not None
    begun = {"released_through": 1, "began_at": desk.clock.now()}
    desk.drone_is(mission=mission.model_copy(update=begun))

    desk.send(desk.cloud.cancel())

    assert desk.answers[-1].code == RefusalCode.STEP_RELEASED
    assert desk.recorder.logbook.mission is not None


def test_a_drone_that_has_landed_is_called_off_while_it_carries_nothing(
    desk: Any, trip: Any
) -> None:
    desk.send(desk.cloud.mission(trip))
    mission = desk.recorder.logbook.mission
    assert mission is not None
    landed = mission.model_copy(update={"released_through": 1, "steps": tuple(trip[1:])})
    desk.drone_is(mission=landed, packages=trip[0].packages)

    desk.send(desk.cloud.cancel())
    assert desk.answers[-1].code == RefusalCode.STEP_RELEASED
    desk.drone_is(packages=())
    desk.send(desk.cloud.cancel())

    assert desk.answers[-1].status == "ACCEPTED"
    assert desk.recorder.logbook.mission is None


def test_a_mission_that_failed_can_be_called_off_and_the_next_one_flown(
    desk: Any, trip: Any
) -> None:
    desk.send(desk.cloud.mission(trip))
    mission = desk.recorder.logbook.mission
    assert mission is not None
    failed = mission.model_copy(update={"released_through": 1, "has_failed": True})
    desk.drone_is(
        mission=failed, packages=(PackageOnBoard(package_id=PackageId("p1"), mass_kg=1.0),)
    )

    desk.send(desk.cloud.cancel())

    assert desk.answers[-1].status == "ACCEPTED"
    assert desk.recorder.logbook.packages == ()
    assert desk.send(desk.cloud.mission(trip, mission_id="msn_2")).status == "ACCEPTED"


def test_a_cancel_of_another_mission_leaves_the_current_one(desk: Any, trip: Any) -> None:
    desk.send(desk.cloud.mission(trip))

    desk.send(desk.cloud.cancel(mission_id="msn_0"))

    assert desk.answers[-1].status == "ACCEPTED"
    assert desk.recorder.logbook.mission is not None
