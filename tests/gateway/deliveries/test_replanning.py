"""Plans that change during a mission, and the events that customers get."""

from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any

from skyway_verifier.gateway.rules import RULES

from skyway.delivery.offer import Price
from tests.broken_rules import broken_rules
from tests.gateway.whole_gateway import Gateway, make_request


async def under_way(gateway: Gateway, *, packages: int = 1, **changes: Any) -> str:
    delivery_id = str(await gateway.accepted(packages=packages, **changes))
    return await started(gateway, delivery_id)


async def started(gateway: Gateway, delivery_id: str) -> str:
    """Book a delivery and report that its packages are on board."""
    await gateway.book_next()
    for seq, kind in enumerate(("ACCEPTED", "LOADING", "LOADED"), start=1):
        assert (await gateway.report(delivery_id, kind, seq=seq)).status_code == 204
    return delivery_id


def later(mission: Any, **by: float) -> Any:
    """The next revision of a mission, with later ETAs."""
    etas = tuple(
        eta.model_copy(update={"eta_at": eta.eta_at + timedelta(**by)}) for eta in mission.packages
    )
    revision = mission.revision + 1
    return mission.model_copy(update={"revision": revision, "packages": etas, "state": "ACTIVE"})


async def test_replanning_is_flagged_until_there_is_a_new_plan(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    delivery_id = await under_way(gateway)
    await gateway.report(delivery_id, "REPLANNING", seq=4, code="STATION_CLOSED")
    delivery = await gateway.get(delivery_id)
    assert delivery["flags"] == {"delayed": False, "replanning": True}
    assert delivery["missions"][0]["is_replanning"]

    revised = later(gateway.composition.booked[delivery_id, 1], minutes=30)
    await gateway.report(
        delivery_id, "REPLANNED", seq=5, mission=revised, code="STATION_CLOSED", detail="bulverde"
    )
    delivery = await gateway.get(delivery_id)
    assert delivery["flags"] == {"delayed": True, "replanning": False}
    assert delivery["missions"][0]["revision"] == 2
    replanned, delayed = (await gateway.events(delivery_id))[-2:]
    assert (replanned["type"], delayed["type"]) == ("delivery.replanned", "delivery.delayed")
    assert replanned["data"]["code"] == "STATION_CLOSED"
    [reported] = replanned["data"]["packages"]
    assert (reported["package_id"], reported["later_s"]) == ("p1", 1800)
    assert reported["promised_at"] < reported["eta_at"]


async def test_the_price_falls_when_the_drone_has_loaded_for_others_too(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    requested = (await gateway.post(make_request())).json()
    delivery_id, page = requested["delivery_id"], requested["tracking_url"]
    await gateway.book_next()
    alone = (await gateway.http.get(f"{page}/state")).json()
    before = (await gateway.get(delivery_id))["price"]
    mission = gateway.composition.booked[delivery_id, 1]
    pooled = Price.model_validate(before).plus("POOLED", -(before["amount"] // 2))
    loaded = mission.model_copy(update={"is_pooled": True, "price": pooled})
    await gateway.report(delivery_id, "ACCEPTED", seq=1)
    await gateway.report(delivery_id, "LOADING", seq=2)
    await gateway.report(delivery_id, "LOADED", seq=3, mission=loaded)

    delivery = await gateway.get(delivery_id)
    assert delivery["price"] == pooled.model_dump(mode="json")
    assert delivery["missions"][0]["is_pooled"]
    event = next(
        each for each in await gateway.events(delivery_id) if each["type"] == "delivery.loaded"
    )
    assert (event["data"]["is_pooled"], event["data"]["price"]) == (
        True,
        pooled.model_dump(mode="json"),
    )
    shared = (await gateway.http.get(f"{page}/state")).json()
    assert (alone["is_shared"], shared["is_shared"]) == (False, True)
    assert await broken_rules(gateway.parts.db, RULES, wall_at=gateway.clock.wall_now()) == []


async def test_a_package_that_a_new_plan_leaves_out_has_no_eta_in_its_event(
    gateway: Gateway,
) -> None:
    delivery_id = await under_way(gateway)
    mission = gateway.composition.booked[delivery_id, 1]
    given_up = later(mission).model_copy(update={"packages": (), "given_up": "OUT_OF_RANGE"})

    await gateway.report(
        delivery_id, "REPLANNED", seq=4, mission=given_up, code="ZONE_AHEAD", detail="a fire"
    )

    reported = (await gateway.events(delivery_id))[-1]["data"]
    assert (reported["code"], reported["given_up"]) == ("ZONE_AHEAD", "OUT_OF_RANGE")
    [package] = reported["packages"]
    assert (package["package_id"], package["eta_at"], package["later_s"]) == ("p1", None, None)
    assert (await gateway.get(delivery_id))["packages"][0]["eta_at"] is None


async def test_times_count_from_the_start_that_was_booked_first(gateway: Gateway) -> None:
    """The promise was ten minutes; the new plan starts after them."""
    delivery_id = await under_way(gateway)
    mission = gateway.composition.booked[delivery_id, 1]
    restarted = later(mission, minutes=30).model_copy(
        update={"start_at": mission.start_at + timedelta(minutes=15)}
    )
    await gateway.report(delivery_id, "REPLANNED", seq=4, mission=restarted, code="ZONE_AHEAD")
    gateway.clock.advance(timedelta(minutes=41))
    await gateway.report(delivery_id, "DELIVERED", seq=5, package_ids=["p1"])
    completed = (await gateway.events(delivery_id))[-1]
    assert completed["type"] == "delivery.completed"
    planned, actual = completed["data"]["planned"], completed["data"]["actual"]
    assert (planned["delivery_time_s"], actual["delivery_time_s"]) == (600, 2400)


async def test_replanning_ends_only_when_all_missions_have_new_plans(
    gateway: Gateway, candidate: Callable[..., Any]
) -> None:
    gateway.composition.packages_per_trip = 1
    gateway.registry.candidates_now = [candidate("drn_1"), candidate("drn_2")]
    delivery_id = await gateway.accepted(packages=2)
    await gateway.book_next()

    async def is_replanning() -> bool:
        return bool((await gateway.get(delivery_id))["flags"]["replanning"])

    for trip in (1, 2):
        await gateway.report(delivery_id, "ACCEPTED", seq=1, trip=trip)
        await gateway.report(delivery_id, "REPLANNING", seq=2, trip=trip, code="ZONE")
    first, second = gateway.composition.trips_of(delivery_id, 1)
    await gateway.report(delivery_id, "REPLANNED", seq=3, trip=1, mission=later(first, minutes=1))
    assert await is_replanning()
    await gateway.report(delivery_id, "REPLANNED", seq=3, trip=2, mission=later(second, minutes=1))
    assert not await is_replanning()


async def test_an_ended_mission_is_no_longer_replanning(
    gateway: Gateway, candidate: Callable[..., Any]
) -> None:
    gateway.composition.packages_per_trip = 1
    gateway.registry.candidates_now = [candidate("drn_1"), candidate("drn_2")]
    delivery_id = await gateway.accepted(packages=2)
    await gateway.book_next()
    await gateway.report(delivery_id, "ACCEPTED", seq=1)
    await gateway.report(delivery_id, "REPLANNING", seq=2, code="ZONE")
    await gateway.report(delivery_id, "ENDED", seq=3, mission_state="ABORTED", code="NO_PLAN")
    assert not (await gateway.get(delivery_id))["flags"]["replanning"]


async def test_an_eta_after_the_deadline_is_a_delay_immediately(gateway: Gateway) -> None:
    """Ten minutes of flight from 12:01 on, with one second of margin."""
    delivery_id = await under_way(gateway, qos={"deadline_at": "2026-03-01T12:11:01Z"})
    mission = gateway.composition.booked[delivery_id, 1]
    etas = [eta.model_dump() for eta in later(mission, seconds=2).packages]
    await gateway.report(delivery_id, "ACTIVITY", seq=4, activity="WAITING", etas=etas)
    assert (await gateway.get(delivery_id))["flags"]["delayed"]
    last = (await gateway.events(delivery_id))[-1]
    assert last["type"] == "delivery.delayed"
    [reported] = last["data"]["packages"]
    assert (reported["late_s"], reported["deadline_at"]) == (2, "2026-03-01T12:11:01.000Z")


async def test_an_eta_after_the_window_of_a_package_is_a_delay_immediately(
    gateway: Gateway,
) -> None:
    delivery_id = await under_way(gateway, window={"latest_at": "2026-03-01T12:11:01Z"})
    mission = gateway.composition.booked[delivery_id, 1]
    etas = [eta.model_dump() for eta in later(mission, seconds=2).packages]

    await gateway.report(delivery_id, "ACTIVITY", seq=4, activity="WAITING", etas=etas)

    last = (await gateway.events(delivery_id))[-1]
    assert last["type"] == "delivery.delayed"
    assert last["data"]["packages"][0]["latest_at"] == "2026-03-01T12:11:01.000Z"


async def test_a_passed_eta_without_reports_is_one_delay_event(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await under_way(gateway)
    watch = gateway.parts.overdue_notifier
    gateway.clock.advance(timedelta(minutes=11, seconds=59))
    await watch.step()
    assert not (await gateway.get(delivery_id))["flags"]["delayed"]
    gateway.clock.advance(timedelta(seconds=3))
    for _ in range(3):
        assert not await watch.step()
        gateway.clock.advance(timedelta(minutes=5))
    delivery = await gateway.get(delivery_id)
    assert delivery["flags"]["delayed"]
    assert delivery["packages"][0]["eta_at"] > delivery["packages"][0]["promised_at"]
    assert (await gateway.event_types(delivery_id)).count("delivery.delayed") == 1

    await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1"])
    assert (await gateway.get(delivery_id))["state"] == "COMPLETED"


async def test_delivered_and_ended_packages_are_never_overdue(gateway: Gateway) -> None:
    delivery_id = await under_way(gateway, packages=2)
    await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1"])
    gateway.clock.advance(timedelta(minutes=15))
    await gateway.parts.overdue_notifier.step()
    assert not (await gateway.get(delivery_id))["flags"]["delayed"]
    await gateway.report(delivery_id, "DELIVERED", seq=5, package_ids=["p2"])
    gateway.clock.advance(timedelta(hours=1))
    await gateway.parts.overdue_notifier.step()
    assert "delivery.delayed" not in await gateway.event_types(delivery_id)


async def test_an_absent_recipient_sends_the_package_to_the_alternative(gateway: Gateway) -> None:
    request = make_request()
    request["packages"][0]["alternative"] = {"station_id": "san-antonio"}
    delivery_id = await started(gateway, (await gateway.post(request)).json()["delivery_id"])
    mission = gateway.composition.booked[delivery_id, 1]
    await gateway.report(delivery_id, "REPLANNING", seq=4, code="RECIPIENT_ABSENT")
    revised = later(mission, minutes=20)
    await gateway.report(delivery_id, "REPLANNED", seq=5, mission=revised, code="RECIPIENT_ABSENT")
    await gateway.report(
        delivery_id, "DELIVERED", seq=6, package_ids=["p1"], station_id="san-antonio"
    )
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "COMPLETED"
    [package] = delivery["packages"]
    assert package["custodian"] == {"kind": "RECIPIENT", "id": "san-antonio"}
    assert package["proof"]["station_id"] == "san-antonio"


async def test_an_absent_recipient_without_alternative_fails_the_delivery_with_the_reason(
    gateway: Gateway,
) -> None:
    delivery_id = await under_way(gateway)
    why: dict[str, Any] = {"code": "RECIPIENT_ABSENT", "detail": "nobody took p1"}
    await gateway.report(delivery_id, "RETURNING", seq=4, package_ids=["p1"], **why)
    await gateway.report(
        delivery_id, "RETURNED", seq=5, package_ids=["p1"], station_id="san-marcos"
    )
    failed = (await gateway.events(delivery_id))[-1]
    assert failed["type"] == "delivery.failed"
    assert {name: failed["data"][name] for name in why} == why


async def test_a_delivered_package_stays_delivered_after_later_reports(gateway: Gateway) -> None:
    delivery_id = await under_way(gateway, packages=2)
    await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1"])
    for seq, kind in enumerate(("RETURNING", "RETURNED", "DELIVERED", "RELEASED"), start=5):
        answer = await gateway.report(
            delivery_id, kind, seq=seq, package_ids=["p1"], station_id="san-marcos"
        )
        assert answer.status_code == 204
    package, _ = (await gateway.get(delivery_id))["packages"]
    assert (package["state"], package["custodian"]["id"]) == ("DELIVERED", "mcqueeney")


async def test_a_returning_package_is_stranded_when_its_drone_is_lost(
    gateway: Gateway,
) -> None:
    delivery_id = await under_way(gateway)
    await gateway.report(delivery_id, "RETURNING", seq=4, package_ids=["p1"], code="ABSENT")
    await gateway.report(delivery_id, "ENDED", seq=5, mission_state="ABORTED", code="LOST")
    delivery = await gateway.get(delivery_id)
    assert (delivery["state"], delivery["packages"][0]["state"]) == ("FAILED", "STRANDED")
    assert delivery["packages"][0]["custodian"]["kind"] == "DRONE"


async def test_a_waiting_mission_moves_to_another_drone_without_news_for_the_customer(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    delivery_id = str(await gateway.accepted())
    await gateway.book_next()
    booked = gateway.composition.booked[delivery_id, 1]
    await gateway.report(delivery_id, "QUEUED", seq=1, mission_state="QUEUED")
    before = await gateway.event_types(delivery_id)

    moved = booked.model_copy(update={"drone_id": "drn_other", "state": "QUEUED"})
    answer = await gateway.report(
        delivery_id,
        "RETIMED",
        seq=2,
        mission=moved,
        drone_before=booked.drone_id,
        mission_state="QUEUED",
        drone_id="drn_other",
    )

    assert answer.status_code == 204
    (shown,) = (await gateway.get(delivery_id))["missions"]
    assert shown["drone_id"] == "drn_other"
    assert await gateway.event_types(delivery_id) == before
    assert await broken_rules(gateway.parts.db, RULES, wall_at=gateway.clock.wall_now()) == []


async def test_a_provisional_promise_becomes_that_of_the_plan_when_it_is_firm(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    qos = {"firm_within_s": 600, "may_be_later_s": 300}
    delivery_id = str(await gateway.accepted(qos=qos))
    await gateway.book_next()
    booked = gateway.composition.booked[delivery_id, 1]
    moved = later(booked, minutes=30).model_copy(
        update={"state": "QUEUED", "firm_at": booked.start_at}
    )
    await gateway.report(delivery_id, "RETIMED", seq=1, mission=moved, mission_state="QUEUED")

    provisional = await gateway.get(delivery_id)
    firm = moved.model_copy(update={"firm_at": None})
    await gateway.report(delivery_id, "PROMISED", seq=2, mission=firm, mission_state="QUEUED")
    delivery = await gateway.get(delivery_id)

    assert provisional["promise"]["state"] == "PROVISIONAL"
    assert not provisional["flags"]["delayed"]
    assert delivery["promise"] == {"state": "FIRM", "firm_at": None}
    ((package,), (eta,)) = delivery["packages"], firm.packages
    assert datetime.fromisoformat(package["promised_at"]) == eta.eta_at
    assert datetime.fromisoformat(package["due_at"]) == eta.eta_at + timedelta(minutes=5)
    promised = (await gateway.events(delivery_id))[-1]
    assert promised["type"] == "delivery.promised"
    due_at = promised["data"]["packages"][0]["due_at"]
    assert datetime.fromisoformat(due_at) == datetime.fromisoformat(package["due_at"])
    assert await broken_rules(gateway.parts.db, RULES, wall_at=gateway.clock.wall_now()) == []
