"""GET /v1/stats/deliveries: numbers worked out by hand, on both databases."""

from datetime import datetime, timedelta
from typing import Any

import pytest

from skyway.units import moment_to_ms
from tests.gateway.whole_gateway import Gateway

DAY = datetime.fromisoformat("2026-03-01T00:00:00+00:00")


async def insert(gateway: Gateway, table: str, **values: object) -> None:
    names = ", ".join(values)
    places = ", ".join(f":{name}" for name in values)
    await gateway.execute(f"INSERT INTO {table} ({names}) VALUES ({places})", **values)


async def add_delivery(
    gateway: Gateway, delivery_id: str, *, state: str, created: timedelta
) -> None:
    """A delivery that was requested this long after the day began."""
    gateway.is_damaged = True  # it has no events
    at_ms = moment_to_ms(DAY + created)
    await insert(
        gateway,
        "deliveries",
        delivery_id=delivery_id,
        customer_id="alice",
        state=state,
        is_delayed=False,
        is_replanning=False,
        request="{}",
        pickup_position="{}",
        created_ms=at_ms,
        updated_ms=at_ms,
        give_up_ms=at_ms,
        attempt=1,
        refusals="[]",
        reasons="[]",
        last_sequence=0,
        next_try_wall_ms=0,
    )


async def add_mission(
    gateway: Gateway,
    delivery_id: str,
    mission_id: str,
    *,
    start: timedelta,
    flown: tuple[float, float, float] | None = None,
    **values: object,
) -> None:
    """A mission that starts this long after the day began; `flown`, waited, recharged seconds."""
    flight_s, waiting_s, recharging_s = flown or (None, None, None)
    row = {
        "mission_id": mission_id,
        "delivery_id": delivery_id,
        "attempt": 1,
        "trip": 1,
        "provider_id": "prv_1",
        "drone_id": "drn_1",
        "state": "COMPLETED",
        "report_seq": 1,
        "body": "{}",
        "start_ms": moment_to_ms(DAY + start),
        "flight_s": flight_s,
        "waiting_s": waiting_s,
        "recharging_s": recharging_s,
    }
    await insert(gateway, "missions", **{**row, **values})


async def add_package(
    gateway: Gateway,
    delivery_id: str,
    package_id: str,
    *,
    mission_id: str,
    promised: timedelta,
    delivered: timedelta | None,
) -> None:
    """A package; its moments count from the beginning of the day."""
    await insert(
        gateway,
        "packages",
        delivery_id=delivery_id,
        package_id=package_id,
        number=0,
        state="DELIVERED" if delivered else "STRANDED",
        destination_station_id="mcqueeney",
        mass_kg=1.0,
        custodian_kind="RECIPIENT" if delivered else "STATION",
        custodian_id="mcqueeney",
        custody_seq=1,
        promised_ms=moment_to_ms(DAY + promised),
        delivered_ms=delivered and moment_to_ms(DAY + delivered),
        mission_id=mission_id,
    )


def after(hours: int, minutes: float = 0, seconds: float = 0) -> timedelta:
    return timedelta(hours=hours, minutes=minutes, seconds=seconds)


@pytest.fixture
async def flown(gateway_on_both: Gateway) -> Any:
    """Four deliveries of one morning.

    dlv_1, 08:10, prv_1: from 08:20; one package as promised at 08:50, one 61 s later than promised,
    at 09:01:01. dlv_2, 09:30, two trips: prv_1's package comes 60 s late, prv_2's on the second.
    dlv_3, 09:59:59.999: failed, prv_2. dlv_4, 10:00: rejected, nobody's.
    """
    gateway = gateway_on_both
    await add_delivery(gateway, "dlv_1", state="COMPLETED", created=after(8, 10))
    await add_mission(
        gateway, "dlv_1", "msn_0", start=after(7), state="REFUSED", attempt=1, drone_id="drn_9"
    )
    await add_mission(
        gateway, "dlv_1", "msn_1", start=after(8, 20), flown=(1200.0, 300.0, 600.0), attempt=2
    )
    for package_id, promised, delivered in (
        ("p1", after(8, 50), after(8, 50)),
        ("p2", after(9), after(9, 1, 1)),
    ):
        await add_package(
            gateway, "dlv_1", package_id, mission_id="msn_1", promised=promised, delivered=delivered
        )
    await add_delivery(gateway, "dlv_2", state="COMPLETED", created=after(9, 30))
    await add_mission(gateway, "dlv_2", "msn_2", start=after(9, 40), flown=(600.0, 0.0, 0.0))
    await add_mission(
        gateway,
        "dlv_2",
        "msn_3",
        start=after(9, 45),
        flown=(450.0, 300.0, 150.0),
        trip=2,
        provider_id="prv_2",
        drone_id="drn_2",
    )
    for package_id, mission_id, promised, delivered in (
        ("p1", "msn_2", after(9, 50), after(9, 51)),
        ("p2", "msn_3", after(10), after(10)),
    ):
        await add_package(
            gateway,
            "dlv_2",
            package_id,
            mission_id=mission_id,
            promised=promised,
            delivered=delivered,
        )
    await add_delivery(
        gateway, "dlv_3", state="FAILED", created=after(10) - timedelta(milliseconds=1)
    )
    await add_mission(
        gateway, "dlv_3", "msn_4", start=after(10, 5), provider_id="prv_2", drone_id="drn_3"
    )
    await add_package(
        gateway, "dlv_3", "p1", mission_id="msn_4", promised=after(10, 30), delivered=None
    )
    await add_delivery(gateway, "dlv_4", state="REJECTED", created=after(10))
    return gateway


