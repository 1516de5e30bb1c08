"""Mission reports: each is applied once, in order, with one event for each change."""

import asyncio
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest

from skyway.delivery.request import DeliveryRequest
from tests.gateway.whole_gateway import Gateway


async def _reports(gateway: Gateway, delivery_id: str, *kinds: str, first: int = 1) -> None:
    for seq, kind in enumerate(kinds, start=first):
        answer = await gateway.report(delivery_id, kind, seq=seq)
        assert answer.status_code == 204, answer.text


async def test_a_delivery_goes_from_dispatch_to_its_last_package(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.planned(packages=2)

    async def state() -> str:
        return str((await gateway.get(delivery_id))["state"])

    await gateway.report(delivery_id, "ACCEPTED", seq=1)
    assert await state() == "DISPATCHED"
    await gateway.report(delivery_id, "LOADING", seq=2)
    assert await state() == "LOADING"
    await gateway.report(
        delivery_id, "LOADED", seq=3, package_ids=["p1", "p2"], station_id="san-marcos"
    )
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "IN_PROGRESS"
    assert [package["state"] for package in delivery["packages"]] == ["LOADED", "LOADED"]
    assert delivery["packages"][0]["custodian"] == {"kind": "DRONE", "id": "drn_1"}

    await gateway.report(delivery_id, "ACTIVITY", seq=4, activity="FLYING")
    delivery = await gateway.get(delivery_id)
    assert delivery["activity"] == "FLYING"
    assert [package["state"] for package in delivery["packages"]] == ["IN_TRANSIT"] * 2

    gateway.clock.advance(timedelta(minutes=11))
    first_at = gateway.clock.now()
    await gateway.report(
        delivery_id,
        "DELIVERED",
        seq=5,
        package_ids=["p1"],
        station_id="mcqueeney",
        data={"weight_kg": 0.5},
    )
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "IN_PROGRESS"
    assert delivery["packages"][0]["state"] == "DELIVERED"
    assert delivery["packages"][0]["custodian"] == {"kind": "RECIPIENT", "id": "mcqueeney"}

    gateway.clock.advance(timedelta(minutes=10))
    await gateway.report(delivery_id, "DELIVERED", seq=6, package_ids=["p2"])
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "COMPLETED"
    assert delivery["activity"] is None

    # The way home does not concern the customer.
    await gateway.report(delivery_id, "ACTIVITY", seq=7, activity="FLYING")
    await gateway.report(delivery_id, "ENDED", seq=8)
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "COMPLETED"
    assert delivery["missions"][0]["state"] == "COMPLETED"

    events = await gateway.events(delivery_id)
    assert [event["type"] for event in events] == [
        "delivery.requested",
        "delivery.planned",
        "delivery.dispatched",
        "delivery.loaded",
        "delivery.started",
        "package.delivered",
        "package.delivered",
        "delivery.completed",
    ]
    handed_over = events[5]["data"]
    assert handed_over["package_id"] == "p1"
    assert handed_over["station_id"] == "mcqueeney"
    assert handed_over["delivered_at"] == first_at.isoformat(timespec="milliseconds").replace(
        "+00:00", "Z"
    )
    assert handed_over["evidence"] == {"weight_kg": 0.5}
    completed = events[7]["data"]
    assert completed["planned"]["delivery_time_s"] == 1200
    assert completed["actual"]["delivery_time_s"] == 1200
    assert [package["package_id"] for package in completed["packages"]] == ["p1", "p2"]


async def test_a_report_that_comes_too_early_must_be_repeated(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.planned()
    for seq in (3, 2):
        answer = await gateway.report(delivery_id, "LOADING", seq=seq)
        assert answer.status_code == 409
        assert answer.json()["code"] == "NOT_YET"
    await _reports(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    assert (await gateway.get(delivery_id))["state"] == "IN_PROGRESS"


async def test_a_repeated_report_changes_nothing(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.planned()
    answers = await asyncio.gather(
        *(gateway.report(delivery_id, "ACCEPTED", seq=1) for _ in range(4))
    )
    assert {answer.status_code for answer in answers} == {204}
    await _reports(gateway, delivery_id, "LOADING", "LOADED", first=2)
    before = await gateway.get(delivery_id)
    for seq, kind in ((1, "ACCEPTED"), (2, "LOADING"), (3, "LOADED")):
        assert (await gateway.report(delivery_id, kind, seq=seq)).status_code == 204
    assert await gateway.get(delivery_id) == before
    assert (await gateway.event_types(delivery_id)).count("delivery.dispatched") == 1


async def test_reports_in_a_wrong_order_give_the_same_end(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    waiting: list[tuple[int, str, dict[str, Any]]] = [
        (4, "DELIVERED", {"package_ids": ["p1"]}),
        (2, "LOADING", {}),
        (1, "ACCEPTED", {}),
        (3, "LOADED", {}),
    ]
    while waiting:
        seq, kind, fields = waiting.pop(0)
        answer = await gateway.report(delivery_id, kind, seq=seq, **fields)
        if answer.status_code == 409:
            waiting.append((seq, kind, fields))
    assert (await gateway.get(delivery_id))["state"] == "COMPLETED"
    assert await gateway.event_types(delivery_id) == [
        "delivery.requested",
        "delivery.planned",
        "delivery.dispatched",
        "delivery.loaded",
        "delivery.started",
        "package.delivered",
        "delivery.completed",
    ]


async def _booked_without_an_answer(gateway: Gateway, mission: Callable[..., Any]) -> str:
    """A delivery whose mission is booked, while the answer to the booking is lost."""
    delivery_id = await gateway.accepted()
    request = DeliveryRequest.model_validate((await gateway.get(delivery_id))["request"])
    gateway.composition.booked[delivery_id, 1] = mission(
        request,
        delivery_id=delivery_id,
        attempt=1,
        drone_id="drn_1",
        start_at=gateway.clock.now(),
    )
    return delivery_id


async def test_a_report_about_an_unknown_mission_brings_the_answer_to_its_booking(
    gateway_on_both: Gateway, mission: Callable[..., Any]
) -> None:
    gateway = gateway_on_both
    delivery_id = await _booked_without_an_answer(gateway, mission)
    kinds = ("ACCEPTED", "LOADING", "LOADED")
    await _reports(gateway, delivery_id, *kinds)

    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "IN_PROGRESS"
    assert await gateway.event_types(delivery_id) == [
        "delivery.requested",
        "delivery.planned",
        "delivery.dispatched",
        "delivery.loaded",
        "delivery.started",
    ]
    assert len(gateway.composition.asked) == 1
    assert not await gateway.book_next()


async def test_reports_that_come_together_ask_once(
    gateway: Gateway, mission: Callable[..., Any]
) -> None:
    delivery_id = await _booked_without_an_answer(gateway, mission)
    answers = await asyncio.gather(
        *(gateway.report(delivery_id, "ACCEPTED", seq=1) for _ in range(5))
    )

    assert {answer.status_code for answer in answers} == {204}
    assert len(gateway.composition.asked) == 1
    assert (await gateway.event_types(delivery_id)).count("delivery.planned") == 1


async def test_a_report_is_refused_for_now_while_composition_cannot_be_asked(
    gateway: Gateway, mission: Callable[..., Any]
) -> None:
    delivery_id = await _booked_without_an_answer(gateway, mission)
    gateway.composition.is_away = True
    answer = await gateway.report(delivery_id, "ACCEPTED", seq=1)
    assert (answer.status_code, answer.json()["code"]) == (409, "NOT_YET")

    gateway.composition.is_away = False
    await _reports(gateway, delivery_id, "ACCEPTED")
    assert (await gateway.get(delivery_id))["state"] == "DISPATCHED"


async def test_a_report_does_not_plan_a_delivery_that_is_being_cancelled(
    gateway: Gateway, mission: Callable[..., Any]
) -> None:
    delivery_id = await _booked_without_an_answer(gateway, mission)
    gateway.composition.is_away = True
    path = f"/v1/deliveries/{delivery_id}/cancel"
    await gateway.http.post(path, headers=gateway.customer)
    gateway.composition.is_away = False

    assert (await gateway.report(delivery_id, "ACCEPTED", seq=1)).status_code == 409
    assert "delivery.planned" not in await gateway.event_types(delivery_id)


async def test_a_refused_report_holds_up_no_other_of_its_request(
    gateway: Gateway, mission: Callable[..., Any]
) -> None:
    known_id = await gateway.planned()
    unknown_id = await _booked_without_an_answer(gateway, mission)
    gateway.composition.is_away = True
    reports = [gateway.mission_report(one, "ACCEPTED", seq=1) for one in (unknown_id, known_id)]
    answer = await gateway.report_together(*reports)

    assert answer.status_code == 409
    assert (await gateway.get(known_id))["state"] == "DISPATCHED"


async def test_a_report_about_an_unknown_delivery_is_dropped(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    booked = gateway.composition.booked[delivery_id, 1]
    gateway.composition.booked["dlv_other", 1] = booked
    assert (await gateway.report("dlv_other", "ACCEPTED", seq=1)).status_code == 404


async def test_late_reports_about_a_refused_mission_change_nothing(
    gateway: Gateway, candidate: Callable[..., Any]
) -> None:
    gateway.registry.candidates_now = [candidate("drn_1"), candidate("drn_2")]
    delivery_id = await gateway.planned()
    await gateway.report(delivery_id, "REFUSED", seq=1, code="EXPIRED")
    await gateway.book_next()
    before = await gateway.get(delivery_id)
    assert (await gateway.report(delivery_id, "ENDED", seq=2)).status_code == 204
    assert await gateway.get(delivery_id) == before


async def test_a_late_refusal_restarts_the_waiting_time(
    gateway: Gateway, candidate: Callable[..., Any]
) -> None:
    gateway.registry.candidates_now = [candidate("drn_1"), candidate("drn_2")]
    delivery_id = await gateway.planned()
    gateway.clock.advance(timedelta(hours=3))
    await gateway.report(delivery_id, "REFUSED", seq=1, code="EXPIRED")
    await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "PLANNED"


async def test_an_aborted_mission_strands_its_packages(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.planned(packages=3)
    await _reports(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1"])
    await gateway.report(
        delivery_id,
        "ENDED",
        seq=5,
        mission_state="ABORTED",
        station_id="bulverde",
        stranded_package_ids=["p2", "p3"],
        code="NO_PLAN",
        detail="the battery is too low",
    )
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "PARTIALLY_COMPLETED"
    assert [package["state"] for package in delivery["packages"]] == [
        "DELIVERED",
        "STRANDED",
        "STRANDED",
    ]
    assert delivery["packages"][2]["custodian"] == {"kind": "STATION", "id": "bulverde"}
    *_, stranded, last = await gateway.events(delivery_id)
    assert stranded["type"] == "package.stranded"
    assert stranded["data"]["station_id"] == "bulverde"
    assert stranded["data"]["detail"] == "the battery is too low"
    assert last["type"] == "delivery.partially_completed"


async def test_a_mission_that_ends_before_loading_fails_the_delivery(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    await _reports(gateway, delivery_id, "ACCEPTED", "LOADING")
    await gateway.report(delivery_id, "ENDED", seq=3, mission_state="ABORTED", code="LOST")
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "FAILED"
    assert delivery["packages"][0]["state"] == "CANCELLED"
    assert delivery["packages"][0]["custodian"] == {"kind": "STATION", "id": "san-marcos"}
    assert (await gateway.event_types(delivery_id))[-1] == "delivery.failed"


async def test_packages_of_a_crashed_drone_stay_in_its_custody(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    await _reports(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    await gateway.report(
        delivery_id,
        "ENDED",
        seq=4,
        mission_state="ABORTED",
        code="MOTOR_FAILURE",
        stranded_package_ids=["p1"],
        position=[-98.2, 29.7],
    )
    [package] = (await gateway.get(delivery_id))["packages"]
    assert (package["state"], package["code"]) == ("STRANDED", "MOTOR_FAILURE")
    assert package["custodian"] == {"kind": "DRONE", "id": "drn_1"}
    assert package["position"] == [-98.2, 29.7]
    *_, stranded, failed = await gateway.events(delivery_id)
    assert (stranded["type"], failed["type"]) == ("package.stranded", "delivery.failed")
    assert stranded["data"]["position"] == [-98.2, 29.7]


@pytest.mark.parametrize(
    ("rate", "late_s", "is_reported"),
    [(1, 59, False), (1, 61, True), (60, 354, False), (60, 356, True)],
)
async def test_a_delay_of_more_than_a_minute_and_what_the_machine_takes_causes_an_event(
    gateway: Gateway, rate: float, late_s: int, is_reported: bool
) -> None:
    gateway.clock.rate = rate
    delivery_id = await gateway.planned(packages=2)
    await _reports(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    mission = gateway.composition.booked[delivery_id, 1]
    late = [
        {"package_id": eta.package_id, "eta_at": eta.eta_at + timedelta(seconds=late_s)}
        for eta in mission.packages
    ]
    await gateway.report(delivery_id, "ACTIVITY", seq=4, activity="WAITING", etas=late)
    await gateway.report(delivery_id, "ACTIVITY", seq=5, etas=late)
    delivery = await gateway.get(delivery_id)
    assert delivery["flags"]["delayed"] == is_reported
    assert delivery["activity"] == "WAITING"
    assert (await gateway.event_types(delivery_id)).count("delivery.delayed") == int(is_reported)
    if is_reported:
        [reported] = [
            event
            for event in await gateway.events(delivery_id)
            if event["type"] == "delivery.delayed"
        ]
        assert [one["late_s"] for one in reported["data"]["packages"]] == [late_s, late_s]


async def test_a_new_plan_causes_an_event_with_its_etas(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    await _reports(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    mission = gateway.composition.booked[delivery_id, 1]
    [eta] = mission.packages
    later = eta.model_copy(update={"eta_at": eta.eta_at + timedelta(minutes=30)})
    revised = mission.model_copy(update={"revision": 2, "packages": (later,), "state": "ACTIVE"})
    await gateway.report(
        delivery_id, "REPLANNED", seq=4, mission=revised, code="PAD_LOST", detail="pad gone"
    )
    delivery = await gateway.get(delivery_id)
    assert delivery["missions"][0]["revision"] == 2
    assert delivery["flags"]["delayed"]
    assert (await gateway.event_types(delivery_id))[-2:] == [
        "delivery.replanned",
        "delivery.delayed",
    ]


async def test_reports_of_several_missions_come_in_one_request(gateway: Gateway) -> None:
    delivery_ids = [await gateway.planned(), await gateway.planned()]
    reports = [gateway.mission_report(one, "ACCEPTED", seq=1) for one in delivery_ids]

    answer = await gateway.report_together(*reports)

    assert answer.status_code == 204, answer.text
    for delivery_id in delivery_ids:
        assert (await gateway.get(delivery_id))["state"] == "DISPATCHED"


async def test_one_refused_report_refuses_all_reports_after_it_in_the_request(
    gateway: Gateway,
) -> None:
    first, second = await gateway.planned(), await gateway.planned()
    too_early = gateway.mission_report(second, "LOADING", seq=2)

    answer = await gateway.report_together(
        gateway.mission_report(first, "ACCEPTED", seq=1), too_early
    )
    again = await gateway.report(first, "ACCEPTED", seq=1)

    assert answer.status_code == 409
    assert again.status_code == 204
    assert (await gateway.event_types(first)).count("delivery.dispatched") == 1


async def test_only_a_service_reports(gateway: Gateway) -> None:
    for path in ("/internal/mission-reports", "/internal/mission-reports/many"):
        for headers in (dict[str, str](), gateway.operator):
            answer = await gateway.http.post(path, json={}, headers=headers)
            assert answer.status_code == 401


async def test_a_delivery_shows_that_its_drone_is_out_of_contact(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()

    await gateway.report(delivery_id, "ACTIVITY", seq=1, activity="OUT_OF_CONTACT")
    delivery = await gateway.get(delivery_id)
    assert (delivery["state"], delivery["activity"]) == ("PLANNED", "OUT_OF_CONTACT")

    await gateway.report(delivery_id, "REFUSED", seq=2, code="NO_ANSWER")
    delivery = await gateway.get(delivery_id)
    assert (delivery["state"], delivery["activity"]) == ("REQUESTED", None)
