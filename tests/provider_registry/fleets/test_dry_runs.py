"""A dry run of a registration names the faults of a real one, and registers nothing."""

from typing import Any

import pytest

pytestmark = pytest.mark.databases("sqlite")

DRONE = {"model_id": "paper-scenario", "home_station_id": "san-marcos"}
BATTERY = {"serial": "S-1", "model_id": "paper-scenario"}


class Owner:
    """A provider that registers drones and batteries."""

    def __init__(self, api: Any, provider_id: str) -> None:
        self.api, self.provider_id = api, provider_id

    async def posts(self, kind: str, body: Any, *, dry_run: bool = True) -> Any:
        path = f"/v1/providers/{self.provider_id}/{kind}?dry_run={str(dry_run).lower()}"
        return await self.api(f"provider:{self.provider_id}", "POST", path, body)

    async def count(self, kind: str) -> int:
        path = f"/v1/providers/{self.provider_id}/{kind}"
        answer = await self.api(f"provider:{self.provider_id}", "GET", path)
        return len(answer.json()["items"])


@pytest.fixture
async def owner(api: Any) -> Owner:
    return Owner(api, await api.provider())


@pytest.mark.parametrize(("kind", "item"), [("drones", DRONE), ("batteries", BATTERY)])
async def test_good_rows_are_checked_and_not_registered(
    owner: Owner, kind: str, item: dict[str, Any]
) -> None:
    for body in (item, [item]):
        answer = await owner.posts(kind, body)
        assert (answer.status_code, answer.content) == (204, b"")

    assert await owner.count(kind) == 0


@pytest.mark.parametrize(
    ("kind", "body", "field"),
    [
        ("drones", [DRONE, {**DRONE, "model_id": "paper-plane"}], "1.model_id"),
        ("drones", [DRONE, {**DRONE, "registration": "N1"}], "1.registration"),
        ("batteries", [BATTERY, {**BATTERY, "serial": "S-2"}, BATTERY], "2.serial"),
        ("batteries", [{**BATTERY, "serial": "S-2", "model_id": "x"}], "0.model_id"),
        ("batteries", [{**BATTERY, "serial": "S-2", "capacity_j": 1}], "0.capacity_j"),
        ("batteries", [{**BATTERY, "serial": "S-2"}, {**BATTERY, "serial": "OLD"}], "1.serial"),
        ("batteries", {**BATTERY, "serial": "OLD"}, "serial"),
    ],
)
async def test_faults_name_the_row_and_the_field(
    owner: Owner, kind: str, body: Any, field: str
) -> None:
    await owner.posts("drones", {**DRONE, "registration": "N1"}, dry_run=False)
    await owner.posts("batteries", {**BATTERY, "serial": "OLD"}, dry_run=False)

    answer = await owner.posts(kind, body)

    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == field


async def test_a_list_of_batteries_is_registered_whole_or_not_at_all(owner: Owner) -> None:
    serials = [f"S-{number}" for number in range(5)]
    body = [{**BATTERY, "serial": serial} for serial in serials]

    answer = await owner.posts("batteries", body, dry_run=False)
    again = await owner.posts("batteries", [{**BATTERY, "serial": "new"}, *body], dry_run=False)

    assert [each["serial"] for each in answer.json()["items"]] == serials
    assert (again.status_code, again.json()["code"]) == (409, "SERIAL_TAKEN")
    assert await owner.count("batteries") == 5


async def test_another_provider_learns_nothing_by_a_dry_run(api: Any, owner: Owner) -> None:
    other = await api.provider()
    for kind, item in (("drones", DRONE), ("batteries", BATTERY)):
        path = f"/v1/providers/{owner.provider_id}/{kind}?dry_run=true"
        assert (await api(f"provider:{other}", "POST", path, item)).status_code == 404