async def stats(gateway: Gateway, query: str = "", *, by: str = "operator") -> Any:
    span = "?from=2026-03-01T08:00:00Z&to=2026-03-01T11:00:00Z"
    path = f"/v1/stats/deliveries{span}{query}"
    answer = await gateway.http.get(path, headers=getattr(gateway, by))
    assert answer.status_code == 200, answer.text
    return answer.json()


async def test_numbers_of_a_whole_morning(flown: Any) -> None:
    found = await stats(flown)

    assert (found["from"], found["to"]) == ("2026-03-01T08:00:00Z", "2026-03-01T11:00:00Z")
    assert found["deliveries"] == 4
    assert found["by_state"] == {"COMPLETED": 2, "FAILED": 1, "REJECTED": 1}
    assert (found["packages_delivered"], found["packages_on_time"]) == (4, 3)
    assert found["on_time_share"] == 0.75
    # dlv_1: planned 08:20 to 09:00, came 61 s later; dlv_2: 09:40 to 10:00, as planned.
    assert found["planned_s"] == (2400 + 1200) / 2
    assert found["actual_s"] == (2461 + 1200) / 2
    # From 08:10 to 09:01:01, and from 09:30 to 10:00.
    assert found["since_request_s"] == (3061 + 1800) / 2
    # msn_1: 08:20 to 09:01:01; msn_2: 09:40 to 09:51; msn_3: 09:45 to 10:00.
    carried_s = 2461 + 660 + 900
    assert found["flying_share"] == pytest.approx((1200 + 600 + 450) / carried_s)
    assert found["waiting_share"] == pytest.approx((300 + 300) / carried_s)
    assert found["recharging_share"] == pytest.approx((600 + 150) / carried_s)
    assert found["buckets"] == []


async def test_hours_without_deliveries_have_a_bucket(flown: Any) -> None:
    found = await stats(flown, "&bucket=hour")

    assert [bucket["from"][11:16] for bucket in found["buckets"]] == ["08:00", "09:00", "10:00"]
    assert [bucket["to"][11:16] for bucket in found["buckets"]] == ["09:00", "10:00", "11:00"]
    assert [bucket["by_state"] for bucket in found["buckets"]] == [
        {"COMPLETED": 1},
        {"COMPLETED": 1, "FAILED": 1},
        {"REJECTED": 1},
    ]
    eight, nine, ten = found["buckets"]
    assert (eight["on_time_share"], nine["on_time_share"], ten["on_time_share"]) == (0.5, 1.0, None)
    assert (eight["actual_s"], nine["actual_s"], ten["actual_s"]) == (2461.0, 1200.0, None)
    assert eight["waiting_share"] == pytest.approx(300 / 2461)
    whole = await stats(flown)
    assert {name: found[name] for name in whole if name not in ("bucket", "buckets")} == {
        name: whole[name] for name in whole if name not in ("bucket", "buckets")
    }


async def test_days_are_days_of_utc_cut_to_the_span(flown: Any) -> None:
    span = "?from=2026-02-28T12:00:00Z&to=2026-03-01T09:30:00Z&bucket=day"
    answer = await flown.http.get(f"/v1/stats/deliveries{span}", headers=flown.operator)
    found = [(one["from"], one["to"], one["deliveries"]) for one in answer.json()["buckets"]]
    assert found == [
        ("2026-02-28T12:00:00Z", "2026-03-01T00:00:00Z", 0),
        ("2026-03-01T00:00:00Z", "2026-03-01T09:30:00Z", 1),
    ]


