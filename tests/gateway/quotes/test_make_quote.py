"""POST /v1/quotes: composition's offers get ids, expire, and reserve nothing."""

from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any

import httpx
from skyway_gateway.quotes import store

from tests.gateway.whole_gateway import Gateway


async def post(gateway: Gateway, body: object, **headers: str) -> httpx.Response:
    """POST /v1/quotes as the customer."""
    answer: httpx.Response = await gateway.http.post(
        "/v1/quotes", json=body, headers={**gateway.customer, **headers}
    )
    return answer


async def test_a_quote_holds_the_offers_in_order_and_why_others_make_none(
    gateway: Gateway,
    request_body: Callable[..., Any],
    candidate: Callable[..., Any],
    reason: Callable[..., Any],
) -> None:
    gateway.registry.candidates_now = [candidate("drn_1"), candidate("drn_2", "prv_2")]
    gateway.registry.infeasible = [reason("NO_DRONES", is_temporary=False, provider_id="prv_3")]
    gateway.composition.reasons = [reason("TOO_LATE", is_temporary=False, provider_id="prv_4")]

    answer = await post(gateway, request_body(packages=2))

    assert answer.status_code == 201
    quote = answer.json()
    assert answer.headers["location"] == f"/v1/quotes/{quote['quote_id']}"
    first, second = quote["offers"]
    assert (first["provider_id"], second["provider_id"]) == ("prv_1", "prv_2")
    assert first["offer_id"] != second["offer_id"]
    assert first["price"] == {"amount": 500, "currency": "USD"}
    assert (first["margins"]["energy_margin"], first["margins"]["pad_gap_s"]) == (0.15, 120.0)
    assert [package["package_id"] for package in first["packages"]] == ["p1", "p2"]
    expires_wall_at = gateway.clock.wall_now() + timedelta(seconds=120)
    assert {quote["expires_wall_at"], first["expires_wall_at"], second["expires_wall_at"]} == {
        expires_wall_at.isoformat().replace("+00:00", "Z")
    }
    assert [(one["provider_id"], one["code"]) for one in quote["infeasible"]] == [
        ("prv_4", "TOO_LATE"),
        ("prv_3", "NO_DRONES"),
    ]


async def test_a_quote_without_any_provider_says_so(
    gateway: Gateway, request_body: Callable[..., Any]
) -> None:
    gateway.registry.candidates_now = []

    quote = (await post(gateway, request_body())).json()

    assert quote["offers"] == []
    [reason] = quote["infeasible"]
    assert (reason["provider_id"], reason["code"]) == (None, "NO_PROVIDER")
    assert "no provider serves it" in reason["detail"]


async def test_a_quote_without_any_network_says_what_is_missing(
    gateway: Gateway, request_body: Callable[..., Any]
) -> None:
    gateway.composition.has_networks = False

    answer = await post(gateway, request_body())

    assert (answer.status_code, answer.json()["code"]) == (409, "NO_NETWORK")
    assert "skyway network import bundled" in answer.json()["detail"]


async def test_composition_is_asked_for_what_the_customer_requests(
    gateway: Gateway, request_body: Callable[..., Any]
) -> None:
    requested = request_body(packages=2, qos={"weights": {"price": 1.0}, "max_price": 900})
    requested["packages"][1]["mass_kg"] = 2.0

    await post(gateway, requested)

    [query] = gateway.composition.quote_queries
    assert query.request.qos.max_price == 900
    [asked] = gateway.registry.queries
    assert (asked.payload_kg, asked.heaviest_kg) == (2.5, 2.0)


async def test_a_quote_without_offers_says_why(
    gateway: Gateway, request_body: Callable[..., Any], reason: Callable[..., Any]
) -> None:
    gateway.registry.candidates_now = []
    gateway.registry.infeasible = [reason("BUSY", is_temporary=True)]

    quote = (await post(gateway, request_body())).json()

    assert quote["offers"] == []
    assert [one["code"] for one in quote["infeasible"]] == ["BUSY"]
    assert gateway.composition.quote_queries == []


async def test_a_quote_refuses_what_a_delivery_would_refuse(
    gateway: Gateway, request_body: Callable[..., Any]
) -> None:
    nowhere = await post(gateway, request_body(pickup={"station_id": "nowhere"}))
    past = await post(gateway, request_body(qos={"deadline_at": "2026-01-01T00:00:00Z"}))

    assert (nowhere.status_code, past.status_code) == (422, 422)
    assert nowhere.json()["errors"][0]["field"] == "pickup.station_id"
    assert past.json()["errors"][0]["field"] == "qos.deadline_at"


async def test_a_quote_fails_and_stores_nothing_while_a_service_is_away(
    gateway: Gateway, request_body: Callable[..., Any]
) -> None:
    gateway.composition.is_away = True
    away = await post(gateway, request_body(), **{"Idempotency-Key": "k"})
    gateway.composition.is_away = False
    back = await post(gateway, request_body(), **{"Idempotency-Key": "k"})

    assert (away.status_code, back.status_code) == (503, 201)


async def test_the_same_idempotency_key_gives_the_same_quote(
    gateway: Gateway, request_body: Callable[..., Any]
) -> None:
    first = await post(gateway, request_body(), **{"Idempotency-Key": "k"})
    # A later change of the fleet must not change the repeated answer.
    gateway.composition.is_away = True
    again = await post(gateway, request_body(), **{"Idempotency-Key": "k"})

    assert again.json() == first.json()


async def test_only_its_customer_and_operators_read_a_quote(
    gateway_on_both: Gateway, request_body: Callable[..., Any]
) -> None:
    gateway = gateway_on_both
    made = (await post(gateway, request_body())).json()
    path = f"/v1/quotes/{made['quote_id']}"

    for headers, status in (
        (gateway.customer, 200),
        (gateway.operator, 200),
        (gateway.other, 404),
        (gateway.provider, 403),
        ({}, 401),
    ):
        assert (await gateway.http.get(path, headers=headers)).status_code == status
    assert (await gateway.http.get(path, headers=gateway.customer)).json() == made


async def test_customers_and_operators_ask_for_quotes(
    gateway: Gateway, request_body: Callable[..., Any]
) -> None:
    for headers, status in ((gateway.provider, 403), (gateway.operator, 201)):
        answer = await gateway.http.post("/v1/quotes", json=request_body(), headers=headers)
        assert answer.status_code == status


async def test_only_expired_quotes_are_deleted(
    gateway_on_both: Gateway, request_body: Callable[..., Any]
) -> None:
    gateway = gateway_on_both
    old = (await post(gateway, request_body())).json()
    gateway.clock.advance(timedelta(hours=1))
    new = (await post(gateway, request_body())).json()

    async with gateway.parts.db.write() as tx:
        expired_before = datetime.fromisoformat(new["expires_wall_at"])
        await store.delete_expired(tx, before=expired_before)

    statuses = [
        (await gateway.http.get(f"/v1/quotes/{one}", headers=gateway.customer)).status_code
        for one in (old["quote_id"], new["quote_id"])
    ]
    assert statuses == [404, 200]
