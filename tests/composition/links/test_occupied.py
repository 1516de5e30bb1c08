"""An index finds occupied drones without reading the links of idle drones."""

import pytest
from skyway_composition.links.store import OCCUPIED
from skyway_composition.tables import drone_links
from sqlalchemy import insert, text

from skyway.runtime.sql.database import Database


@pytest.mark.integration
@pytest.mark.parametrize("migrated_url", ["postgresql"], indirect=True)
async def test_links_of_idle_drones_are_not_read(db: Database) -> None:
    counters = ("stream", "last_seq", "acked_stream", "acked_session", "last_event_seq")
    zeros = dict.fromkeys((*counters, "report_asked_wall_ms"), 0)
    async with db.write() as tx:
        rows = [
            {"drone_id": f"drn_{number}", "provider_id": "prv_1", "state": "{}" * 500, **zeros}
            for number in range(300)
        ]
        await tx.execute(insert(drone_links), rows)
        await tx.execute(text("UPDATE drone_links SET is_occupied = true WHERE drone_id = 'drn_7'"))
    async with db.write() as tx:
        await tx.execute(text("ANALYZE drone_links"))
        query = OCCUPIED.compile(dialect=tx.connection.dialect)
        drone_ids = [f"drn_{number}" for number in range(60)]
        explained = await tx.connection.exec_driver_sql(f"EXPLAIN {query}", (drone_ids,))
        plan = explained.scalars().all()

    assert any("drone_links_occupied" in line for line in plan), plan
