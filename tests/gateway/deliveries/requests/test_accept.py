"""Accepting requests: a bad request is answered with field and limit, never with a 500."""

import asyncio
from collections.abc import Callable
from dataclasses import replace
from datetime import timedelta
from types import SimpleNamespace
from typing import Any

import pytest
from skyway_gateway.app import take_over
from skyway_gateway.deliveries.lifecycle.customer_forms import NewDelivery
from skyway_gateway.quotes.store import keep_network

from skyway.contracts.candidate import PayloadLimit
from skyway.contracts.station_check import NetworkStations
from skyway.geo import Position
from skyway.ids import NetworkId, StationId
from skyway.runtime.http.identity import Caller
from skyway.runtime.idempotency_store import KeyedCall
from tests.gateway.peers import STATIONS
from tests.gateway.whole_gateway import Gateway, make_request

Change = Callable[[dict[str, Any]], object]


def _package(**fields: object) -> dict[str, Any]:
    package = {"package_id": "p1", "mass_kg": 1.0, "destination": {"station_id": "mcqueeney"}}
    return {**package, **fields}


BAD_REQUESTS: list[tuple[str, dict[str, Any], str, str]] = [
    ("unknown pickup", {"pickup": {"station_id": "nowhere"}}, "pickup.station_id", "nowhere"),
    (
        "unknown destination",
        {"packages": [_package(destination={"station_id": "atlantis"})]},
        "packages.0.destination.station_id",
        "atlantis",
    ),
    (
        "unreachable destination",
        {"packages": [_package(), _package(package_id="p2", destination={"station_id": "island"})]},
        "packages.1.destination.station_id",
        "no path of segments",
    ),
    (
        "destination in another network",
        {"packages": [_package(destination={"station_id": "dallas"})]},
        "packages.0.destination.station_id",
        "'dallas' lies in the network 'north', the pickup 'san-marcos' in 'corridor'",
    ),
    (
        "destination at the pickup",
        {"packages": [_package(destination={"station_id": "san-marcos"})]},
        "packages.0.destination.station_id",
        "'san-marcos' is the pickup",
    ),
    ("no packages", {"packages": []}, "packages", "at least one package"),
    (
        "too many packages",
        {"packages": [_package(package_id=f"p{n}") for n in range(101)]},
        "packages",
        "at most 100 items",
    ),
    (
        "too many destinations",
        {
            "packages": [
                _package(package_id=f"p{n}", destination={"station_id": f"s{n}"}) for n in range(49)
            ]
        },
        "packages",
        "limit of 48",
    ),
    ("same package twice", {"packages": [_package(), _package()]}, "packages", "is given 2 times"),
    (
        "negative mass",
        {"packages": [_package(mass_kg=-1)]},
        "packages.0.mass_kg",
        "must be at least 0",
    ),
    (
        "overweight package",
        {"packages": [_package(mass_kg=5.2)]},
        "packages.0.mass_kg",
        "5.2 kg exceeds the 5 kg limit of drone model lifter",
    ),
    (
        "unknown alternative",
        {"packages": [_package(alternative={"station_id": "atlantis"})]},
        "packages.0.alternative.station_id",
        "atlantis",
    ),
    (
        "unreachable alternative",
        {"packages": [_package(alternative={"station_id": "island"})]},
        "packages.0.alternative.station_id",
        "no path of segments",
    ),
    (
        "objective and weights",
        {"qos": {"objective": "FASTEST", "weights": {"time": 1}}},
        "qos",
        "exclude each other",
    ),
    (
        "provider pinned and denied",
        {"qos": {"providers": {"pinned": "prv_1", "denied": ["prv_1"]}}},
        "qos.providers",
        "denied",
    ),
    (
        "deadline in the past",
        {"qos": {"deadline_at": "2026-03-01T11:59:59Z"}},
        "qos.deadline_at",
        "is in the past",
    ),
    (
        "pickup in the past",
        {"earliest_pickup_at": "2026-03-01T11:54:59Z"},
        "earliest_pickup_at",
        "is in the past: fleet time is 2026-03-01T12:00:00",
    ),
    (
        "deadline before the pickup",
        {
            "qos": {"deadline_at": "2026-03-01T15:00:00Z"},
            "earliest_pickup_at": "2026-03-01T16:00:00Z",
        },
        "earliest_pickup_at",
        "before the deadline",
    ),
    (
        "pickup at the end of time",
        {"earliest_pickup_at": "9999-12-31T23:59:59-14:00"},
        "earliest_pickup_at",
        "between 1970-01-01 and 9000-01-01",
    ),
    (
        "moment without a zone",
        {"earliest_pickup_at": "2026-03-01T16:00:00"},
        "earliest_pickup_at",
        "must be a moment like",
    ),
    ("unknown field", {"colour": "red"}, "colour", "is not a known field"),
    ("price below zero", {"qos": {"max_price": -1}}, "qos.max_price", "at least 0"),
    ("reference too long", {"reference": "x" * 201}, "reference", "at most 200 characters"),
]


