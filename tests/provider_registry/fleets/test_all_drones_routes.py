"""Operators list the drones of all providers, in pages, by provider and by state."""

from typing import Any

import pytest
from skyway_provider_registry.fleets import store


async def listed(api: Any, query: str = "") -> list[str]:
    """The drones of all pages."""
    found: list[str] = []
    cursor: str | None = ""
    while cursor is not None:
        more = f"&cursor={cursor}" if cursor else ""
        answer = await api("operator:op", "GET", f"/v1/drones?limit=2{query}{more}")
        assert answer.status_code == 200, answer.text
        assert len(answer.json()["items"]) <= 2
        found += [drone["drone_id"] for drone in answer.json()["items"]]
        cursor = answer.json()["next_cursor"]
    return found


@pytest.fixture
async def fleets(api: Any) -> dict[str, list[str]]:
    """Five drones of two providers; the second drone of each is in maintenance."""
    made: dict[str, list[str]] = {}
    for number in (3, 2):
        provider_id = await api.provider()
        made[provider_id] = [(await api.drone(provider_id))["drone_id"] for _ in range(number)]
        path = f"/v1/providers/{provider_id}/drones/{made[provider_id][1]}"
        await api("operator:op", "PATCH", path, {"state": "MAINTENANCE"})
    return made


async def test_operators_see_the_drones_of_all_providers(
    api: Any, fleets: dict[str, list[str]]
) -> None:
    assert await listed(api) == sorted(each for own in fleets.values() for each in own)


async def test_a_list_can_be_of_one_provider(api: Any, fleets: dict[str, list[str]]) -> None:
    for provider_id, own in fleets.items():
        assert await listed(api, f"&provider_id={provider_id}") == sorted(own)
    assert await listed(api, "&provider_id=prv_none") == []


@pytest.mark.databases("sqlite")
@pytest.mark.parametrize("together", [1, 2, 500])
async def test_a_list_can_be_of_one_state(
    api: Any, fleets: dict[str, list[str]], monkeypatch: pytest.MonkeyPatch, together: int
) -> None:
    monkeypatch.setattr(store, "_READ_TOGETHER", together)
    in_maintenance = sorted(own[1] for own in fleets.values())
    others = {each for own in fleets.values() for each in own} - set(in_maintenance)

    assert await listed(api, "&state=MAINTENANCE") == in_maintenance
    assert await listed(api, "&state=REGISTERED") == sorted(others)
    assert await listed(api, "&state=GROUNDED") == []


async def test_a_state_that_does_not_exist_is_refused(api: Any) -> None:
    assert (await api("operator:op", "GET", "/v1/drones?state=LOST")).status_code == 422


@pytest.mark.parametrize("caller", ["customer:c", "provider:prv_1", "drone:drn_1"])
async def test_only_operators_list_all_drones(api: Any, caller: str) -> None:
    assert (await api(caller, "GET", "/v1/drones")).status_code == 403
