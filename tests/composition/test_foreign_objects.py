"""A mission or drone of another provider is answered exactly like one that does not exist."""

from typing import Any

import pytest

from tests.foreign_objects import Call, calls_about, learned_from

on_sqlite = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
OF_MISSIONS = list(calls_about("composition", "mission_id", role="provider"))
OF_DRONES = list(calls_about("composition", "drone_id", role="provider"))
SPAN = "?from=2026-03-01T00:00:00Z&to=2026-03-02T00:00:00Z"


def test_there_are_calls_about_missions_and_drones() -> None:
    assert len(OF_MISSIONS) >= 2
    assert len(OF_DRONES) >= 2


async def answers(
    composition: Any, caller: str, call: Call, name: str, *object_ids: str
) -> list[tuple[int, str]]:
    query = SPAN if call.path.endswith("/plans") else ""
    return [
        learned_from(
            await composition(caller, call.method, call.url(**{name: each}) + query, call.body),
            each,
        )
        for each in object_ids
    ]


@on_sqlite
@pytest.mark.parametrize("caller", ["provider:prv_1", "drone:drn_1"])
@pytest.mark.parametrize("call", OF_MISSIONS, ids=str)
async def test_a_mission_of_another_provider_looks_absent(
    composition: Any, make: Any, call: Call, caller: str
) -> None:
    booked = await composition.book(make.candidate(2, provider_id="prv_2"))
    foreign = booked.missions[0].mission_id

    found, absent = await answers(composition, caller, call, "mission_id", foreign, "mis_absent")

    assert found == absent
    assert found[0] in {403, 404}


@on_sqlite
@pytest.mark.parametrize("call", OF_DRONES, ids=str)
async def test_a_drone_of_another_provider_looks_absent(
    composition: Any, make: Any, call: Call
) -> None:
    await composition.book(make.candidate(2, provider_id="prv_2"))

    foreign, absent = await answers(
        composition, "provider:prv_1", call, "drone_id", "drn_2", "drn_absent"
    )

    assert foreign == absent
