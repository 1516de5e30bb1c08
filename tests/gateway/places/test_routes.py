"""GET /v1/places shows what a request would be served by."""

import pytest

from tests.gateway.places.small_town import location, make_town
from tests.gateway.whole_gateway import Gateway


@pytest.fixture(autouse=True)
def _town(gateway: Gateway) -> None:
    gateway.parts.networks.cached.put(make_town())


async def test_a_place_has_its_stations_with_their_walks(gateway: Gateway) -> None:
    query = location(east_m=5_200.0)["location"]

    answer = await gateway.http.get("/v1/places", params=query, headers=gateway.customer)

    assert answer.status_code == 200, answer.text
    [candidate] = answer.json()["candidates"]
    assert candidate["stations"] == [
        {"station_id": "bulverde", "name": None, "walk_m": pytest.approx(100.0, abs=0.2)},
        {"station_id": "mcqueeney", "name": "Markt, Süd", "walk_m": pytest.approx(200.0, abs=0.2)},
        {"station_id": "san-antonio", "name": None, "walk_m": pytest.approx(700.0, abs=0.2)},
    ]


async def test_all_places_of_a_name_are_shown(gateway: Gateway) -> None:
    twin = make_town("twin", dallas=9_000.0)
    named = twin.model_copy(update={"names": {"dallas": "San Marcos"}})
    gateway.parts.networks.cached.put(named)

    query = {"address": "san marcos"}
    answer = await gateway.http.get("/v1/places", params=query, headers=gateway.operator)

    found = {each["stations"][0]["station_id"] for each in answer.json()["candidates"]}
    assert found == {"san-marcos", "dallas"}


@pytest.mark.parametrize(
    ("query", "why"),
    [
        ({}, "needs exactly one of"),
        ({"latitude": 29.9}, "latitude and longitude are given together"),
        ({"address": "San Marcos", "plus_code": "76X4V3M5+88"}, "it has plus_code and address"),
        ({"address": "12 Guadalupe Street"}, "no streets"),
        ({"latitude": 0, "longitude": 0}, "no station lies within max_walk_m"),
        ({"latitude": "nan", "longitude": 0}, "must be a finite number"),
    ],
)
async def test_a_wrong_query_is_refused(gateway: Gateway, query: dict[str, str], why: str) -> None:
    answer = await gateway.http.get("/v1/places", params=query, headers=gateway.customer)

    assert answer.status_code == 422
    assert why in answer.text


async def test_providers_have_no_places_to_ask_for(gateway: Gateway) -> None:
    answer = await gateway.http.get(
        "/v1/places", params={"address": "San Marcos"}, headers=gateway.provider
    )

    assert answer.status_code == 403
