"""Deliveries of several missions: each package has one, and the furthest one sets the state."""

import asyncio
import itertools
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest

from tests.gateway.whole_gateway import Gateway
from tests.long_cases import sampled


@pytest.fixture
def drones(gateway: Gateway, candidate: Callable[..., Any]) -> Any:
    """A gateway whose three drones take one package each."""
    return with_drones(gateway, candidate, 3)


def with_drones(gateway: Gateway, candidate: Callable[..., Any], count: int) -> Any:
    gateway.composition.packages_per_trip = 1
    gateway.registry.candidates_now = [candidate(f"drn_{n}") for n in range(1, count + 1)]
    return gateway


async def booked(gateway: Gateway, *, packages: int, **changes: object) -> str:
    delivery_id = str(await gateway.accepted(packages=packages, **changes))
    while await gateway.book_next():
        pass
    return delivery_id


async def reports(
    gateway: Gateway, delivery_id: str, *kinds: str, first: int = 1, **at: Any
) -> None:
    for seq, kind in enumerate(kinds, start=first):
        answer = await gateway.report(delivery_id, kind, seq=seq, **at)
        assert answer.status_code == 204, answer.text


def states(delivery: dict[str, Any]) -> list[str]:
    return [package["state"] for package in delivery["packages"]]


async def test_each_package_is_carried_by_one_of_several_missions(
    gateway_on_both: Gateway, candidate: Callable[..., Any]
) -> None:
    gateway = with_drones(gateway_on_both, candidate, 3)
    delivery_id = await booked(gateway, packages=3)
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "PLANNED"
    assert [mission["trip"] for mission in delivery["missions"]] == [1, 2, 3]
    carriers = [package["mission_id"] for package in delivery["packages"]]
    assert carriers == [mission["mission_id"] for mission in delivery["missions"]]
    assert delivery["price"]["amount"] == 3 * 1234
    _, planned = await gateway.events(delivery_id)
    assert len(planned["data"]["mission_ids"]) == 3
    assert planned["data"]["waiting_package_ids"] == []


async def test_the_mission_that_is_furthest_along_sets_the_state(drones: Any) -> None:
    delivery_id = await booked(drones, packages=3)

    async def state() -> str:
        return str((await drones.get(delivery_id))["state"])

    await reports(drones, delivery_id, "ACCEPTED", trip=2)
    assert await state() == "DISPATCHED"
    await reports(drones, delivery_id, "LOADING", first=2, trip=2)
    await reports(drones, delivery_id, "ACCEPTED", trip=1)
    assert await state() == "LOADING"
    await reports(drones, delivery_id, "LOADED", first=3, trip=2)
    await reports(drones, delivery_id, "LOADING", first=2, trip=1)
    assert await state() == "IN_PROGRESS"
    delivery = await drones.get(delivery_id)
    assert states(delivery) == ["CREATED", "LOADED", "CREATED"]
    await reports(drones, delivery_id, "LOADED", first=3, trip=1)
    await drones.report(delivery_id, "ACTIVITY", seq=4, trip=2, activity="FLYING")
    assert states(await drones.get(delivery_id)) == ["LOADED", "IN_TRANSIT", "CREATED"]
    event_types = await drones.event_types(delivery_id)
    assert event_types.count("delivery.dispatched") == event_types.count("delivery.started") == 1


async def test_a_delivery_ends_with_the_last_of_its_missions(drones: Any) -> None:
    delivery_id = await booked(drones, packages=3)
    for trip in (1, 2, 3):
        await reports(drones, delivery_id, "ACCEPTED", "LOADING", "LOADED", trip=trip)
    for trip in (2, 3, 1):
        assert (await drones.get(delivery_id))["state"] == "IN_PROGRESS"
        await drones.report(delivery_id, "DELIVERED", seq=4, trip=trip, package_ids=[f"p{trip}"])
        await drones.report(delivery_id, "ENDED", seq=5, trip=trip)
    assert (await drones.get(delivery_id))["state"] == "COMPLETED"
    event_types = await drones.event_types(delivery_id)
    assert event_types[-1] == "delivery.completed"
    assert event_types.count("package.delivered") == 3


