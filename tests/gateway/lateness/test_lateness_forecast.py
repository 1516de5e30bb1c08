"""The gateway learns from delivered packages, gives new ones a P90, and is held to its promise."""

from collections import Counter
from datetime import datetime, timedelta
from typing import Any

import pytest
from skyway_gateway.deliveries.reading.statistics import promises_of
from skyway_gateway.delivery_tables import packages
from skyway_gateway.gauges import GatewayGauges
from skyway_gateway.lateness.store import MOST_OF_PROVIDER, KeptPromises, delivered_since
from sqlalchemy import insert, select, update

from skyway.contracts.margins import Margins
from skyway.delivery.lateness import (
    FEWEST,
    UNKNOWN,
    Conditions,
    KnownAir,
    PackageArrival,
    late_share,
)
from skyway.ids import NetworkId, ProviderId, StationId
from skyway.units import moment_to_ms
from tests.gateway.whole_gateway import Gateway, make_request

pytestmark = pytest.mark.databases("sqlite")


async def deliver(gateway: Gateway, *, late: timedelta) -> str:
    """A delivery whose package came so much later than promised."""
    delivery_id = await gateway.planned()
    async with gateway.parts.db.write() as tx:
        late_ms = round(late.total_seconds() * 1000)
        await tx.execute(
            update(packages)
            .where(packages.c.delivery_id == delivery_id)
            .values(delivered_ms=packages.c.promised_ms + late_ms)
        )
    return delivery_id


async def deliver_many(gateway: Gateway, many: int, *, late: timedelta) -> str:
    """A delivery with so many packages that came alike: each planned by itself would take long."""
    delivery_id = await deliver(gateway, late=late)
    async with gateway.parts.db.write() as tx:
        found = await tx.execute(select(packages).where(packages.c.delivery_id == delivery_id))
        row = dict(found.mappings().one())
        copies = [{**row, "package_id": f"alike{each}"} for each in range(1, many)]
        await tx.execute(insert(packages), copies)
    return delivery_id


def moment(package: dict[str, Any], name: str) -> datetime:
    return datetime.fromisoformat(package[name])


