"""The judgement of a run: each flaw is found, and a run without flaws shows none."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import pytest
from skyway_lab.benchmarks.chaos.evidence import (
    Awaited,
    CustodyStep,
    Evidence,
    FinalAnswer,
    Received,
    Requested,
)
from skyway_lab.benchmarks.chaos.judgement import flaws_in

from skyway.contracts.delivery_event import DeliveryEvent, DeliveryEventType
from skyway.ids import DeliveryId, DroneId, EventId, MissionId, PackageId, StationId

AT = datetime(2026, 3, 1, tzinfo=UTC)
DELIVERY = DeliveryId("dlv_1")
P1 = PackageId("p1")
SHOP, HOME, ELSEWHERE = StationId("shop"), StationId("home"), StationId("elsewhere")

DELIVERED = ("delivery.requested", "delivery.planned", "package.delivered", "delivery.completed")


def make_events(
    *types: str, station_id: StationId = HOME, is_signed: bool = True
) -> list[Received]:
    return [
        Received(make_event(kind, number, station_id), at_s=float(number), is_signed=is_signed)
        for number, kind in enumerate(types, start=1)
    ]


def make_event(kind: str, sequence: int, station_id: StationId = HOME) -> DeliveryEvent:
    data = {"package_id": P1, "station_id": station_id} if kind == "package.delivered" else {}
    return DeliveryEvent(
        message_id=f"msg_{sequence}",
        sent_at=AT,
        event_id=EventId(f"evt_{sequence}"),
        type=DeliveryEventType(kind),
        delivery_id=DELIVERY,
        sequence=sequence,
        occurred_at=AT,
        data=data,
    )


def make_step(kind: Any = "DELIVER", drone: str = "drn_1", **changes: Any) -> CustodyStep:
    step = CustodyStep(
        drone_id=DroneId(drone),
        kind=kind,
        mission_id=MissionId(f"msn_{drone}"),
        delivery_id=DELIVERY,
        package_ids=(P1,),
        station_id=SHOP if kind == "PICK_UP" else HOME,
    )
    return replace(step, **changes)


def make_evidence(
    events: Sequence[Received] = (),
    *,
    steps: Sequence[CustodyStep] = (),
    state: str | None = "COMPLETED",
    **changes: Any,
) -> Evidence:
    evidence = Evidence(
        accepted={DELIVERY: Requested({P1: HOME})},
        streams={DELIVERY: events},
        webhooks={DELIVERY: events},
        journals=steps,
        answers={DELIVERY: FinalAnswer(state)},
    )
    return replace(evidence, **changes)


def make_good_evidence(**changes: Any) -> Evidence:
    steps = [make_step("PICK_UP"), make_step("DELIVER")]
    return make_evidence(make_events(*DELIVERED), steps=steps, **changes)


def kinds_in(evidence: Evidence) -> list[str]:
    return [flaw.kind for flaw in flaws_in(evidence)]


def test_a_delivery_that_was_flown_and_reported_has_no_flaw() -> None:
    assert flaws_in(make_good_evidence()) == []


def test_a_delivery_that_was_rejected_and_not_flown_has_no_flaw() -> None:
    events = make_events("delivery.requested", "delivery.rejected")

    assert flaws_in(make_evidence(events, state="REJECTED")) == []


def test_an_accepted_request_that_the_gateway_does_not_know_is_lost() -> None:
    assert "lost" in kinds_in(make_good_evidence(answers={DELIVERY: FinalAnswer(None)}))


def test_a_delivery_that_goes_on_after_the_quiet_time_is_a_flaw() -> None:
    evidence = make_evidence(make_events("delivery.requested"), state="IN_PROGRESS")

    assert set(kinds_in(evidence)) == {"not ended", "stream incomplete", "webhook incomplete"}


def make_awaited_evidence(**changes: Any) -> Evidence:
    return make_evidence(
        make_events("delivery.requested"),
        state="IN_PROGRESS",
        awaited={DELIVERY: Awaited(DroneId("drn_1"), "the drone has lost its journal")},
        **changes,
    )


def test_a_delivery_of_a_drone_without_its_journal_may_wait_for_an_operator() -> None:
    evidence = make_awaited_evidence(forgetful=frozenset({DroneId("drn_1")}))

    assert flaws_in(evidence) == []


def test_an_operator_is_not_asked_what_a_drone_knows() -> None:
    assert kinds_in(make_awaited_evidence()) == ["needless question"]


def test_a_delivery_that_no_answer_named_is_a_flaw() -> None:
    evidence = make_good_evidence(accepted={}, answers={})

    assert kinds_in(evidence) == ["not requested"]


def test_two_drones_that_deliver_one_package_are_a_flaw() -> None:
    steps = [make_step(drone=drone) for drone in ("drn_1", "drn_2")]
    evidence = make_evidence(make_events(*DELIVERED), steps=steps)

    [flaw] = flaws_in(evidence)
    assert flaw.kind == "delivered twice"
    assert "drn_1 in msn_drn_1 at home, drn_2 in msn_drn_2 at home" in flaw.seen


def test_a_package_that_is_loaded_twice_is_a_flaw() -> None:
    steps = [make_step("PICK_UP"), make_step("PICK_UP", drone="drn_2"), make_step()]

    assert kinds_in(make_evidence(make_events(*DELIVERED), steps=steps)) == ["loaded twice"]


def test_a_hand_over_that_the_customer_does_not_learn_of_is_a_flaw() -> None:
    events = make_events("delivery.requested", "delivery.cancelled")
    evidence = make_evidence(events, steps=[make_step()], state="CANCELLED")

    assert kinds_in(evidence) == ["delivery not reported", "wrong end"]


def test_a_reported_hand_over_that_no_drone_made_is_a_flaw() -> None:
    evidence = make_evidence(make_events(*DELIVERED), steps=[make_step("PICK_UP")])

    assert kinds_in(evidence) == ["delivery not flown", "wrong end"]


def test_a_hand_over_that_a_drone_is_not_sure_of_does_not_count() -> None:
    events = make_events("delivery.requested", "package.stranded", "delivery.failed")
    steps = [make_step("PICK_UP"), make_step(is_certain=False)]

    assert flaws_in(make_evidence(events, steps=steps, state="FAILED")) == []


@pytest.mark.parametrize(
    ("flown_to", "reported_at"), [(ELSEWHERE, HOME), (HOME, ELSEWHERE), (ELSEWHERE, ELSEWHERE)]
)
def test_a_hand_over_at_another_station_is_a_flaw(
    flown_to: StationId, reported_at: StationId
) -> None:
    steps = [make_step("PICK_UP"), make_step(station_id=flown_to)]
    evidence = make_evidence(make_events(*DELIVERED, station_id=reported_at), steps=steps)

    assert kinds_in(evidence) == ["wrong station"]


def test_a_last_event_that_differs_from_the_shown_state_is_a_flaw() -> None:
    events = make_events("delivery.requested", "delivery.rejected")

    assert kinds_in(make_evidence(events, state="CANCELLED")) == ["different end"]


def test_a_half_delivered_request_must_be_partially_completed() -> None:
    two = {DELIVERY: Requested({P1: HOME, PackageId("p2"): HOME})}

    assert kinds_in(make_good_evidence(accepted=two)) == ["wrong end"]
