"""Networks over REST: versions, preconditions, conflicts and permissions."""

from typing import Any

import pytest

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

PATH = "/v1/networks/row"


async def test_a_new_network_is_created_and_then_changed(composition: Any, make: Any) -> None:
    created = await composition(
        "operator:op", "PUT", "/v1/networks/other", make.network(stations="xyz")
    )
    changed = await composition(
        "operator:op", "PUT", "/v1/networks/other", make.network(stations="wxyz")
    )

    assert (created.status_code, created.json()["version"]) == (201, 1)
    assert (changed.status_code, changed.json()["version"]) == (200, 2)
    assert created.headers["etag"] != changed.headers["etag"]


async def test_the_same_content_is_the_same_version(composition: Any, make: Any) -> None:
    again = await composition("operator:op", "PUT", PATH, make.network())

    assert (again.status_code, again.json()["version"]) == (200, 1)


async def test_any_change_of_content_is_a_new_version(composition: Any, make: Any) -> None:
    changed = await composition("operator:op", "PUT", PATH, make.network(dropoff_s=31))

    assert changed.json()["version"] == 2


async def test_a_network_is_read_as_it_was_published(composition: Any, make: Any) -> None:
    answer = await composition("customer:c", "GET", PATH)

    again = await composition("operator:op", "PUT", PATH, answer.json())
    assert answer.headers["content-type"] == "application/geo+json"
    assert again.json()["version"] == 1
    assert again.headers["etag"] == answer.headers["etag"]


async def test_an_old_version_can_still_be_read(composition: Any, make: Any) -> None:
    before = await composition("customer:c", "GET", PATH)
    await composition.publish(make.network(loading_s=5))

    old = await composition("customer:c", "GET", f"{PATH}?version=1")
    unknown = await composition("customer:c", "GET", f"{PATH}?version=3")

    assert (old.content, old.headers["etag"]) == (before.content, before.headers["etag"])
    assert unknown.status_code == 404


async def test_if_match_protects_against_a_lost_update(composition: Any, make: Any) -> None:
    tag = (await composition("operator:op", "GET", PATH)).headers["etag"]

    first = await composition("operator:op", "PUT", PATH, make.network(loading_s=1), If_Match=tag)
    second = await composition("operator:op", "PUT", PATH, make.network(loading_s=2), If_Match=tag)

    assert (first.status_code, second.status_code) == (200, 412)


async def test_a_station_belongs_to_one_network(composition: Any, make: Any) -> None:
    answer = await composition(
        "operator:op", "PUT", "/v1/networks/other", make.network(stations="ef")
    )

    assert answer.status_code == 409
    assert "'e' of 'row'" in answer.json()["detail"]


@pytest.mark.parametrize("change", [{"stations": "ab"}, {"pads": {"b": 0}}])
async def test_a_version_without_a_reserved_pad_is_refused(
    composition: Any, make: Any, change: dict[str, Any]
) -> None:
    await composition.book()

    answer = await composition("operator:op", "PUT", PATH, make.network(**change))

    assert (answer.status_code, answer.json()["code"]) == (409, "STATION_RESERVED")


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        ({"loading_time_s": 60}, "settings.loading_time_s"),
        ({"loading_s": -1}, "settings.loading_s"),
        ({"currency": "dollars"}, "settings.currency"),
    ],
)
async def test_a_wrong_setting_is_named(
    composition: Any, make: Any, settings: dict[str, Any], field: str
) -> None:
    answer = await composition("operator:op", "PUT", PATH, make.network(**settings))

    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == field


async def test_a_power_of_zero_is_named(composition: Any, make: Any) -> None:
    network = make.network()
    network["features"][1]["properties"]["station_power_w"] = 0

    answer = await composition("operator:op", "PUT", PATH, network)

    assert answer.status_code == 422
    assert answer.json()["errors"][0] == {
        "field": "features.1.properties.station_power_w",
        "detail": "0 is below 10",
    }


async def test_a_body_that_is_not_a_network_is_refused(composition: Any) -> None:
    listed = await composition("operator:op", "PUT", PATH, [1])
    broken = await composition("operator:op", "PUT", PATH, {"type": "FeatureCollection"})

    assert (listed.status_code, broken.status_code) == (422, 422)
    assert broken.json()["errors"][0]["field"] == "features"


async def test_only_operators_publish(composition: Any, make: Any) -> None:
    customer = await composition("customer:c", "PUT", PATH, make.network())
    unknown = await composition.client.put(PATH, headers={"Authorization": "Bearer wrong"})

    assert (customer.status_code, unknown.status_code) == (403, 401)


async def test_a_cursor_continues_each_list(composition: Any) -> None:
    for name, length in (("stations", 5), ("versions", 1)):
        seen: list[Any] = []
        cursor = ""
        while True:
            path = f"{PATH}/{name}?limit=2" + (f"&cursor={cursor}" if cursor else "")
            page = (await composition("provider:p", "GET", path)).json()
            seen += page["items"]
            cursor = page["next_cursor"]
            if not cursor:
                break
        assert len(seen) == len({str(item) for item in seen}) == length


async def test_a_drone_may_read_pads_but_not_networks_or_reservations(composition: Any) -> None:
    paths = ("/v1/stations/b/pads", "/v1/stations/b/reservations", PATH, "/v1/networks")

    answers = [await composition("drone:d", "GET", path) for path in paths]

    assert [answer.status_code for answer in answers] == [200, 403, 403, 403]


async def test_a_cursor_of_another_list_is_refused(composition: Any) -> None:
    stations = await composition("operator:op", "GET", f"{PATH}/stations?limit=2")

    answer = await composition(
        "operator:op", "GET", f"{PATH}/versions?cursor={stations.json()['next_cursor']}"
    )

    assert answer.status_code == 422


@pytest.mark.parametrize("version", [0, -1, 2**31, 10**30])
async def test_an_impossible_version_is_refused(composition: Any, version: int) -> None:
    answer = await composition("customer:c", "GET", f"{PATH}?version={version}")

    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "version")


async def test_an_unknown_network_is_not_found(composition: Any) -> None:
    for below in ("", "/versions", "/stations"):
        answer = await composition("operator:op", "GET", f"/v1/networks/none{below}")
        assert answer.status_code == 404
