"""A provider sees, changes and removes only its own drones (I13)."""

from pathlib import Path
from typing import Any

import pytest
from skyway_verifier.registry.rules import RULES

from tests.broken_rules import broken_rules
from tests.provider_registry.broker_accounts import accounts_in


@pytest.fixture
async def mine(api: Any) -> str:
    made: str = await api.provider()
    return made


@pytest.fixture
async def other(api: Any, mine: str) -> str:
    made: str = await api.provider()
    return made


async def test_a_provider_sees_its_own_drones_only(api: Any, mine: str, other: str) -> None:
    own = await api.drone(mine)
    await api.drone(other)

    listed = await api(f"provider:{mine}", "GET", f"/v1/providers/{mine}/drones")

    assert [drone["drone_id"] for drone in listed.json()["items"]] == [own["drone_id"]]


async def test_another_providers_list_is_not_found(api: Any, mine: str, other: str) -> None:
    await api.drone(other)

    listed = await api(f"provider:{mine}", "GET", f"/v1/providers/{other}/drones")

    assert listed.status_code == 404


@pytest.mark.parametrize("method", ["GET", "PATCH", "DELETE"])
async def test_another_providers_drone_is_not_found(
    api: Any, mine: str, other: str, method: str
) -> None:
    foreign = await api.drone(other, name="Heron")
    body = {"name": "stolen"} if method == "PATCH" else None
    drone_id = foreign["drone_id"]

    by_its_path = await api(
        f"provider:{mine}", method, f"/v1/providers/{other}/drones/{drone_id}", body
    )
    by_my_path = await api(
        f"provider:{mine}", method, f"/v1/providers/{mine}/drones/{drone_id}", body
    )

    left = await api("operator:op", "GET", f"/v1/providers/{other}/drones/{drone_id}")
    assert (by_its_path.status_code, by_my_path.status_code) == (404, 404)
    assert left.json()["name"] == "Heron"


@pytest.mark.parametrize("method", ["GET", "PATCH", "DELETE"])
async def test_a_drone_is_found_under_its_own_provider_only(
    api: Any, mine: str, other: str, method: str
) -> None:
    drone_id = (await api.drone(other))["drone_id"]
    body = {"name": "x"} if method == "PATCH" else None

    answer = await api("operator:op", method, f"/v1/providers/{mine}/drones/{drone_id}", body)

    left = await api("operator:op", "GET", f"/v1/providers/{other}/drones/{drone_id}")
    assert answer.status_code == 404
    assert left.json()["name"] is None


@pytest.mark.parametrize("caller", ["customer:c", "drone:drn_1", None])
async def test_customers_may_not_see_fleets(api: Any, mine: str, caller: str | None) -> None:
    answer = await api(caller, "GET", f"/v1/providers/{mine}/drones")

    assert answer.status_code == 403


async def test_a_customer_named_like_a_provider_sees_nothing(api: Any, mine: str) -> None:
    drone_id = (await api.drone(mine))["drone_id"]

    answer = await api(f"customer:{mine}", "GET", f"/v1/providers/{mine}/drones/{drone_id}")

    assert answer.status_code == 403


async def test_name_registration_and_home_can_be_changed(api: Any, mine: str) -> None:
    drone_id = (await api.drone(mine, name="Heron", registration="N1"))["drone_id"]
    path = f"/v1/providers/{mine}/drones/{drone_id}"
    change = {"name": "Egret", "registration": None, "home_station_id": "mcqueeney"}

    answer = await api(f"provider:{mine}", "PATCH", path, change)

    read = await api(f"provider:{mine}", "GET", path)
    assert read.json() == answer.json()
    assert {name: read.json()[name] for name in change} == change
    assert read.json()["home_position"] == [-98.03334, 29.59217]


async def test_a_drone_has_its_own_standby_until_it_is_removed(api: Any, mine: str) -> None:
    drone = await api.drone(mine, standby="STAY")
    path = f"/v1/providers/{mine}/drones/{drone['drone_id']}"

    changed = await api(f"provider:{mine}", "PATCH", path, {"standby": "NEXT_PICKUP"})
    renamed = await api(f"provider:{mine}", "PATCH", path, {"name": "Heron"})
    removed = await api(f"provider:{mine}", "PATCH", path, {"standby": None})

    answers = (changed, renamed, removed)
    assert drone["standby"] == "STAY"
    assert [each.json()["standby"] for each in answers] == ["NEXT_PICKUP", "NEXT_PICKUP", None]


