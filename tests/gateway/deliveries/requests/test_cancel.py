"""Cancelling in each state: everything that can still be stopped is stopped."""

import asyncio
import itertools
import types
from collections.abc import Callable, Coroutine, Generator
from datetime import timedelta
from typing import Any

import httpx
import pytest
from skyway_gateway.deliveries.booking.booking_round import booking_request
from skyway_gateway.deliveries.requests.cancel import CancelRequest
from sqlalchemy import text

from skyway.contracts.mission import BookMissions
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.request import DeliveryRequest
from skyway.runtime.http.identity import Caller
from tests.gateway.whole_gateway import Gateway


async def cancel(gateway: Gateway, delivery_id: str, **body: object) -> httpx.Response:
    path = f"/v1/deliveries/{delivery_id}/cancel"
    answer: httpx.Response = await gateway.http.post(
        path, json=body or None, headers=gateway.customer
    )
    return answer


async def reports(
    gateway: Gateway, delivery_id: str, *kinds: str, first: int = 1, **at: Any
) -> None:
    for seq, kind in enumerate(kinds, start=first):
        answer = await gateway.report(delivery_id, kind, seq=seq, **at)
        assert answer.status_code == 204, answer.text


def states(delivery: dict[str, Any]) -> list[str]:
    return [package["state"] for package in delivery["packages"]]