async def test_a_bad_request_is_answered_with_field_and_limit(
    gateway: Gateway, request_body: Callable[..., dict[str, Any]], subtests: pytest.Subtests
) -> None:
    for case, changes, field, detail in BAD_REQUESTS:
        with subtests.test(case):
            answer = await gateway.post({**request_body(), **changes})

            assert answer.status_code == 422, answer.text
            assert answer.headers["content-type"] == "application/problem+json"
            problem = answer.json()
            assert problem["type"] == "urn:skyway:problem:invalid-input"
            assert [error["field"] for error in problem["errors"]] == [field]
            assert detail in problem["errors"][0]["detail"]


@pytest.mark.parametrize("mass", ["NaN", "Infinity", "-Infinity", "1e999"])
async def test_a_mass_that_is_not_a_number_is_refused(
    gateway: Gateway, request_body: Callable[..., dict[str, Any]], mass: str
) -> None:
    import json

    text = json.dumps(request_body()).replace("0.5", mass)
    headers = {**gateway.customer, "content-type": "application/json"}
    answer = await gateway.http.post("/v1/deliveries", content=text, headers=headers)
    assert answer.status_code == 422, answer.text
    assert answer.json()["errors"][0]["field"] == "packages.0.mass_kg"


@pytest.mark.parametrize("field", ["pinned", "allowed", "denied"])
async def test_an_unknown_provider_is_named(
    gateway: Gateway, request_body: Callable[..., dict[str, Any]], field: str
) -> None:
    gateway.registry.limit = PayloadLimit(
        max_payload_kg=5.0, drone_model_id="lifter", unknown_provider_ids=("prv_x",)
    )
    chosen = "prv_x" if field == "pinned" else ["prv_1", "prv_x"]
    answer = await gateway.post(request_body(qos={"providers": {field: chosen}}))
    assert answer.status_code == 422
    place = "pinned" if field == "pinned" else f"{field}.1"
    assert answer.json()["errors"][0]["field"] == f"qos.providers.{place}"


async def test_broken_json_is_a_400_and_a_large_body_a_413(gateway: Gateway) -> None:
    headers = {**gateway.customer, "content-type": "application/json"}
    broken = await gateway.http.post("/v1/deliveries", content=b'{"pickup": ', headers=headers)
    assert broken.status_code == 400
    assert broken.json()["type"] == "urn:skyway:problem:broken-json"
    large = b'{"reference": "' + b"x" * 300_000 + b'"}'
    answer = await gateway.http.post("/v1/deliveries", content=large, headers=headers)
    assert answer.status_code == 413
    assert "the body is larger than the limit of 2" in answer.json()["detail"]


async def test_customers_and_operators_with_a_key_may_request(
    gateway: Gateway, request_body: Callable[..., dict[str, Any]]
) -> None:
    body = request_body()
    for headers, status in (
        ({}, 401),
        ({"Authorization": "Bearer sk_wrong"}, 401),
        (gateway.provider, 403),
        (gateway.operator, 202),
    ):
        answer = await gateway.http.post("/v1/deliveries", json=body, headers=headers)
        assert answer.status_code == status


