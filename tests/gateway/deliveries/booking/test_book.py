"""Booking: a process may die in any round, and nothing is booked twice."""

import asyncio
import itertools
import types
from collections.abc import Callable, Coroutine, Generator
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Any

import pytest

from tests.gateway.whole_gateway import Gateway


async def test_a_request_becomes_a_planned_delivery(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.accepted(packages=3)
    assert await gateway.book_next()
    assert not await gateway.book_next()

    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "PLANNED"
    assert delivery["provider_id"] == "prv_1"
    items = [{"kind": "BASE", "amount": 1234}]
    assert delivery["price"] == {"amount": 1234, "currency": "USD", "line_items": items}
    assert [mission["drone_id"] for mission in delivery["missions"]] == ["drn_1"]
    assert all(package["eta_at"] == package["promised_at"] for package in delivery["packages"])
    requested, planned = await gateway.events(delivery_id)
    assert requested["type"] == "delivery.requested"
    assert planned["type"] == "delivery.planned"
    assert planned["data"]["delivery_time_s"] == 1800
    assert [p["package_id"] for p in planned["data"]["packages"]] == ["p1", "p2", "p3"]


async def test_a_request_that_waits_for_others_is_booked_to_begin_later(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted(qos={"pooling": True, "pooling_wait_s": 900})
    created_at = datetime.fromisoformat((await gateway.get(delivery_id))["created_at"])
    await gateway.book_next()

    [asked] = gateway.composition.asked
    assert asked.request.earliest_pickup_at == created_at + timedelta(seconds=900)


async def test_the_registry_is_asked_with_pickup_mass_and_providers(gateway: Gateway) -> None:
    await gateway.accepted(packages=2, qos={"providers": {"denied": ["prv_9"]}})
    await gateway.book_next()
    [query] = gateway.registry.queries
    assert query.pickup_station_id == "san-marcos"
    assert query.pickup_position == (-98.0, 29.0)
    assert query.payload_kg == 1.0
    assert query.providers.denied == ("prv_9",)
    assert query.excluded_drone_ids == ()


@types.coroutine
def _until_wait(step: Coroutine[Any, Any, bool], wait: int) -> Generator[Any, Any, bool]:
    """Run a step and kill it in its n-th wait; its clean-up may wait, too."""
    for number in itertools.count(1):
        try:
            awaited = (
                step.throw(asyncio.CancelledError()) if number == wait + 1 else step.send(None)
            )
        except StopIteration as done:
            return bool(done.value)
        yield awaited
    raise AssertionError


async def _is_killed(step: Coroutine[Any, Any, bool], wait: int) -> bool:
    try:
        await _until_wait(step, wait)
    except asyncio.CancelledError:
        return True
    return False


@pytest.mark.parametrize("is_feasible", [True, False], ids=["booked", "rejected"])
async def test_the_next_round_finishes_a_round_that_was_killed_anywhere(
    gateway: Gateway, is_feasible: bool, reason: Callable[..., Any]
) -> None:
    if not is_feasible:
        gateway.registry.candidates_now = []
        gateway.registry.infeasible = [reason("OVERWEIGHT", is_temporary=False)]
    wait, was_killed, ends = 0, True, []
    while was_killed:
        wait += 1
        delivery_id = await gateway.accepted()
        before = gateway.composition.booking_count
        was_killed = await _is_killed(gateway.book_next(), wait)
        # The claim of a dead process runs out.
        gateway.clock.advance(timedelta(seconds=30))
        while await gateway.book_next():
            pass
        delivery = await gateway.get(delivery_id)
        ends.append(delivery["state"])
        assert gateway.composition.booking_count - before == int(is_feasible)
        if not is_feasible:
            assert [one["code"] for one in delivery["reasons"]] == ["OVERWEIGHT"]
    assert wait > 4, "the step was hardly ever killed inside"
    assert set(ends) == {"PLANNED" if is_feasible else "REJECTED"}


async def test_a_booking_is_found_after_its_drone_stopped_being_a_candidate(
    gateway: Gateway,
) -> None:
    """The only drone is busy with the mission that the killed round has booked."""
    delivery_id = await gateway.accepted()
    [queued] = await _claimed(gateway)
    await _ask(gateway, queued)
    gateway.clock.advance(timedelta(seconds=30))

    gateway.registry.candidates_now = []
    await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "PLANNED"
    assert gateway.composition.booking_count == 1


async def test_a_mission_that_was_refused_before_it_was_written_is_booked_again(
    gateway: Gateway, candidate: Callable[..., Any]
) -> None:
    """The round is killed after booking, and the drone refuses before the next round."""
    gateway.registry.candidates_now = [candidate("drn_1"), candidate("drn_2")]
    delivery_id = await gateway.accepted()
    [queued] = await _claimed(gateway)
    await _ask(gateway, queued)
    mission = gateway.composition.booked[delivery_id, 1]
    refused = mission.model_copy(update={"state": "REFUSED"})
    gateway.composition.booked[delivery_id, 1] = refused
    # The report makes the gateway ask for the booking.
    assert (await gateway.report(delivery_id, "REFUSED", seq=1)).status_code == 204

    await gateway.book_next()
    delivery = await gateway.get(delivery_id)
    assert (delivery["state"], delivery["attempt"]) == ("PLANNED", 2)
    assert delivery["missions"][0]["drone_id"] == "drn_2"


async def test_two_replicas_with_the_same_delivery_plan_it_once(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.accepted()
    [queued] = await _claimed(gateway)
    await asyncio.gather(*(gateway.parts.booker.book(queued) for _ in range(3)))
    assert await gateway.event_types(delivery_id) == ["delivery.requested", "delivery.planned"]
    assert gateway.composition.booking_count == 1


async def test_a_claimed_delivery_is_left_alone_until_the_claim_runs_out(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    await gateway.accepted()
    assert len(await _claimed(gateway)) == 1
    assert await _claimed(gateway) == []
    gateway.clock.advance(timedelta(seconds=3))
    assert len(await _claimed(gateway)) == 1


async def test_a_claim_that_its_owner_renews_does_not_run_out(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    first = await gateway.accepted()
    assert len(await _claimed(gateway)) == 1
    second = await gateway.accepted()
    other = replace(gateway.parts.booker, claimant="bkr_of_a_replica")
    assert len(await other.claim(limit=9)) == 1

    gateway.clock.advance(timedelta(seconds=2))
    await gateway.parts.booker.hold([first, second])
    gateway.clock.advance(timedelta(seconds=2))

    assert [one.delivery.delivery_id for one in await other.claim(limit=9)] == [second]
    gateway.clock.advance(timedelta(seconds=1))
    assert [one.delivery.delivery_id for one in await other.claim(limit=9)] == [first]


async def test_planned_and_postponed_deliveries_are_no_longer_claimed(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    planned = await gateway.planned()
    gateway.composition.is_busy = True
    put_off = await gateway.accepted()
    assert await gateway.book_next()

    gateway.clock.advance(timedelta(seconds=1))
    await gateway.parts.booker.hold([planned, put_off])
    gateway.clock.advance(timedelta(seconds=2))
    assert [one.delivery.delivery_id for one in await _claimed(gateway)] == [put_off]


async def test_a_busy_fleet_keeps_the_request_for_a_later_round(
    gateway: Gateway, reason: Callable[..., Any]
) -> None:
    gateway.registry.candidates_now = []
    gateway.registry.infeasible = [
        reason("BUSY", is_temporary=True),
        reason("OVERWEIGHT", is_temporary=False, provider_id="prv_2"),
    ]
    delivery_id = await gateway.accepted()
    assert await gateway.book_next()
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "REQUESTED"
    assert [(one["provider_id"], one["code"]) for one in delivery["reasons"]] == [
        ("prv_1", "BUSY"),
        ("prv_2", "OVERWEIGHT"),
    ]
    assert not await gateway.book_next(), "tried again immediately"
    gateway.clock.advance(timedelta(seconds=3))
    assert await gateway.book_next()


async def test_a_busy_answer_keeps_the_request_although_all_reasons_are_final(
    gateway: Gateway, reason: Callable[..., Any]
) -> None:
    gateway.composition.is_busy = True
    gateway.composition.reasons = [reason("OUT_OF_RANGE", is_temporary=False)]
    delivery_id = await gateway.accepted()
    await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "REQUESTED"


async def test_a_request_without_providers_waits_until_one_registers(gateway: Gateway) -> None:
    gateway.registry.candidates_now = []
    delivery_id = await gateway.accepted()
    await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "REQUESTED"


async def test_a_delivery_with_only_final_reasons_is_closed_and_rejected(
    gateway_on_both: Gateway, reason: Callable[..., Any]
) -> None:
    gateway = gateway_on_both
    gateway.composition.reasons = [reason("OUT_OF_RANGE", is_temporary=False)]
    gateway.registry.infeasible = [reason("OVERWEIGHT", is_temporary=False, provider_id="prv_2")]
    delivery_id = await gateway.accepted()
    await gateway.book_next()
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "REJECTED"
    assert delivery_id in gateway.composition.closed
    assert [one["code"] for one in delivery["reasons"]] == ["OUT_OF_RANGE", "OVERWEIGHT"]
    assert {package["state"] for package in delivery["packages"]} == {"CANCELLED"}
    _, rejected = await gateway.events(delivery_id)
    assert rejected["type"] == "delivery.rejected"
    assert [one["detail"] for one in rejected["data"]["reasons"]] == [
        "why OUT_OF_RANGE",
        "why OVERWEIGHT",
    ]


async def test_a_request_is_given_up_when_its_waiting_time_ends(
    gateway: Gateway, reason: Callable[..., Any]
) -> None:
    gateway.registry.candidates_now = []
    gateway.registry.infeasible = [reason("BUSY", is_temporary=True)]
    delivery_id = await gateway.accepted()
    await gateway.book_next()
    gateway.clock.advance(timedelta(minutes=59))
    await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "REQUESTED"
    gateway.clock.advance(timedelta(minutes=2))
    await gateway.book_next()
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "REJECTED"
    assert [one["code"] for one in delivery["reasons"]] == ["BUSY"]


async def test_a_request_is_given_up_at_its_deadline(gateway: Gateway) -> None:
    gateway.registry.candidates_now = []
    deadline_at = (gateway.clock.now() + timedelta(hours=5)).isoformat()
    delivery_id = await gateway.accepted(qos={"deadline_at": deadline_at})
    gateway.clock.advance(timedelta(hours=4))
    await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "REQUESTED"
    gateway.clock.advance(timedelta(hours=1))
    await gateway.book_next()
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "REJECTED"
    (reason,) = delivery["reasons"]
    assert (reason["provider_id"], reason["code"]) == (None, "NO_PROVIDER")
    rejected = (await gateway.events(delivery_id))[-1]
    assert "no drone could be booked before 2026-03-01T17:00:00Z" in rejected["data"]["detail"]
    assert "no provider serves it" in rejected["data"]["detail"]


async def test_a_waiting_request_says_that_no_provider_serves_it(gateway: Gateway) -> None:
    gateway.registry.candidates_now = []
    delivery_id = await gateway.accepted()

    await gateway.book_next()

    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "REQUESTED"
    assert [one["code"] for one in delivery["reasons"]] == ["NO_PROVIDER"]


@pytest.mark.parametrize("service", ["registry", "composition"])
async def test_an_outage_uses_no_waiting_time_of_a_request_without_a_deadline(
    gateway: Gateway, service: str
) -> None:
    delivery_id = await gateway.accepted()
    getattr(gateway, service).is_away = True
    for _ in range(3):
        gateway.clock.advance(timedelta(hours=2))
        await gateway.book_next()
        assert (await gateway.get(delivery_id))["state"] == "REQUESTED"
    getattr(gateway, service).is_away = False
    gateway.composition.is_busy = True

    for _ in range(5):
        gateway.clock.advance(timedelta(minutes=10))
        await gateway.book_next()
        assert (await gateway.get(delivery_id))["state"] == "REQUESTED"
    gateway.clock.advance(timedelta(minutes=11))
    await gateway.book_next()

    assert (await gateway.get(delivery_id))["state"] == "REJECTED"


async def test_an_outage_until_the_deadline_rejects_a_request_as_too_late(
    gateway: Gateway,
) -> None:
    deadline_at = (gateway.clock.now() + timedelta(minutes=30)).isoformat()
    delivery_id = await gateway.accepted(qos={"deadline_at": deadline_at})
    gateway.registry.is_away = True
    await gateway.book_next()

    gateway.clock.advance(timedelta(hours=2))
    await gateway.book_next()

    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "REJECTED"
    assert [one["code"] for one in delivery["reasons"]] == ["TOO_LATE"]


async def test_a_request_is_asked_for_once_more_before_it_is_given_up(gateway: Gateway) -> None:
    """The gateway itself may have been away since the request was accepted."""
    delivery_id = await gateway.accepted()

    gateway.clock.advance(timedelta(hours=9))
    await gateway.book_next()

    assert (await gateway.get(delivery_id))["state"] == "PLANNED"


async def test_a_booking_before_the_deadline_is_written_after_it(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted()
    [queued] = await _claimed(gateway)
    await _ask(gateway, queued)
    gateway.clock.advance(timedelta(hours=2))
    await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "PLANNED"


@pytest.mark.parametrize("service", ["registry", "composition"])
async def test_a_delivery_is_booked_after_a_service_was_away(
    gateway: Gateway, service: str
) -> None:
    delivery_id = await gateway.accepted()
    getattr(gateway, service).is_away = True
    for _ in range(3):
        assert await gateway.book_next()
        gateway.clock.advance(timedelta(seconds=3))
    assert (await gateway.get(delivery_id))["state"] == "REQUESTED"
    getattr(gateway, service).is_away = False
    await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "PLANNED"


async def test_a_drone_that_refuses_is_not_asked_again(
    gateway_on_both: Gateway, candidate: Callable[..., Any]
) -> None:
    gateway = gateway_on_both
    gateway.registry.candidates_now = [candidate("drn_1"), candidate("drn_2")]
    delivery_id = await gateway.planned()
    answer = await gateway.report(
        delivery_id, "REFUSED", seq=1, code="NOT_AT_START", detail="it is elsewhere"
    )
    assert answer.status_code == 204, answer.text
    delivery = await gateway.get(delivery_id)
    assert (delivery["state"], delivery["attempt"]) == ("REQUESTED", 2)
    assert delivery["flags"]["replanning"]
    assert delivery["missions"] == []

    assert await gateway.book_next()
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "PLANNED"
    assert [mission["drone_id"] for mission in delivery["missions"]] == ["drn_2"]
    assert not delivery["flags"]["replanning"]
    assert gateway.registry.queries[-1].excluded_drone_ids == ("drn_1",)


async def test_after_five_refusals_the_delivery_is_rejected(
    gateway: Gateway, candidate: Callable[..., Any]
) -> None:
    gateway.registry.candidates_now = [candidate(f"drn_{number}") for number in range(1, 9)]
    delivery_id = await gateway.planned()
    for attempt in range(1, 6):
        mission = gateway.composition.booked[delivery_id, attempt]
        gateway.composition.booked[delivery_id, attempt] = mission.model_copy(
            update={"state": "REFUSED"}
        )
        await gateway.report(delivery_id, "REFUSED", seq=1, attempt=attempt, code="EXPIRED")
        # At the fifth refusal composition cannot close the delivery at first.
        gateway.composition.is_away = attempt == 5
        await gateway.book_next()
    gateway.composition.is_away = False
    gateway.clock.advance(timedelta(hours=2))
    await gateway.book_next()
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "REJECTED"
    assert gateway.composition.booking_count == 5
    assert [one["code"] for one in delivery["reasons"]] == ["REFUSED"] * 5
    assert [one["drone_id"] for one in delivery["refusals"]] == [f"drn_{n}" for n in range(1, 6)]


async def test_a_delivery_is_not_given_up_while_composition_holds_a_refused_mission(
    gateway: Gateway, reason: Callable[..., Any]
) -> None:
    """Composition has reported the refusal, and does not close the delivery yet."""
    delivery_id = await gateway.planned()
    await gateway.report(delivery_id, "REFUSED", seq=1, code="EXPIRED")
    gateway.registry.candidates_now = []
    gateway.registry.infeasible = [reason("OVERWEIGHT", is_temporary=False)]

    await gateway.book_next()
    at_first = (await gateway.get(delivery_id))["state"]
    mission = gateway.composition.booked[delivery_id, 1]
    refused = mission.model_copy(update={"state": "REFUSED"})
    gateway.composition.booked[delivery_id, 1] = refused
    gateway.clock.advance(timedelta(seconds=3))
    await gateway.book_next()

    assert (at_first, (await gateway.get(delivery_id))["state"]) == ("REQUESTED", "REJECTED")
    assert delivery_id in gateway.composition.closed


async def _claimed(gateway: Gateway) -> Any:
    return await gateway.parts.booker.claim(limit=9)


async def _ask(gateway: Gateway, queued: Any) -> Any:
    """Book a delivery in composition and stop before anything is written here."""
    from skyway_gateway.deliveries.booking.booking_round import booking_request, candidate_query

    found = await gateway.registry.candidates(candidate_query(queued))
    asked = booking_request(queued.delivery, found.shortlist)
    return await gateway.composition.book(queued.delivery.delivery_id, asked)
