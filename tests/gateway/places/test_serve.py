"""Requests that name places: which station serves each, and what is refused by name."""

from typing import Any

import pytest
from openlocationcode import openlocationcode

from skyway.geo import Position
from tests.gateway.places.small_town import SQUARE, location, make_town
from tests.gateway.whole_gateway import Gateway, make_request


@pytest.fixture(autouse=True)
def _town(gateway: Gateway) -> None:
    gateway.parts.networks.cached.put(make_town())


def request_to(destination: dict[str, Any], **changes: Any) -> dict[str, Any]:
    """A request for one package to this place."""
    body = make_request(**changes)
    body["packages"][0]["destination"] = destination
    return body


async def refused(gateway: Gateway, body: dict[str, Any]) -> tuple[str, str]:
    """The field and the words of a refusal."""
    answer = await gateway.post(body)
    assert answer.status_code == 422, answer.text
    [error] = answer.json()["errors"]
    return error["field"], error["detail"]


async def test_the_nearest_station_serves_a_location(gateway: Gateway) -> None:
    answer = await gateway.post(request_to(location(east_m=5_200.0), pickup=location(east_m=80.0)))

    assert answer.status_code == 202
    delivery = answer.json()
    assert delivery["request"]["pickup"] == {"station_id": "san-marcos"}
    assert delivery["packages"][0]["destination"] == {"station_id": "bulverde"}


async def test_a_closed_station_serves_nothing(gateway: Gateway) -> None:
    gateway.composition.shut = {"bulverde"}

    delivery = (await gateway.post(request_to(location(east_m=5_300.0)))).json()
    gateway.composition.shut = {"bulverde", "mcqueeney", "san-antonio"}
    field, detail = await refused(gateway, request_to(location(east_m=5_300.0)))

    assert delivery["packages"][0]["destination"] == {"station_id": "mcqueeney"}
    assert field == "packages.0.destination.location"
    assert "are closed or gone: 'bulverde', 'mcqueeney', 'san-antonio'" in detail


async def test_places_are_served_while_composition_is_away(gateway: Gateway) -> None:
    gateway.composition.is_away = True

    answer = await gateway.post(request_to(location(east_m=5_300.0)))

    assert answer.status_code == 202


async def test_other_services_see_stations_and_no_places(gateway: Gateway) -> None:
    destination = location(east_m=5_290.0)
    walked = destination["location"]["longitude"]
    address = {"address": "San Marcos", "max_walk_m": 30.0}
    answer = await gateway.post(request_to(destination, pickup=address))
    await gateway.book_next()

    [asked] = gateway.composition.asked
    sent = asked.model_dump_json() + str(gateway.registry.queries)
    assert answer.status_code == 202
    for word in ("address", "location", "plus_code", "max_walk_m", f"{walked:.5f}"):
        assert word not in sent
    events = await gateway.events(answer.json()["delivery_id"])
    assert f"{walked:.5f}" not in str(events)


async def test_a_plus_code_is_a_place_full_or_short(gateway: Gateway) -> None:
    code = openlocationcode.encode(SQUARE.latitude_deg, SQUARE.longitude_deg + 0.055)
    short = openlocationcode.shorten(code, SQUARE.latitude_deg, SQUARE.longitude_deg)
    for text in (code, code.lower(), f"{short} San Marcos", f"{short}, san marcos"):
        delivery = (await gateway.post(request_to({"plus_code": text}))).json()
        assert delivery["packages"][0]["destination"] == {"station_id": "bulverde"}, text


@pytest.mark.parametrize(
    ("plus_code", "why"),
    [
        ("nothing", "is not a plus code"),
        ("V3M5+8", "is not a plus code"),
        ("V3M5+88", "put a reference place after it"),
        ("F6X3VHMC+8R San Marcos", "is no place on Earth"),
        ("V3M5+88 12 High Street", "is not found: the embedded geocoder"),
        ("76X40000+", "has 4 digits and means a whole region"),
        ("8FVC9G8F+6W", "no station lies within max_walk_m, 1000 m; the nearest"),  # Zurich
        ("76X4V3M5+88" * 15, "is not a plus code"),
    ],
)
async def test_a_wrong_plus_code_is_refused_by_name(
    gateway: Gateway, plus_code: str, why: str
) -> None:
    field, detail = await refused(gateway, request_to({"plus_code": plus_code}))

    assert field == "packages.0.destination.plus_code"
    assert why in detail


