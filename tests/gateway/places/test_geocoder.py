"""The embedded geocoder knows names, and guesses nothing."""

import pytest
from skyway_gateway.places.geocoder import NameGeocoder
from skyway_gateway.places.station_map import StationMap

from tests.gateway.places.small_town import cached, make_town


@pytest.mark.parametrize("name", ["San Marcos", "san-marcos", "  SAN   MARCOS ", "san, marcos"])
async def test_a_station_is_found_by_its_id_and_its_name(name: str) -> None:
    [*found] = await NameGeocoder(StationMap(cached())).find(name)

    assert found[0].label == "San Marcos"


async def test_names_are_compared_without_accents() -> None:
    [found] = await NameGeocoder(StationMap(cached())).find("markt sud")

    assert found.label == "Markt, Süd"


async def test_a_bundled_town_is_known_without_its_network() -> None:
    [found] = await NameGeocoder(StationMap(cached())).find("Alamo Heights")

    assert round(found.position.longitude_deg, 2) == -98.47


@pytest.mark.parametrize("street", ["12 Guadalupe Street, San Marcos", "San Marcos 12", "San"])
async def test_a_street_is_not_guessed_from_the_name_of_a_town(street: str) -> None:
    assert await NameGeocoder(StationMap(cached())).find(street) == ()


async def test_names_of_new_networks_are_found() -> None:
    networks = cached()
    geocoder = NameGeocoder(StationMap(networks))
    assert await geocoder.find("lake") == ()

    networks.put(make_town("new", lake=5.0))

    assert len(await geocoder.find("Lake")) == 1