async def test_a_new_delivery_gets_a_p90_once_enough_packages_have_come(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    gateway.is_damaged = True  # packages that came without a report
    first = await deliver_many(gateway, FEWEST, late=timedelta(minutes=10))
    before, *_ = (await gateway.get(first))["packages"]
    forecast = gateway.parts.forecast
    for _ in range(2):
        await forecast.step()

    network_id = gateway.parts.networks.cached.network_of(StationId("san-marcos"))
    assert forecast.late_share(network_id, ProviderId("prv_new")) is not None
    assert forecast.late_share(NetworkId("elsewhere"), ProviderId("prv_new")) is None
    delivery_id = await gateway.planned()

    [package] = (await gateway.get(delivery_id))["packages"]
    assert (before["promised_p90_at"], before["eta_p90_at"]) == (None, None)
    margin = moment(package, "promised_p90_at") - moment(package, "promised_at")
    assert abs(margin - timedelta(minutes=10)) < timedelta(seconds=1)
    assert package["eta_p90_at"] == package["promised_p90_at"] == package["due_at"]
    await deliver(gateway, late=timedelta(minutes=9))
    gateway.clock.advance(timedelta(minutes=1))
    answer = await gateway.http.get("/v1/stats/deliveries", headers=gateway.operator)
    assert (answer.json()["packages_with_p90"], answer.json()["p90_share"]) == (1, 1.0)


async def test_a_package_that_is_read_twice_counts_once(gateway: Gateway) -> None:
    """Each read looks back, because reports may come late."""
    gateway.is_damaged = True
    await deliver_many(gateway, FEWEST - 1, late=timedelta(minutes=10))
    forecast = gateway.parts.forecast
    network_id = gateway.parts.networks.cached.network_of(StationId("san-marcos"))

    for _ in range(3):
        await forecast.step()
    too_few = forecast.late_share(network_id, ProviderId("prv_new"))
    await deliver(gateway, late=timedelta(minutes=10))
    await forecast.step()

    assert too_few is None
    assert forecast.late_share(network_id, ProviderId("prv_new")) is not None


async def test_a_network_learns_from_its_own_packages_alone(gateway: Gateway) -> None:
    gateway.is_damaged = True
    await deliver_many(gateway, FEWEST, late=timedelta(minutes=10))
    await gateway.execute("UPDATE deliveries SET network_id = 'north'")
    forecast = gateway.parts.forecast

    await forecast.step()

    new = ProviderId("prv_new")
    shares = [forecast.late_share(each, new) for each in (NetworkId("north"), NetworkId("south"))]
    assert (shares[0] is not None, shares[1]) == (True, None)
    assert forecast.late_share(None, new) is None


async def test_a_package_that_is_reported_late_still_counts(gateway: Gateway) -> None:
    """It came before the last package that was read."""
    gateway.is_damaged = True
    await deliver_many(gateway, FEWEST - 1, late=timedelta(minutes=10))
    forecast = gateway.parts.forecast
    await forecast.step()
    await deliver(gateway, late=timedelta(minutes=5))

    await forecast.step()

    network_id = gateway.parts.networks.cached.network_of(StationId("san-marcos"))
    assert forecast.late_share(network_id, ProviderId("prv_new")) is not None


async def teach(gateway: Gateway) -> None:
    """Let the gateway learn that packages come ten minutes late."""
    gateway.is_damaged = True
    await deliver_many(gateway, FEWEST, late=timedelta(minutes=10))
    await gateway.parts.forecast.step()


@pytest.mark.parametrize(
    ("asked", "late_min", "is_late"),
    [({}, 9, False), ({"promise": "P90"}, 12, True), ({"promise": "P50"}, 9, True)],
)
async def test_lateness_counts_from_the_promise_that_was_asked(
    gateway: Gateway, asked: dict[str, str], late_min: int, is_late: bool
) -> None:
    await teach(gateway)
    since = gateway.clock.now() + timedelta(seconds=1)
    gateway.clock.advance(timedelta(seconds=2))
    delivery_id = await gateway.accepted(qos={"objective": "FASTEST", **asked})
    while await gateway.book_next():
        pass
    [package] = (await gateway.get(delivery_id))["packages"]
    due = "promised_at" if asked.get("promise") == "P50" else "promised_p90_at"
    assert package["due_at"] == package[due]
    planned = (await gateway.events(delivery_id))[-1]["data"]["packages"][0]
    assert moment(planned, "due_at") == moment(package, "due_at")

    for seq, kind in enumerate(("ACCEPTED", "LOADING", "LOADED"), start=1):
        await gateway.report(delivery_id, kind, seq=seq)
    eta_at = moment(package, "promised_at") + timedelta(minutes=late_min)
    late = [{"package_id": "p1", "eta_at": eta_at}]
    await gateway.report(delivery_id, "ACTIVITY", seq=4, etas=late)

    assert (await gateway.get(delivery_id))["flags"]["delayed"] == is_late
    last = (await gateway.events(delivery_id))[-1]
    assert (last["type"] == "delivery.delayed") == is_late
    if is_late:
        late_s = (eta_at - moment(package, "due_at")).total_seconds()
        assert last["data"]["packages"][0]["late_s"] == pytest.approx(late_s)
    await deliver_at(gateway, delivery_id, eta_at)
    answer = await gateway.http.get(
        "/v1/stats/deliveries", params={"from": since.isoformat()}, headers=gateway.operator
    )
    assert answer.json()["on_time_share"] == (0.0 if is_late else 1.0)


@pytest.mark.long
async def test_what_one_customer_allows_makes_no_promise_to_others_later(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    gateway.is_damaged = True
    for _ in range(FEWEST):
        await deliver(gateway, late=timedelta(minutes=10))
    await gateway.parts.forecast.step()
    before = await gateway.get(await gateway.planned())
    # The packages of `deliver` were delivered ahead of the clock.
    late = [rule for rule in await gateway.verified() if "past is past" not in rule]
    assert late == []
    for _ in range(FEWEST):
        moved = await gateway.accepted(qos={"may_be_later_s": 3600})
        while await gateway.book_next():
            pass
        [package] = (await gateway.get(moved))["packages"]
        assert moment(package, "due_at") > moment(package, "promised_p90_at")
        await deliver_at(gateway, moved, moment(package, "due_at"))
    assert [rule for rule in await gateway.verified() if "due" in rule] == []
    await gateway.parts.forecast.step()

    after = await gateway.get(await gateway.planned())
    margins = [
        moment(package, "promised_p90_at") - moment(package, "promised_at")
        for package in (*before["packages"], *after["packages"])
    ]
    assert margins[1] == margins[0]
    answer = await gateway.http.get("/v1/stats/promises", headers=gateway.operator)
    assert answer.json()["items"] == []


async def test_a_p90_is_learned_if_all_customers_allow_lateness(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    gateway.is_damaged = True
    for _ in range(FEWEST):
        delivery_id = await gateway.accepted(qos={"may_be_later_s": 3600})
        while await gateway.book_next():
            pass
        [package] = (await gateway.get(delivery_id))["packages"]
        late_at = moment(package, "promised_at") + timedelta(minutes=10)
        await deliver_at(gateway, delivery_id, late_at)
    await gateway.parts.forecast.step()

    [package] = (await gateway.get(await gateway.planned()))["packages"]

    margin = moment(package, "promised_p90_at") - moment(package, "promised_at")
    assert abs(margin - timedelta(minutes=10)) < timedelta(seconds=1)
    answer = await gateway.http.get("/v1/stats/promises", headers=gateway.operator)
    assert answer.json()["items"] == []


async def deliver_as_allowed(gateway: Gateway, *, late_s: float) -> str:
    """A delivery whose customer allows an hour more than its P90, a second after the plan."""
    gateway.is_damaged = True
    delivery_id = await deliver(gateway, late=timedelta(seconds=late_s))
    promised = packages.c.promised_ms
    moved = {"promised_p90_ms": promised + 1_000, "due_ms": promised + 3_600_000}
    async with gateway.parts.db.write() as tx:
        this = packages.c.delivery_id == delivery_id
        await tx.execute(update(packages).where(this).values(moved))
    return delivery_id


async def test_packages_that_may_come_later_say_nothing_about_kept_promises(
    gateway: Gateway,
) -> None:
    late = [10.0 * number for number in range(1, FEWEST + 1)]
    for each in late:
        delivery_id = await deliver_as_allowed(gateway, late_s=each)
    [mission] = (await gateway.get(delivery_id))["missions"]
    forecast = gateway.parts.forecast
    network_id = gateway.parts.networks.cached.network_of(StationId("san-marcos"))

    await forecast.step()

    expected = late_share(UNKNOWN, [PackageArrival(600.0, each, None) for each in late])
    assert forecast.late_share(network_id, mission["provider_id"]) == expected


async def test_packages_that_may_come_later_take_no_places_of_others(gateway: Gateway) -> None:
    strict = await deliver(gateway, late=timedelta(0))
    moved = await deliver_as_allowed(gateway, late_s=120.0)
    async with gateway.parts.db.write() as tx:
        found = await tx.execute(select(packages).where(packages.c.delivery_id == moved))
        row = dict(found.mappings().one())
        copies = [{**row, "package_id": f"q{each}"} for each in range(MOST_OF_PROVIDER)]
        await tx.execute(insert(packages), copies)

    async with gateway.parts.db.read() as connection:
        rows = await delivered_since(connection, 0, most=1_000)

    shown = Counter(each.delivery_id for each in rows)
    assert shown == {strict: 1, moved: MOST_OF_PROVIDER}


async def test_the_weather_of_the_plan_gives_a_p90_until_one_is_learned(gateway: Gateway) -> None:
    forecast = gateway.parts.forecast
    network_id = gateway.parts.networks.cached.network_of(StationId("san-marcos"))
    windy = Margins(late_share=0.25)
    provider_id = ProviderId("prv_new")

    plans = Conditions(), Conditions(late_share=0.25)
    before = [forecast.late_share(network_id, provider_id, [each]) for each in plans]
    gateway.composition.margins = windy
    [package] = (await gateway.get(await gateway.planned()))["packages"]
    await teach(gateway)

    assert before == [None, 0.25]
    margin = moment(package, "promised_p90_at") - moment(package, "promised_at")
    assert margin.total_seconds() > 60
    assert package["due_at"] == package["promised_p90_at"]
    assert forecast.late_share(network_id, provider_id, [plans[1]]) != 0.25


async def deliver_at(gateway: Gateway, delivery_id: str, at: datetime) -> None:
    async with gateway.parts.db.write() as tx:
        this = update(packages).where(packages.c.delivery_id == delivery_id)
        await tx.execute(this.values(delivered_ms=moment_to_ms(at)))
    gateway.clock.advance(timedelta(minutes=1))


async def test_offers_show_what_would_be_promised(gateway: Gateway) -> None:
    await teach(gateway)
    shown = {}
    for promise in ("P90", "P50"):
        body = make_request(qos={"objective": "FASTEST", "promise": promise})
        answer = await gateway.http.post("/v1/quotes", json=body, headers=gateway.customer)
        assert answer.status_code == 201, answer.text
        [shown[promise]] = answer.json()["offers"][0]["packages"]

    assert shown["P90"]["due_at"] == shown["P90"]["eta_p90_at"]
    assert shown["P50"]["due_at"] == shown["P50"]["eta_at"]
    assert moment(shown["P50"], "eta_p90_at") > moment(shown["P50"], "eta_at")


async def test_an_accepted_offer_keeps_its_margin(gateway: Gateway) -> None:
    await teach(gateway)
    answer = await gateway.http.post("/v1/quotes", json=make_request(), headers=gateway.customer)
    quote = answer.json()
    offer = quote["offers"][0]
    await deliver_many(gateway, FEWEST, late=timedelta(minutes=60))
    await gateway.parts.forecast.step()

    accepted = await gateway.post({"quote_id": quote["quote_id"], "offer_id": offer["offer_id"]})
    while await gateway.book_next():
        pass

    [package] = (await gateway.get(accepted.json()["delivery_id"]))["packages"]
    planned_s = max(300.0, offer["delivery_time_s"])
    margin = moment(package, "promised_p90_at") - moment(package, "promised_at")
    assert margin.total_seconds() <= offer["late_share"] * planned_s + 1
    assert package["due_at"] == package["promised_p90_at"]


async def test_an_unknown_promise_is_refused(gateway: Gateway) -> None:
    for promise in ("P99", "p90", None, 90):
        answer = await gateway.post(make_request(qos={"promise": promise}))

        assert answer.status_code == 422, answer.text
        assert "qos.promise" in answer.text


@pytest.mark.databases("sqlite", "postgresql")
async def test_kept_promises_are_shown_by_network_and_provider(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    await teach(gateway)
    exact, *_ = [await deliver(gateway, late=timedelta(minutes=each)) for each in (9, 9, 9, 30)]
    at_p90 = {"delivered_ms": packages.c.promised_p90_ms}
    async with gateway.parts.db.write() as tx:
        await tx.execute(update(packages).where(packages.c.delivery_id == exact).values(at_p90))
    old = await deliver(gateway, late=timedelta(minutes=9))
    await deliver_at(gateway, old, gateway.clock.now() - timedelta(days=2))

    answer = await gateway.http.get("/v1/stats/promises", headers=gateway.operator)
    own = await gateway.http.get("/v1/stats/promises", headers=gateway.provider)
    customer = await gateway.http.get("/v1/stats/promises", headers=gateway.customer)
    gauges = {
        (each.name, each.labels["span"]): each.value
        for each in await GatewayGauges(gateway.parts)._promises()
    }

    network, provider = answer.json()["items"]
    assert network["provider_id"] is None
    assert provider["provider_id"] is not None
    for found in (network, provider):
        assert found["day"] == {"packages": 4, "p90_share": 0.75}
        assert found["week"] == {"packages": 5, "p90_share": 0.8}
    assert {each["provider_id"] for each in own.json()["items"]} <= {"prv_1"}
    assert customer.status_code == 403
    assert gauges["skyway_promised_packages", "day"] == 4
    assert gauges["skyway_promised_packages_in_time", "week"] == 4


async def test_the_last_packages_are_shown_by_what_was_known_of_them(gateway: Gateway) -> None:
    air = KnownAir(source="FORECAST", wind_mps=8.0, temperature_c=15.0)
    gateway.composition.margins = Margins(late_share=0.25, air=air)
    await teach(gateway)
    for late_min in (1, 90):
        await deliver(gateway, late=timedelta(minutes=late_min))
    await gateway.parts.forecast.step()

    answer = await gateway.http.get("/v1/stats/promises", headers=gateway.operator)
    gauges = {each.name: each for each in await GatewayGauges(gateway.parts)._groups()}

    [group] = answer.json()["groups"]
    assert (group["known_by"], group["weather"]) == ("FORECAST", "STORMY")
    labels = gauges["skyway_p90_packages"].labels
    assert labels == {
        "known_by": "FORECAST",
        "weather": "STORMY",
        "recharges": f"{group['recharges']}",
    }
    in_time = gauges["skyway_p90_packages_in_time"].value
    assert group["p90_share"] == in_time / group["packages"] < 1.0


def make_kept(network: str, provider: str, packages: int, in_time: int) -> KeptPromises:
    return KeptPromises(
        NetworkId(network),
        ProviderId(provider),
        packages={"day": 0, "week": packages},
        in_time={"day": 0, "week": in_time},
    )


def test_a_network_sums_its_providers_and_a_provider_sees_itself() -> None:
    rows = [
        make_kept("texas", "b", 90, 90),
        make_kept("texas", "a", 10, 0),
        make_kept("city", "a", 5, 5),
    ]

    shown = [(each.network_id, each.provider_id) for each in promises_of(rows, provider_id=None)]
    own = promises_of(rows, provider_id=ProviderId("a"))

    assert shown == [("city", None), ("city", "a"), ("texas", None), ("texas", "a"), ("texas", "b")]
    assert promises_of(rows, provider_id=None)[2].week.p90_share == 0.9
    assert [(each.network_id, each.week.p90_share) for each in own] == [("city", 1.0), ("texas", 0)]
    assert {each.day.p90_share for each in own} == {None}