async def test_an_accepted_request_is_a_delivery_in_its_first_state(
    gateway_on_both: Gateway, request_body: Callable[..., dict[str, Any]]
) -> None:
    gateway = gateway_on_both
    answer = await gateway.post(request_body(packages=2, reference="order 7"))
    assert answer.status_code == 202
    delivery = answer.json()
    assert answer.headers["location"] == f"/v1/deliveries/{delivery['delivery_id']}"
    url = delivery.pop("tracking_url")
    assert url.startswith(f"http://gateway/track/{delivery['delivery_id']}/")
    found = await gateway.get(delivery["delivery_id"])
    assert {**found, **delivery} == {**found, "packages": delivery["packages"]}
    assert [
        {**one, **other} for one, other in zip(found["packages"], delivery["packages"], strict=True)
    ] == found["packages"]
    assert delivery["state"] == "REQUESTED"
    assert delivery["customer_id"] == "alice"
    assert delivery["reference"] == "order 7"
    assert delivery["flags"] == {"delayed": False, "replanning": False}
    assert {package["state"] for package in delivery["packages"]} == {"CREATED"}
    assert [package["custodian"] for package in delivery["packages"]] == [
        {"kind": "STATION", "id": "san-marcos"}
    ] * 2
    [event] = await gateway.events(delivery["delivery_id"])
    assert event["type"] == "delivery.requested"
    assert event["data"]["reference"] == "order 7"


async def test_a_request_is_accepted_while_the_registry_is_away(gateway: Gateway) -> None:
    """Nobody knows what drones can lift: booking finds out when the registry is back."""
    gateway.registry.is_away = True
    body = make_request()
    body["packages"][0]["mass_kg"] = 900

    assert (await gateway.post(body)).status_code == 202


def _all_connected(version: int, *stations: str) -> NetworkStations:
    return NetworkStations(
        network_id=NetworkId("texas"),
        version=version,
        station_ids=tuple(StationId(each) for each in stations),
        positions=(Position(0.0, 0.0),) * len(stations),
        parts=(0,) * len(stations),
    )


async def test_a_request_is_accepted_while_broker_and_composition_are_away(
    gateway: Gateway,
) -> None:
    """A lost broker makes the cached network uncertain; it is the last that is known."""
    gateway.parts.networks.cached.put(_all_connected(1, *STATIONS))
    gateway.parts.networks.forget()
    gateway.composition.is_away = True

    assert (await gateway.post(make_request())).status_code == 202


