"""Alarms about drones wait for the cell of their network, and for no other cell."""

from typing import Any

import pytest
from skyway_provider_registry.presence import announce_alarms, jump_store

from skyway.cells import CellClients
from skyway.contracts.drones import DroneAlarm
from skyway.runtime.clock import ManualClock
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.sql.database import Database


async def test_a_silent_cell_keeps_back_only_the_alarms_about_its_own_drones(
    api: Any,
    db: Database,
    clock: ManualClock,
    stations: Any,
    servers: CellClients,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(announce_alarms, "_MOST_AT_ONCE", 1)
    stations.elsewhere = {"mcqueeney": "ohio"}
    provider_id = await api.provider()
    drones = [
        await api.drone(provider_id, home_station_id=home) for home in ("san-marcos", "mcqueeney")
    ]
    alarms = [
        DroneAlarm(
            provider_id=provider_id,
            drone_id=each["drone_id"],
            level="URGENT",
            code="DRONE_JUMPED",
            detail="it jumped",
            at=clock.now(),
        )
        for each in drones
    ]
    async with db.write() as tx:
        await jump_store.put_in_maintenance(tx, alarms)

    with pytest.raises(ServiceUnavailable, match="texas"):
        await announce_alarms.AlarmAnnouncer(db, servers).step()

    async with db.read() as connection:
        left = await jump_store.waiting(connection, limit=10)
    assert left == [(alarms[0], "texas")]
