"""All transactions lock deliveries, drones and missions in this order, to avoid deadlocks."""

import asyncio
from typing import Any

import pytest
from skyway_composition.links.store import lock_links

from skyway.ids import DroneId
from tests.row_locks import free_keys, until_a_lock_is_waited_for

# SQLite has one writer: there is no order to keep.
pytestmark = pytest.mark.parametrize("migrated_url", ["postgresql"], indirect=True)

CANCELLATION = {"cancellation_id": "cnl_1", "package_ids": None, "reason": "no need"}
HOLD = {"command": "HOLD", "reason": "a crowd"}
LOADED = {"packages": [{"package_id": "p1", "mass_kg": 0.4}]}


@pytest.mark.parametrize(
    ("caller", "path", "body", "free_deliveries"),
    [
        ("service:gateway", "/internal/deliveries/dlv_1/cancellations", CANCELLATION, 0),
        ("operator:op", "/v1/missions/{mission_id}/commands", HOLD, 1),
        ("operator:op", "/v1/missions/{mission_id}/loading", LOADED, 1),
    ],
)
async def test_an_intervention_locks_the_drone_before_the_mission(
    composition: Any,
    drone: Any,
    make: Any,
    begin: Any,
    caller: str,
    path: str,
    body: Any,
    free_deliveries: int,
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)
    path = path.format(mission_id=instruction.mission_id)

    async with composition.db.write() as tx:
        await lock_links(tx, [DroneId("drn_1")])
        call = asyncio.create_task(composition(caller, "POST", path, body))
        await until_a_lock_is_waited_for(composition.db)
        deliveries = await free_keys(composition.db, "deliveries", "delivery_id")
        missions = await free_keys(composition.db, "missions", "mission_id")

    assert len(deliveries) == free_deliveries
    assert missions == {instruction.mission_id}
    assert (await call).is_success