async def test_a_restarted_gateway_accepts_requests_while_composition_is_away(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    gateway.composition.is_away = True
    for stations in (_all_connected(2, *STATIONS), _all_connected(1, "old")):
        await keep_network(gateway.parts.db, stations)
    await take_over(gateway.parts)

    assert (await gateway.post(make_request())).status_code == 202


async def test_a_customer_may_repeat_the_call_after_composition_was_away(
    gateway: Gateway, request_body: Callable[..., dict[str, Any]]
) -> None:
    gateway.composition.is_away = True
    answer = await gateway.post(request_body(), **{"Idempotency-Key": "k"})
    assert answer.status_code == 503
    assert int(answer.headers["retry-after"]) >= 1
    gateway.composition.is_away = False
    assert (await gateway.post(request_body(), **{"Idempotency-Key": "k"})).status_code == 202


async def test_the_same_idempotency_key_gives_the_same_delivery(
    gateway_on_both: Gateway, request_body: Callable[..., dict[str, Any]]
) -> None:
    gateway = gateway_on_both
    deadline_at = (gateway.clock.now() + timedelta(hours=1)).isoformat()
    body = request_body(qos={"deadline_at": deadline_at})
    first = await gateway.post(body, **{"Idempotency-Key": "k"})
    gateway.clock.advance(timedelta(hours=2))
    gateway.composition.is_away = True
    again = await gateway.post(body, **{"Idempotency-Key": "k"})
    assert (again.status_code, again.json()) == (202, first.json())
    assert again.headers["location"] == first.headers["location"]
    assert (await gateway.post({**body, "reference": "x"}, **{"Idempotency-Key": "k"})).json()[
        "type"
    ] == "urn:skyway:problem:idempotency-key-reused"


async def test_two_customers_may_use_the_same_idempotency_key(
    gateway: Gateway, request_body: Callable[..., dict[str, Any]]
) -> None:
    mine = await gateway.post(request_body(), **{"Idempotency-Key": "k"})
    headers = {**gateway.other, "Idempotency-Key": "k"}
    theirs = await gateway.http.post("/v1/deliveries", json=request_body(), headers=headers)
    assert theirs.status_code == 202
    assert theirs.json()["delivery_id"] != mine.json()["delivery_id"]


async def test_no_mass_is_too_heavy_before_the_first_fleet_registers(
    gateway: Gateway, request_body: Callable[..., dict[str, Any]]
) -> None:
    gateway.registry.limit = PayloadLimit(
        max_payload_kg=None, drone_model_id=None, unknown_provider_ids=()
    )
    body = request_body(packages=1)
    body["packages"][0]["mass_kg"] = 900
    assert (await gateway.post(body)).status_code == 202


async def test_a_request_without_any_network_says_what_is_missing(gateway: Gateway) -> None:
    gateway.composition.has_networks = False

    answer = await gateway.post(make_request(pickup={"station_id": "nowhere"}))

    assert (answer.status_code, answer.json()["code"]) == (409, "NO_NETWORK")
    assert "skyway network import bundled" in answer.json()["detail"]


async def test_a_request_without_any_provider_is_accepted_with_the_reason(
    gateway: Gateway,
) -> None:
    gateway.registry.limit = PayloadLimit(
        max_payload_kg=None, drone_model_id=None, unknown_provider_ids=()
    )

    answer = await gateway.post(make_request())

    assert answer.status_code == 202
    [reason] = answer.json()["reasons"]
    assert (reason["provider_id"], reason["code"]) == (None, "NO_PROVIDER")
    assert "no provider serves it" in reason["detail"]


async def test_packages_that_are_too_heavy_together_are_accepted(
    gateway: Gateway, request_body: Callable[..., dict[str, Any]]
) -> None:
    body = request_body(packages=3)
    for package in body["packages"]:
        package["mass_kg"] = 5.0
    assert (await gateway.post(body)).status_code == 202


async def test_a_delivery_that_this_process_books_is_claimed_when_it_is_added(
    gateway_on_both: Gateway, request_body: Any
) -> None:
    """No other process books it meanwhile; if this process dies, another one does later."""
    gateway = gateway_on_both
    handed: list[Any] = []
    accepted: list[None] = []
    booking: Any = SimpleNamespace(
        claimant="bkr_1",
        is_free=True,
        begin=handed.append,
        note_accepted=lambda: accepted.append(None),
    )
    acceptance = replace(gateway.parts.acceptances.live, booking=booking)

    for _ in range(2):  # the second call repeats the first
        await acceptance.accept(
            Caller(role="customer", subject_id="alice"),
            NewDelivery.model_validate(request_body()),
            KeyedCall("customer:alice", "POST /v1/deliveries", "once", b""),
        )

    [queued], [_] = handed, accepted
    assert await gateway.parts.booker.claim(limit=9) == []
    gateway.clock.advance(timedelta(seconds=3))
    [found] = await gateway.parts.booker.claim(limit=9)
    assert found == queued
    await gateway.parts.booker.book(queued)
    delivery_id = queued.delivery.delivery_id
    assert await gateway.event_types(delivery_id) == ["delivery.requested", "delivery.planned"]
    assert await gateway.parts.booker.claim(limit=9) == []


async def test_a_running_loop_books_an_accepted_delivery_without_a_look_at_the_queue(
    gateway: Gateway,
) -> None:
    async def find_nothing(*, limit: int) -> list[Any]:
        return []

    booking, booker = gateway.parts.booking, gateway.parts.booker
    blind: Any = SimpleNamespace(
        claim=find_nothing, hold=booker.hold, book_or_retry=booker.book_or_retry, db=booker.db
    )
    running = asyncio.create_task(booking.run(blind))
    try:
        async with asyncio.timeout(60):
            while not booking.is_free:  # noqa: ASYNC110 - it is the loop that begins
                await asyncio.sleep(0)
            delivery_id = await gateway.accepted()
            while not gateway.composition.booked:  # noqa: ASYNC110 - the same
                await asyncio.sleep(0)
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
    assert [delivery for delivery, _ in gateway.composition.booked] == [delivery_id]
