"""All transactions lock deliveries, drones and missions in this order, to avoid deadlocks."""

import asyncio
from typing import Any

import pytest
from skyway_composition.links.store import lock_links
from sqlalchemy import text

from skyway.ids import DroneId

# SQLite has one writer: there is no order to keep.
pytestmark = pytest.mark.parametrize("migrated_url", ["postgresql"], indirect=True)

CANCELLATION = {"cancellation_id": "cnl_1", "package_ids": None, "reason": "no need"}
HOLD = {"command": "HOLD", "reason": "a crowd"}
LOADED = {"packages": [{"package_id": "p1", "mass_kg": 0.4}]}


async def until_a_lock_is_waited_for(composition: Any) -> None:
    """Return once a transaction waits for a row that another transaction has locked."""
    async with asyncio.timeout(20):
        while not await composition.rows(
            "SELECT pid FROM pg_stat_activity "
            "WHERE datname = current_database() AND wait_event_type = 'Lock'"
        ):
            pass


async def free_rows(composition: Any, table: str) -> int:
    """How many rows of a table are not locked."""
    async with composition.db.write() as tx:
        found = await tx.execute(text(f"SELECT 1 FROM {table} FOR UPDATE SKIP LOCKED"))
        return len(found.all())


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
        await until_a_lock_is_waited_for(composition)
        free = [await free_rows(composition, table) for table in ("deliveries", "missions")]

    assert free == [free_deliveries, 1]
    assert (await call).is_success
