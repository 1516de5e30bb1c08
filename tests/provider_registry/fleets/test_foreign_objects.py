"""A drone of another provider is answered exactly like one that does not exist."""

from typing import Any

import pytest

from tests.foreign_objects import Call, calls_about, learned_from

CALLS = list(calls_about("provider-registry", "drone_id", role="provider"))


def test_there_are_calls_about_drones() -> None:
    assert len(CALLS) >= 5


@pytest.mark.parametrize("call", CALLS, ids=str)
@pytest.mark.parametrize("is_under_own_path", [True, False])
async def test_a_drone_of_another_provider_looks_absent(
    api: Any, call: Call, is_under_own_path: bool
) -> None:
    mine, other = await api.provider(), await api.provider()
    foreign = (await api.drone(other))["drone_id"]
    named = mine if is_under_own_path else other

    async def answer(drone_id: str) -> tuple[int, str]:
        url = call.url(provider_id=named, drone_id=drone_id)
        found = await api(f"provider:{mine}", call.method, url, call.body)
        return learned_from(found, drone_id)

    found, absent = await answer(foreign), await answer("drn_absent")

    assert found == absent
    assert found[0] == 404