async def test_left_over_packages_are_booked_by_a_later_attempt(
    gateway_on_both: Gateway, candidate: Callable[..., Any]
) -> None:
    gateway = with_drones(gateway_on_both, candidate, 2)
    delivery_id = await gateway.accepted(packages=3)
    assert await gateway.book_next()
    delivery = await gateway.get(delivery_id)
    assert (delivery["state"], delivery["attempt"]) == ("PLANNED", 2)
    assert delivery["packages"][2]["mission_id"] is None

    await reports(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED", trip=1)
    assert await gateway.book_next()
    assert not await gateway.book_next()
    asked = gateway.composition.asked[-1]
    assert [package.package_id for package in asked.request.packages] == ["p3"]
    assert gateway.registry.queries[-1].payload_kg == 0.5
    delivery = await gateway.get(delivery_id)
    assert (delivery["state"], delivery["attempt"]) == ("IN_PROGRESS", 2)
    assert len({package["mission_id"] for package in delivery["packages"]}) == 3
    assert (await gateway.event_types(delivery_id)).count("delivery.planned") == 2


async def test_only_the_packages_of_a_refused_trip_wait_again(drones: Any) -> None:
    delivery_id = await booked(drones, packages=3)
    await reports(drones, delivery_id, "ACCEPTED", trip=1)
    await drones.report(delivery_id, "REFUSED", seq=1, trip=2, code="NOT_AT_START")
    delivery = await drones.get(delivery_id)
    assert (delivery["state"], delivery["attempt"]) == ("DISPATCHED", 2)
    assert delivery["flags"]["replanning"]
    assert [package["mission_id"] is None for package in delivery["packages"]] == [
        False,
        True,
        False,
    ]
    await drones.report(delivery_id, "REFUSED", seq=1, trip=3, code="NOT_AT_START")
    assert (await drones.get(delivery_id))["attempt"] == 2, "asked for both in one booking"

    await drones.book_next()
    delivery = await drones.get(delivery_id)
    assert {mission["drone_id"] for mission in delivery["missions"]} == {"drn_1"}
    assert drones.registry.queries[-1].excluded_drone_ids == ("drn_2", "drn_3")


async def test_the_other_missions_set_the_state_after_a_refusal(drones: Any) -> None:
    delivery_id = await booked(drones, packages=2)
    await reports(drones, delivery_id, "ACCEPTED", trip=1)
    await drones.report(delivery_id, "REFUSED", seq=2, trip=1, code="EXPIRED")
    assert (await drones.get(delivery_id))["state"] == "PLANNED"
    await drones.report(delivery_id, "REFUSED", seq=1, trip=2, code="EXPIRED")
    assert (await drones.get(delivery_id))["state"] == "REQUESTED"


async def test_a_price_limit_is_for_the_sum_of_all_missions(drones: Any) -> None:
    delivery_id = await booked(drones, packages=2, qos={"max_price": 3000})
    assert drones.composition.asked[-1].request.qos.max_price == 3000
    await drones.report(delivery_id, "REFUSED", seq=1, trip=2, code="EXPIRED")
    await drones.book_next()
    assert drones.composition.asked[-1].request.qos.max_price == 3000 - 1234


async def test_packages_that_wait_too_long_are_given_up_and_the_others_go_on(
    gateway_on_both: Gateway, candidate: Callable[..., Any], reason: Callable[..., Any]
) -> None:
    gateway = with_drones(gateway_on_both, candidate, 1)
    delivery_id = await gateway.accepted(packages=2)
    await gateway.book_next()
    gateway.registry.candidates_now = []
    gateway.registry.infeasible = [reason("BUSY", is_temporary=True)]
    await gateway.book_next()
    await reports(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    gateway.clock.advance(timedelta(hours=2))
    await gateway.book_next()
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "IN_PROGRESS"
    assert states(delivery) == ["LOADED", "CANCELLED"]
    assert delivery["packages"][1]["code"] == "NOT_PLANNED"
    assert [one["code"] for one in delivery["reasons"]] == ["BUSY"]
    assert (await gateway.event_types(delivery_id))[-1] == "package.cancelled"
    assert not await gateway.book_next()

    await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1"])
    assert (await gateway.get(delivery_id))["state"] == "PARTIALLY_COMPLETED"


async def test_packages_wait_on_after_the_other_missions_have_ended(
    gateway: Gateway, candidate: Callable[..., Any]
) -> None:
    with_drones(gateway, candidate, 1)
    delivery_id = await gateway.accepted(packages=2)
    await gateway.book_next()
    gateway.registry.candidates_now = []
    await gateway.book_next()
    await reports(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1"])
    await gateway.report(delivery_id, "ENDED", seq=5)
    assert (await gateway.get(delivery_id))["state"] == "IN_PROGRESS"
    assert await gateway.verified() == []

    gateway.registry.candidates_now = [candidate("drn_2")]
    gateway.clock.advance(timedelta(seconds=3))
    await gateway.book_next()
    await reports(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED", attempt=2)
    await gateway.report(delivery_id, "DELIVERED", seq=4, attempt=2, package_ids=["p2"])
    assert (await gateway.get(delivery_id))["state"] == "COMPLETED"


async def test_reports_of_other_missions_do_not_hurry_the_queue(
    gateway: Gateway, candidate: Callable[..., Any]
) -> None:
    with_drones(gateway, candidate, 1)
    delivery_id = await gateway.accepted(packages=2)
    await gateway.book_next()
    gateway.registry.candidates_now = []
    await gateway.book_next()
    await reports(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    assert not await gateway.book_next()


async def test_a_mission_that_ends_takes_only_its_own_packages(drones: Any) -> None:
    delivery_id = await booked(drones, packages=3)
    for trip in (1, 2):
        await reports(drones, delivery_id, "ACCEPTED", "LOADING", "LOADED", trip=trip)
    await drones.report(
        delivery_id,
        "ENDED",
        seq=4,
        trip=1,
        mission_state="ABORTED",
        station_id="bulverde",
        stranded_package_ids=["p1"],
        code="NO_PLAN",
        detail="too low",
    )
    delivery = await drones.get(delivery_id)
    assert states(delivery) == ["STRANDED", "LOADED", "CREATED"]
    assert (delivery["packages"][0]["code"], delivery["state"]) == ("NO_PLAN", "IN_PROGRESS")


async def test_a_booking_round_keeps_reports_that_came_meanwhile(drones: Any) -> None:
    """The delivery changes between the claim of the booking loop and its write."""
    delivery_id = await drones.accepted(packages=2)
    drones.composition.packages_per_trip = 1
    drones.registry.candidates_now = drones.registry.candidates_now[:1]
    await drones.book_next()
    [queued] = await drones.parts.booker.claim(limit=1)
    await reports(drones, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    await drones.report(delivery_id, "ACTIVITY", seq=4, activity="FLYING")
    await drones.parts.booker.book(queued)
    delivery = await drones.get(delivery_id)
    assert (delivery["state"], delivery["activity"]) == ("IN_PROGRESS", "FLYING")
    assert states(delivery) == ["IN_TRANSIT", "CREATED"]
    assert len(delivery["missions"]) == 2


@pytest.mark.parametrize("order", sampled(itertools.permutations((1, 2, 3)), every=3))
async def test_reports_of_several_missions_may_mix_in_any_order(
    drones: Any, order: tuple[int, ...]
) -> None:
    delivery_id = await booked(drones, packages=3)
    waiting = [
        (trip, seq, kind)
        for trip in order
        for seq, kind in enumerate(("ACCEPTED", "LOADING", "LOADED", "DELIVERED"), start=1)
    ]
    # The last report first: each is repeated until its turn has come.
    waiting.reverse()
    while waiting:
        trip, seq, kind = waiting.pop(0)
        fields = {"package_ids": [f"p{trip}"]} if kind == "DELIVERED" else {}
        answer = await drones.report(delivery_id, kind, seq=seq, trip=trip, **fields)
        if answer.status_code == 409:
            waiting.append((trip, seq, kind))
    assert (await drones.get(delivery_id))["state"] == "COMPLETED"
    assert (await drones.event_types(delivery_id))[-1] == "delivery.completed"


async def test_concurrent_reports_leave_no_gap(
    gateway_on_both: Gateway, candidate: Callable[..., Any]
) -> None:
    gateway = with_drones(gateway_on_both, candidate, 3)
    delivery_id = await booked(gateway, packages=3)

    async def fly(trip: int) -> None:
        await reports(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED", trip=trip)
        await gateway.report(delivery_id, "DELIVERED", seq=4, trip=trip, package_ids=[f"p{trip}"])

    await asyncio.gather(*map(fly, (1, 2, 3)))
    assert (await gateway.get(delivery_id))["state"] == "COMPLETED"
    assert (await gateway.event_types(delivery_id)).count("package.delivered") == 3