async def test_a_waiting_request_is_closed_before_it_is_cancelled(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.accepted(packages=2)
    answer = await cancel(gateway, delivery_id, reason="ordered twice")
    assert answer.status_code == 200, answer.text
    delivery = answer.json()
    assert delivery["state"] == "CANCELLED"
    assert states(delivery) == ["CANCELLED", "CANCELLED"]
    assert {package["detail"] for package in delivery["packages"]} == {"ordered twice"}
    assert delivery_id in gateway.composition.closed
    assert gateway.composition.cancellations == [], "asked for missions before it was closed"
    assert await gateway.event_types(delivery_id) == [
        "delivery.requested",
        "package.cancelled",
        "package.cancelled",
        "delivery.cancelled",
    ]
    assert not await gateway.book_next()


async def test_cancelling_again_gets_the_same_answer_and_no_second_event(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted()
    answers = [await cancel(gateway, delivery_id) for _ in range(3)]
    assert {answer.status_code for answer in answers} == {200}
    assert (await gateway.event_types(delivery_id)).count("delivery.cancelled") == 1


async def test_a_planned_delivery_is_cancelled_before_it_is_loaded(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.planned(packages=2)
    answer = await cancel(gateway, delivery_id)
    assert answer.json()["state"] == "CANCELLED"
    [asked] = gateway.composition.cancellations
    assert asked.package_ids == ("p1", "p2")
    assert "customer alice" in asked.reason
    # The reports that composition sends afterwards change nothing.
    await gateway.report(delivery_id, "RELEASED", seq=1, package_ids=["p1", "p2"])
    await gateway.report(delivery_id, "ENDED", seq=2, mission_state="CANCELLED", code="CANCELLED")
    assert (await gateway.event_types(delivery_id))[-1] == "delivery.cancelled"


async def test_packages_on_board_come_back_to_the_pickup(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.planned(packages=2)
    await reports(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    gateway.composition.loaded = {"p1", "p2"}
    delivery = (await cancel(gateway, delivery_id)).json()
    assert delivery["state"] == "IN_PROGRESS"
    assert states(delivery) == ["RETURNING", "RETURNING"]
    assert delivery["cancel_reason"] == "cancelled by customer alice"

    await gateway.report(
        delivery_id, "RETURNING", seq=4, package_ids=["p1", "p2"], code="CANCELLED"
    )
    await gateway.report(
        delivery_id,
        "RETURNED",
        seq=5,
        package_ids=["p1", "p2"],
        station_id="san-marcos",
        data={"mass_kg": {"p1": 0.5, "p2": 0.5}, "load_before_kg": 1.0, "load_after_kg": 0.0},
    )
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "CANCELLED"
    assert states(delivery) == ["RETURNED", "RETURNED"]
    assert delivery["packages"][0]["custodian"] == {"kind": "STATION", "id": "san-marcos"}
    assert delivery["packages"][0]["proof"]["load_before_kg"] == 1.0
    assert (await gateway.event_types(delivery_id))[-3:] == [
        "package.returned",
        "package.returned",
        "delivery.cancelled",
    ]


async def test_one_package_is_cancelled_and_the_others_are_delivered(gateway: Gateway) -> None:
    delivery_id = await gateway.planned(packages=3)
    delivery = (await cancel(gateway, delivery_id, package_ids=["p2"])).json()
    assert delivery["state"] == "PLANNED"
    assert states(delivery) == ["CREATED", "CANCELLED", "CREATED"]
    assert gateway.composition.cancellations[0].package_ids == ("p2",)
    await reports(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    assert states(await gateway.get(delivery_id)) == ["LOADED", "CANCELLED", "LOADED"]
    await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1", "p3"])
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "PARTIALLY_COMPLETED"


async def test_a_cancelled_waiting_package_is_left_out_of_the_booking(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted(packages=2)
    delivery = (await cancel(gateway, delivery_id, package_ids=["p1"])).json()
    assert (delivery["state"], states(delivery)) == ("REQUESTED", ["CANCELLED", "CREATED"])
    assert gateway.composition.cancellations == []
    await gateway.book_next()
    [package] = gateway.composition.asked[-1].request.packages
    assert package.package_id == "p2"


async def test_cancelling_the_last_waiting_package_closes_the_delivery(gateway: Gateway) -> None:
    """A round of booking that is still under way must not book it."""
    delivery_id = await gateway.accepted(packages=2)
    await cancel(gateway, delivery_id, package_ids=["p1"])

    delivery = (await cancel(gateway, delivery_id, package_ids=["p2"])).json()

    assert delivery["state"] == "CANCELLED"
    assert delivery_id in gateway.composition.closed


async def test_a_package_that_is_cancelled_during_booking_is_not_carried(
    gateway: Gateway,
) -> None:
    delivery_id = await gateway.accepted(packages=2)
    await _booked_in_composition(gateway)
    await cancel(gateway, delivery_id, package_ids=["p1"])
    gateway.clock.advance(timedelta(seconds=30))
    await gateway.book_next()
    delivery = await gateway.get(delivery_id)
    assert (delivery["state"], states(delivery)) == ("PLANNED", ["CANCELLED", "CREATED"])
    [of_composition] = await _cancellations_of_composition(gateway)
    assert of_composition["package_ids"] == ["p1"]


async def test_packages_on_board_of_a_mission_that_was_not_written_are_not_called_cancelled(
    gateway: Gateway,
) -> None:
    """The gateway may fail between a booking in composition and writing it."""
    delivery_id = await gateway.accepted(packages=2)
    await _booked_in_composition(gateway)
    gateway.composition.loaded = {"p1"}

    delivery = (await cancel(gateway, delivery_id)).json()

    first, second = delivery["packages"]
    assert (first["state"], second["state"]) == ("CREATED", "CANCELLED")
    assert first["mission_id"] is not None
    assert delivery["state"] not in ("CANCELLED", "REQUESTED")
    assert len(delivery["missions"]) == 1


async def test_packages_of_an_ended_mission_that_was_not_written_are_not_called_cancelled(
    gateway: Gateway,
) -> None:
    """The gateway was away from the booking until the drone had delivered all packages."""
    delivery_id = await gateway.accepted(packages=1)
    await _booked_in_composition(gateway)
    gateway.composition.delivered = {"p1"}
    key = delivery_id, 1
    ended = gateway.composition.booked[key].model_copy(update={"state": "COMPLETED"})
    gateway.composition.booked[key] = ended

    refused = await cancel(gateway, delivery_id)

    assert (refused.status_code, refused.json()["code"]) == (409, "TOO_LATE")
    assert (await gateway.get(delivery_id))["state"] == "PLANNED"
    await reports(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1"])
    assert (await gateway.get(delivery_id))["state"] == "COMPLETED"


async def test_a_delivery_that_is_cancelled_during_booking_is_not_flown(
    gateway: Gateway,
) -> None:
    delivery_id = await gateway.accepted(packages=2)
    await _booked_in_composition(gateway)
    delivery = (await cancel(gateway, delivery_id)).json()
    assert delivery["state"] == "CANCELLED"
    assert delivery["missions"] == []
    assert gateway.composition.cancellations[0].package_ids == ("p1", "p2")
    gateway.clock.advance(timedelta(seconds=30))
    assert not await gateway.book_next()


async def test_a_mission_that_is_booked_too_late_is_cancelled_by_its_report(
    gateway: Gateway,
) -> None:
    delivery_id = await gateway.accepted(packages=1)
    await cancel(gateway, delivery_id)
    gateway.composition.closed.clear()
    await gateway.composition.book(delivery_id, await _request_to_book(gateway, delivery_id))
    for _ in range(2):
        assert (await gateway.report(delivery_id, "ACCEPTED", seq=1)).status_code == 204
    of_composition = await _cancellations_of_composition(gateway)
    assert {one["cancellation_id"] for one in of_composition} == {f"late_msn_{delivery_id[4:]}_1"}
    assert of_composition[0]["package_ids"] == ["p1"]
    assert (await gateway.get(delivery_id))["missions"] == []


async def test_a_delivered_package_cannot_be_cancelled(gateway: Gateway) -> None:
    delivery_id = await gateway.planned(packages=2)
    await reports(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1"])
    gateway.composition.loaded, gateway.composition.delivered = {"p2"}, {"p1"}
    refused = await cancel(gateway, delivery_id, package_ids=["p1"])
    assert (refused.status_code, refused.json()["code"]) == (409, "TOO_LATE")
    assert "p1 is DELIVERED" in refused.json()["detail"]

    delivery = (await cancel(gateway, delivery_id)).json()
    assert states(delivery) == ["DELIVERED", "RETURNING"]
    await gateway.report(
        delivery_id, "RETURNED", seq=5, package_ids=["p2"], station_id="san-marcos"
    )
    assert (await gateway.get(delivery_id))["state"] == "PARTIALLY_COMPLETED"
    assert (await cancel(gateway, delivery_id)).json()["code"] == "TOO_LATE"


async def test_composition_decides_what_is_too_late_to_cancel(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    await reports(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    gateway.composition.delivered = {"p1"}
    refused = await cancel(gateway, delivery_id)
    assert (refused.status_code, refused.json()["code"]) == (409, "TOO_LATE")
    assert (await gateway.get(delivery_id))["state"] == "IN_PROGRESS"


async def test_a_package_that_is_cancelled_during_loading_comes_back(
    gateway: Gateway,
) -> None:
    delivery_id = await gateway.planned()
    await reports(gateway, delivery_id, "ACCEPTED", "LOADING")
    gateway.composition.loaded = {"p1"}  # composition has not reported it yet
    answer = await cancel(gateway, delivery_id)
    assert answer.status_code == 200, answer.text
    assert states(answer.json()) == ["CREATED"]
    await gateway.report(delivery_id, "RETURNING", seq=3, package_ids=["p1"], code="CANCELLED")
    await gateway.report(delivery_id, "LOADED", seq=4, package_ids=["p1"])
    delivery = await gateway.get(delivery_id)
    assert states(delivery) == ["RETURNING"]
    assert delivery["packages"][0]["custodian"]["kind"] == "DRONE"
    await gateway.report(
        delivery_id, "RETURNED", seq=5, package_ids=["p1"], station_id="san-marcos"
    )
    assert (await gateway.get(delivery_id))["state"] == "CANCELLED"


async def test_trips_that_have_not_begun_are_cancelled_and_the_others_return(
    gateway: Gateway, candidate: Callable[..., Any]
) -> None:
    gateway.composition.packages_per_trip = 1
    gateway.registry.candidates_now = [candidate("drn_1"), candidate("drn_2")]
    delivery_id = await gateway.accepted(packages=3)
    await gateway.book_next()
    await reports(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED", trip=1)
    gateway.composition.loaded = {"p1"}
    delivery = (await cancel(gateway, delivery_id)).json()
    assert states(delivery) == ["RETURNING", "CANCELLED", "CANCELLED"]
    assert gateway.composition.cancellations[0].package_ids == ("p1", "p2")
    gateway.registry.candidates_now = [candidate("drn_3")]
    assert not await gateway.book_next(), "booked what was cancelled"


async def test_a_package_that_returns_without_a_recipient_fails_the_delivery(
    gateway: Gateway,
) -> None:
    delivery_id = await gateway.planned()
    await reports(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    await gateway.report(
        delivery_id, "RETURNING", seq=4, package_ids=["p1"], code="RECIPIENT_ABSENT"
    )
    assert (await cancel(gateway, delivery_id)).status_code == 409, "nothing more to be stopped"
    await gateway.report(
        delivery_id, "RETURNED", seq=5, package_ids=["p1"], station_id="san-marcos"
    )
    delivery = await gateway.get(delivery_id)
    assert (delivery["state"], delivery["packages"][0]["code"]) == ("FAILED", "RECIPIENT_ABSENT")


@pytest.mark.parametrize("service_is", ["away before", "away and back"])
async def test_nothing_is_cancelled_while_composition_is_away(
    gateway: Gateway, service_is: str
) -> None:
    delivery_id = await gateway.accepted()
    gateway.composition.is_away = True
    assert (await cancel(gateway, delivery_id)).status_code == 503
    assert (await gateway.get(delivery_id))["state"] == "REQUESTED"
    gateway.composition.is_away = False
    if service_is == "away and back":  # the loop finishes the cancellation
        await gateway.book_next()
    else:
        await cancel(gateway, delivery_id)
    assert (await gateway.get(delivery_id))["state"] == "CANCELLED"


async def test_cancelling_and_giving_up_at_the_same_time_give_one_end(
    gateway_on_both: Gateway, reason: Callable[..., Any]
) -> None:
    gateway = gateway_on_both
    gateway.composition.reasons = [reason("OUT_OF_RANGE", is_temporary=False)]
    delivery_id = await gateway.accepted()
    answer, _ = await asyncio.gather(cancel(gateway, delivery_id), gateway.book_next())
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] in ("CANCELLED", "REJECTED")
    assert (answer.status_code == 200) == (delivery["state"] == "CANCELLED")


async def test_a_delivery_that_is_cancelled_first_is_not_rejected(gateway: Gateway) -> None:
    """The cancellation has closed the delivery; a booking round leaves the end to it."""
    delivery_id = await gateway.accepted()
    queued = await _claimed(gateway)
    await gateway.execute("UPDATE deliveries SET cancel_reason = 'ordered twice'")
    gateway.composition.closed.add(delivery_id)
    await gateway.parts.booker.book(queued)
    assert (await gateway.get(delivery_id))["state"] == "REQUESTED"
    gateway.clock.advance(timedelta(seconds=30))
    await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "CANCELLED"


@types.coroutine
def _until_wait(call: Coroutine[Any, Any, Any], wait: int) -> Generator[Any, Any, Any]:
    """Run a call and kill it in its n-th wait."""
    for number in itertools.count(1):
        try:
            awaited = (
                call.throw(asyncio.CancelledError()) if number == wait + 1 else call.send(None)
            )
        except StopIteration as done:
            return done.value
        yield awaited
    raise AssertionError


async def test_a_cancellation_that_is_killed_anywhere_is_finished_or_never_began(
    gateway: Gateway,
) -> None:
    alice, was_killed, wait, ends = Caller("customer", "alice"), True, 0, []
    while was_killed:
        wait += 1
        delivery_id = await gateway.accepted()
        call = gateway.parts.canceller.cancel(alice, delivery_id, CancelRequest())
        try:
            await _until_wait(call, wait)
            was_killed = False
        except asyncio.CancelledError:
            was_killed = True
        while await gateway.book_next():
            pass
        delivery = await gateway.get(delivery_id)
        ends.append(delivery["state"])
        if delivery["cancel_reason"] is not None:
            assert delivery["state"] == "CANCELLED", f"killed in wait {wait}"
    assert wait > 4, "the call was hardly ever killed inside"
    assert set(ends) == {"PLANNED", "CANCELLED"}


async def test_only_the_customer_and_operators_cancel_a_delivery(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted()
    path = f"/v1/deliveries/{delivery_id}/cancel"
    for headers, status in (({}, 401), (gateway.other, 404), (gateway.provider, 403)):
        assert (await gateway.http.post(path, headers=headers)).status_code == status
    assert (await gateway.http.post(path, headers=gateway.operator)).status_code == 200
    delivery = await gateway.get(delivery_id)
    assert delivery["packages"][0]["detail"] == "cancelled by operator op"


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({"package_ids": ["p1", "p9"]}, "package_ids.1"),
        ({"package_ids": []}, "package_ids"),
        ({"reason": "x" * 501}, "reason"),
        ({"why": "x"}, "why"),
    ],
)
async def test_a_bad_cancellation_is_a_problem(
    gateway: Gateway, body: dict[str, Any], field: str
) -> None:
    delivery_id = await gateway.accepted()
    answer = await cancel(gateway, delivery_id, **body)
    assert answer.status_code == 422
    assert [error["field"] for error in answer.json()["errors"]] == [field]


async def _claimed(gateway: Gateway) -> Any:
    [queued] = await gateway.parts.booker.claim(limit=1)
    return queued


async def _booked_in_composition(gateway: Gateway) -> None:
    """A round of booking that died before it wrote anything."""
    delivery = (await _claimed(gateway)).delivery
    asked = booking_request(delivery, Shortlist.of(gateway.registry.candidates_now))
    await gateway.composition.book(delivery.delivery_id, asked)


async def _request_to_book(gateway: Gateway, delivery_id: str) -> Any:
    request = DeliveryRequest.model_validate((await gateway.get(delivery_id))["request"])
    shortlist = Shortlist.of(gateway.registry.candidates_now)
    return BookMissions(attempt=1, request=request, shortlist=shortlist)


async def _cancellations_of_composition(gateway: Gateway) -> list[dict[str, Any]]:
    """The outbox messages for composition."""
    import json

    async with gateway.parts.db.read() as connection:
        rows = await connection.execute(
            text("SELECT payload FROM outbox WHERE channel = 'composition' ORDER BY id")
        )
        return [json.loads(row.payload) for row in rows]