@pytest.mark.parametrize(("by", "query"), [("operator", "&provider_id=prv_1"), ("provider", "")])
async def test_a_provider_sees_numbers_of_its_own_deliveries(
    flown: Any, by: str, query: str
) -> None:
    found = await stats(flown, query, by=by)

    assert found["provider_id"] == "prv_1"
    assert found["by_state"] == {"COMPLETED": 2}
    # Of dlv_2 the package that prv_1 carried.
    assert (found["packages_delivered"], found["packages_on_time"]) == (3, 2)
    carried_s = 2461 + 660
    assert found["flying_share"] == pytest.approx((1200 + 600) / carried_s)
    assert found["recharging_share"] == pytest.approx(600 / carried_s)


async def test_requests_that_wait_for_a_drone_are_counted_by_age(flown: Any) -> None:
    now_ms = moment_to_ms(flown.clock.now())
    ages_s = {"dlv_1": 60, "dlv_2": 61, "dlv_3": 7200, "dlv_4": 0}
    for delivery_id, age_s in ages_s.items():
        await flown.execute(
            "UPDATE deliveries SET waits_since_ms = :since_ms WHERE delivery_id = :delivery_id",
            since_ms=now_ms - 1000 * age_s,
            delivery_id=delivery_id,
        )

    waiting = (await stats(flown))["waiting"]

    assert (waiting["requests"], waiting["oldest_s"]) == (4, 7200.0)
    assert [(each["up_to_s"], each["requests"]) for each in waiting["by_age"]] == [
        (60, 2),
        (300, 1),
        (900, 0),
        (3600, 0),
        (None, 1),
    ]
    assert (await stats(flown, by="provider"))["waiting"] is None


async def test_no_age_is_known_when_no_request_waits(flown: Any) -> None:
    waiting = (await stats(flown))["waiting"]

    assert (waiting["requests"], waiting["oldest_s"]) == (0, None)


async def test_refused_missions_do_not_count(flown: Any) -> None:
    await flown.execute("UPDATE missions SET provider_id = 'prv_9' WHERE mission_id = 'msn_0'")
    assert (await stats(flown, "&provider_id=prv_9"))["deliveries"] == 0


async def test_customers_see_no_statistics_and_providers_only_their_own(gateway: Gateway) -> None:
    path = "/v1/stats/deliveries"
    for headers, query, status in (
        (gateway.customer, "", 403),
        (gateway.provider, "?provider_id=prv_1", 200),
        (gateway.provider, "?provider_id=prv_2", 404),
        (gateway.operator, "?provider_id=prv_2", 200),
    ):
        answer = await gateway.http.get(path + query, headers=headers)
        assert answer.status_code == status


async def test_shares_are_null_without_deliveries(gateway: Gateway) -> None:
    answer = await gateway.http.get("/v1/stats/deliveries", headers=gateway.operator)
    found = answer.json()
    assert (found["from"], found["to"]) == ("2026-02-28T12:00:00Z", "2026-03-01T12:00:00Z")
    assert (found["deliveries"], found["by_state"]) == (0, {})
    assert (found["on_time_share"], found["planned_s"], found["waiting_share"]) == (None,) * 3


@pytest.mark.parametrize(
    ("query", "field"),
    [
        ("?from=2026-03-01T12:00:00Z", "from"),
        ("?from=2026-03-02T00:00:00Z&to=2026-03-01T00:00:00Z", "from"),
        ("?from=2020-03-01T00:00:00Z&bucket=hour", "bucket"),
        ("?bucket=week", "bucket"),
        ("?from=yesterday", "from"),
    ],
)
async def test_an_impossible_span_is_refused_by_field(
    gateway: Gateway, query: str, field: str
) -> None:
    answer = await gateway.http.get(f"/v1/stats/deliveries{query}", headers=gateway.operator)
    assert answer.status_code == 422, answer.text
    assert answer.json()["errors"][0]["field"].endswith(field)


async def test_numbers_are_the_sums_of_mission_reports(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.planned()
    flown = {"flight_s": 500.0, "waiting_s": 60.0, "recharging_s": 100.0, "energy_j": 1.0}
    # Booked for a minute from now; promised ten minutes later, handed over eleven minutes later.
    gateway.clock.advance(timedelta(minutes=12))
    await gateway.report(delivery_id, "LOADED", seq=1)
    await gateway.report(delivery_id, "DELIVERED", seq=2, package_ids=["p1"], data={"flown": flown})
    home = {**flown, "flight_s": 5000.0}
    await gateway.report(delivery_id, "ENDED", seq=3, data={"flown": home})

    answer = await gateway.http.get("/v1/stats/deliveries", headers=gateway.operator)
    found = answer.json()
    assert found["by_state"] == {"COMPLETED": 1}
    assert (found["planned_s"], found["actual_s"], found["since_request_s"]) == (600, 660, 720)
    assert found["on_time_share"] == 1.0
    assert found["flying_share"] == pytest.approx(500 / 660)
    assert found["waiting_share"] == pytest.approx(60 / 660)
