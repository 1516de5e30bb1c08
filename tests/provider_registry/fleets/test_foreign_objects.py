"""A drone of another provider is answered exactly like one that does not exist."""

from typing import Any

import pytest

from tests.foreign_objects import Call, calls_about, learned_from

CALLS = list(calls_about("provider-registry", "drone_id", role="provider"))


def test_there_are_calls_about_drones() -> None:
    assert len(CALLS) >= 5


@pytest.mark.parametrize("is_under_own_path", [True, False])
async def test_a_drone_of_another_provider_looks_absent(
    api: Any, is_under_own_path: bool, subtests: pytest.Subtests
) -> None:
    mine, other = await api.provider(), await api.provider()
    foreign = (await api.drone(other))["drone_id"]
    named = mine if is_under_own_path else other

    async def answer(call: Call, drone_id: str) -> tuple[int, str]:
        url = call.url(provider_id=named, drone_id=drone_id)
        found = await api(f"provider:{mine}", call.method, url, call.body)
        return learned_from(found, drone_id)

    for call in CALLS:
        with subtests.test(str(call)):
            found, absent = await answer(call, foreign), await answer(call, "drn_absent")

            assert found == absent
            assert found[0] == 404
