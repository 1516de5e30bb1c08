"""Where a customer lives: shown to the customer, kept in one row, and erased with it."""

from typing import Any

import pytest
from skyway_gateway.tables import idempotency, personal_data, quotes
from sqlalchemy import select

from tests.gateway.places.small_town import location, make_town
from tests.gateway.whole_gateway import Gateway, make_request


@pytest.fixture(autouse=True)
def _town(gateway_on_both: Gateway) -> None:
    gateway_on_both.parts.networks.cached.put(make_town())


def request_body() -> dict[str, Any]:
    body = make_request(pickup={"address": "San Marcos"})
    body["packages"][0]["destination"] = location(east_m=5_200.0)
    return body


async def stored(gateway: Gateway, *columns: Any) -> str:
    """Everything in these columns."""
    async with gateway.parts.db.read() as connection:
        return str((await connection.execute(select(*columns))).all())


async def test_a_delivery_shows_its_places_and_its_answer_under_a_key_does_not(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    answer = await gateway.post(request_body(), **{"Idempotency-Key": "k"})

    delivery = await gateway.get(answer.json()["delivery_id"])

    pickup, end = delivery["places"]
    assert (pickup["fields"], pickup["requested"]["address"]) == (["pickup"], "San Marcos")
    assert pickup["served_by"] == {
        "station_id": "san-marcos",
        "name": "San Marcos",
        "walk_m": 0.0,
    }
    assert end["served_by"]["station_id"] == "bulverde"
    assert [each["station_id"] for each in end["alternatives"]] == ["mcqueeney", "san-antonio"]
    assert "places" not in answer.json()
    assert "walk_m" not in await stored(gateway, idempotency)


async def test_a_delivery_of_an_offer_shows_the_places_with_its_stations(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    answer = await gateway.http.post("/v1/quotes", json=request_body(), headers=gateway.customer)
    quote = answer.json()
    choice = {"quote_id": quote["quote_id"], "offer_id": quote["offers"][1]["offer_id"]}

    accepted = await gateway.post(choice)
    delivery = await gateway.get(accepted.json()["delivery_id"])

    end = delivery["places"][1]
    assert end["served_by"]["station_id"] == "mcqueeney"
    assert [each["station_id"] for each in end["alternatives"]] == ["bulverde", "san-antonio"]


async def test_changing_people_leaves_the_places(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = (await gateway.post(request_body())).json()["delivery_id"]
    places = (await gateway.get(delivery_id))["places"]

    changed = await gateway.http.patch(
        f"/v1/deliveries/{delivery_id}",
        json={"recipient": {"name": "Ada"}},
        headers=gateway.customer,
    )

    assert changed.json()["places"] == places
    assert (await gateway.get(delivery_id))["places"] == places


async def test_a_place_goes_when_the_package_goes_elsewhere(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = (await gateway.post(request_body())).json()["delivery_id"]
    elsewhere = location(east_m=6_000.0)

    async def change(**package: Any) -> Any:
        body = {"packages": [{"package_id": "p1", **package}]}
        path = f"/v1/deliveries/{delivery_id}"
        answer = await gateway.http.patch(path, json=body, headers=gateway.customer)
        assert answer.status_code == 200, answer.text
        return answer.json()

    moved = await change(destination=elsewhere)
    named = await change(destination={"station_id": "mcqueeney"})

    pickup, end = moved["places"]
    assert (pickup["fields"], end["fields"]) == (["pickup"], ["packages.0.destination"])
    assert end["requested"]["location"] == elsewhere["location"]
    assert moved["packages"][0]["destination"] == {"station_id": end["served_by"]["station_id"]}
    assert [each["fields"] for each in named["places"]] == [["pickup"]]


async def test_erasing_personal_data_erases_places_also_those_of_the_quote(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    for _ in range(2):
        answer = await gateway.http.post(
            "/v1/quotes", json=request_body(), headers=gateway.customer
        )
    quote = answer.json()
    choice = {"quote_id": quote["quote_id"], "offer_id": quote["offers"][0]["offer_id"]}
    delivery_id = (await gateway.post(choice)).json()["delivery_id"]

    erased = await gateway.http.delete(
        f"/v1/deliveries/{delivery_id}/personal-data", headers=gateway.customer
    )

    assert erased.json()["fields"] == ["places"]
    assert (await gateway.get(delivery_id))["places"] == []
    assert "walk_m" not in await stored(gateway, personal_data.c.details)
    # The other quote was not accepted, and keeps its places.
    assert (await stored(gateway, quotes.c.places)).count("San Marcos") == 1
    shown = await gateway.http.get(f"/v1/quotes/{quote['quote_id']}", headers=gateway.customer)
    assert shown.json()["places"] == []