@pytest.mark.parametrize(
    ("latitude", "longitude", "why"),
    [
        (0.0, 0.0, "the nearest, 'san-antonio', is 10766.7 km"),
        (27.0, -92.0, "the nearest, 'san-antonio'"),  # in the Gulf of Mexico
        (-97.9414, 29.8833, "latitude and longitude look swapped"),
        (29.8833, -179.0, "the nearest"),
        (91.0, 120.0, "latitude 91 is not within -90 and 90"),
    ],
)
async def test_a_wrong_location_is_refused_by_name(
    gateway: Gateway, latitude: float, longitude: float, why: str
) -> None:
    place = {"location": {"latitude": latitude, "longitude": longitude}}
    field, detail = await refused(gateway, request_to(place))

    assert field.startswith("packages.0.destination.location")
    assert why in detail


async def test_swapped_coordinates_that_lie_on_earth_are_noticed(gateway: Gateway) -> None:
    # The longitude of the town is no latitude, so another town is needed.
    town = make_town("east", east_a=0.0).model_copy(update={"positions": (Position(80.0, 10.0),)})
    gateway.parts.networks.cached.put(town)
    place = {"location": {"latitude": 80.0, "longitude": 10.0}}

    _, detail = await refused(gateway, request_to(place))

    assert "latitude and longitude look swapped" in detail


@pytest.mark.parametrize(
    ("place", "why"),
    [
        ({}, "it has none of them"),
        ({"station_id": "a", "address": "San Marcos"}, "it has station_id and address"),
        ({"station_id": "a", "max_walk_m": 10}, "max_walk_m is for places that are no stations"),
        ({"address": "San Marcos", "max_walk_m": 0}, "must be above 0"),
        ({"address": "San Marcos", "max_walk_m": 5001}, "must be at most 5000"),
        ({"address": "x\u2028y"}, "one line of visible characters"),
        ({"address": "   "}, "one line of visible characters"),
        ({"address": "x" * 301}, "must have at most 300 characters"),
        ({"location": {"latitude": True, "longitude": 1}}, "must be a number"),
        ({"location": {"latitude": 1}}, "is missing"),
    ],
)
async def test_a_place_names_one_thing_within_its_limits(
    gateway: Gateway, place: dict[str, Any], why: str
) -> None:
    field, detail = await refused(gateway, request_to(place))

    assert field.startswith("packages.0.destination")
    assert why in detail


async def test_a_street_needs_a_geocoder_that_knows_streets(gateway: Gateway) -> None:
    field, detail = await refused(gateway, request_to({"address": "12 Guadalupe Street"}))

    assert field == "packages.0.destination.address"
    assert "no streets" in detail
    assert "SKYWAY_GEOCODER_URL" in detail


async def test_an_address_of_several_places_is_refused_with_all_of_them(gateway: Gateway) -> None:
    twin = make_town("twin", dallas=9_000.0)
    named = twin.model_copy(update={"names": {"dallas": "San Marcos"}})
    gateway.parts.networks.cached.put(named)

    field, detail = await refused(gateway, request_to({"address": "San Marcos"}))

    assert field == "packages.0.destination.address"
    assert "means several places" in detail
    assert detail.count("San Marcos") == 2


async def test_the_walk_decides_which_of_several_places_is_meant(gateway: Gateway) -> None:
    body = request_to({"address": "Markt, Süd", "max_walk_m": 5.0})

    delivery = (await gateway.post(body)).json()

    assert delivery["packages"][0]["destination"] == {"station_id": "mcqueeney"}


async def test_stations_of_one_network_serve_all_places(gateway: Gateway) -> None:
    """A station of another network is nearer to the pickup, but no way leads from there."""
    gateway.parts.networks.cached.put(make_town("other", other_a=10.0))

    body = request_to(location(east_m=5_300.0), pickup=location(east_m=10.0))
    delivery = (await gateway.post(body)).json()

    assert delivery["request"]["pickup"] == {"station_id": "san-marcos"}


async def test_a_place_without_a_way_from_the_pickup_is_refused(gateway: Gateway) -> None:
    gateway.parts.networks.cached.put(make_town("lake", island=20_000.0))

    field, detail = await refused(gateway, request_to(location(east_m=20_000.0)))

    assert field == "packages.0.destination.location"
    assert "no station within 1000 m has a way from the pickup in the network 'town'" in detail


async def test_twenty_places_are_located_and_no_more(gateway: Gateway) -> None:
    body = make_request(packages=22)
    for number, package in enumerate(body["packages"]):
        package["destination"] = location(east_m=5_000.0 + number)

    field, detail = await refused(gateway, body)

    assert (field, detail.partition(";")[0]) == (
        "packages",
        "22 different places exceed the limit of 20",
    )
    body["packages"] = body["packages"][:20]
    assert (await gateway.post(body)).status_code == 202


async def test_places_without_any_known_station_say_so(gateway: Gateway) -> None:
    gateway.parts.networks.cached.__init__()  # type: ignore[misc]  # nothing was ever announced

    answer = await gateway.post(request_to(location(east_m=0.0)))

    assert (answer.status_code, answer.json()["code"]) == (409, "NO_NETWORK")