async def test_maintenance_begins_and_ends(api: Any, mine: str) -> None:
    drone_id = (await api.drone(mine))["drone_id"]
    path = f"/v1/providers/{mine}/drones/{drone_id}"

    begun = await api(f"provider:{mine}", "PATCH", path, {"state": "MAINTENANCE"})
    ended = await api(f"provider:{mine}", "PATCH", path, {"state": "AVAILABLE"})

    assert (begun.json()["state"], ended.json()["state"]) == ("MAINTENANCE", "REGISTERED")


@pytest.mark.databases("sqlite")
@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"state": "ON_MISSION"}, "state"),
        ({"standby": "ROAM"}, "standby"),
        ({"state": None}, "state"),
        ({"home_station_id": "atlantis"}, "home_station_id"),
        ({"home_station_id": None}, "home_station_id"),
        ({"model_id": "paper-scenario"}, "model_id"),
        ({"soc": 0.5}, "soc"),
    ],
)
async def test_a_bad_change_is_refused_with_its_field(
    api: Any, mine: str, change: dict[str, object], field: str
) -> None:
    drone_id = (await api.drone(mine))["drone_id"]

    answer = await api("operator:op", "PATCH", f"/v1/providers/{mine}/drones/{drone_id}", change)

    assert answer.status_code == 422
    assert [problem["field"] for problem in answer.json()["errors"]] == [field]


async def test_an_empty_change_changes_nothing(api: Any, mine: str) -> None:
    drone = await api.drone(mine)
    path = f"/v1/providers/{mine}/drones/{drone['drone_id']}"

    answer = await api("operator:op", "PATCH", path, {})

    del drone["mqtt"], drone["enrolment_token"], drone["cloud_keys"]
    assert answer.json() == drone


async def test_a_duplicate_registration_is_refused(api: Any, mine: str) -> None:
    await api.drone(mine, registration="N1")
    drone_id = (await api.drone(mine, registration="N2"))["drone_id"]

    answer = await api(
        "operator:op", "PATCH", f"/v1/providers/{mine}/drones/{drone_id}", {"registration": "N1"}
    )

    assert answer.status_code == 409


async def test_a_removed_drone_cannot_log_in(api: Any, mine: str, tmp_path: Path, db: Any) -> None:
    drone_id = (await api.drone(mine))["drone_id"]
    path = f"/v1/providers/{mine}/drones/{drone_id}"
    before = accounts_in(tmp_path)

    answer = await api(f"provider:{mine}", "DELETE", path)

    assert answer.status_code == 204
    assert drone_id in before
    assert drone_id not in accounts_in(tmp_path)
    assert (await api("operator:op", "GET", path)).status_code == 404
    assert await broken_rules(db, RULES) == []


async def test_drones_come_in_pages(api: Any, mine: str) -> None:
    made = [(await api.drone(mine))["drone_id"] for _ in range(3)]
    path = f"/v1/providers/{mine}/drones?limit=2"

    first = (await api("operator:op", "GET", path)).json()
    rest = (await api("operator:op", "GET", f"{path}&cursor={first['next_cursor']}")).json()

    assert [drone["drone_id"] for drone in first["items"] + rest["items"]] == made
    assert rest["next_cursor"] is None


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_drone_does_not_change_its_cell(api: Any, stations: Any) -> None:
    drone = await api.drone(await api.provider())
    stations.elsewhere = {"mcqueeney": "ohio"}
    path = f"/v1/providers/{drone['provider_id']}/drones/{drone['drone_id']}"

    refused = await api("operator:op", "PATCH", path, {"home_station_id": "mcqueeney"})
    stations.elsewhere = {}
    accepted = await api("operator:op", "PATCH", path, {"home_station_id": "mcqueeney"})

    assert (refused.status_code, refused.json()["code"]) == (409, "OTHER_CELL")
    assert accepted.status_code == 200
