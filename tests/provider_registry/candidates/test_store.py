"""The cost of a refresh of the fleets in the database."""

from typing import Final

import pytest
from skyway_provider_registry.candidates import store
from sqlalchemy import text
from sqlalchemy.dialects import postgresql

from skyway.runtime.sql.database import Database

#: Fleets of two thousand drones that have flown, and the reports of five thousand missions since
#: yesterday.
_FLEETS: Final = """
INSERT INTO providers (provider_id, name, tariff, state, created_ms)
  VALUES ('p', 'P', '{}', 'ACTIVE', 0);
INSERT INTO drones (drone_id, provider_id, model_id, home_station_id, home_longitude_deg,
    home_latitude_deg, network_id, initial_soc, is_in_maintenance, created_ms)
  SELECT 'd' || i, 'p', 'm', 's', 0, 0, 'n', 1, false, 0 FROM generate_series(1, 2000) AS i;
INSERT INTO presence (drone_id, connection_session, connection_number, connection_rank,
    state_session, state_seq, sample_session, sample_seq, mission_id, changed)
  SELECT 'd' || i, 1, 1, 1, 1, 1, 1, 1, 'm' || i, i FROM generate_series(1, 2000) AS i;
INSERT INTO learned_values (drone_id, flights, recharges, still_air_factor, state_of_health,
    charge_rate_factor, is_maintenance_due, learned_session, learned_seq, learned_ms, since_ms)
  SELECT 'd' || i, 1, 1, 1, 1, 1, false, 1, 1, 0, 0 FROM generate_series(1, 2000) AS i;
INSERT INTO batteries (battery_id, provider_id, model_id, serial, capacity_j, state_of_health,
    health_observations, used_soc, drone_id, installed_ms, installed_used_soc, created_ms)
  SELECT 'b' || i, 'p', 'm', 's' || i, 1, 1, 0, 0, 'd' || i, 0, 0, 0
  FROM generate_series(1, 2000) AS i;
INSERT INTO mission_hints (mission_id, drone_id, seq, mission_state, is_live, reported_wall_ms)
  SELECT 'm' || i, 'd' || (i % 2000 + 1), 1, 'ENDED', false, 0 FROM generate_series(1, 5000) AS i;
INSERT INTO changes ("only", latest, providers, removals) VALUES (1, 2000, 1, 0)
"""


@pytest.mark.parametrize(
    "migrated_url", [pytest.param("postgresql", marks=pytest.mark.integration)], indirect=True
)
@pytest.mark.parametrize("analysed", ["", "; ANALYZE"])
async def test_reading_few_changes_scans_no_whole_table(db: Database, analysed: str) -> None:
    dialect = postgresql.dialect(paramstyle="numeric_dollar")  # type: ignore[no-untyped-call]

    async with db.write() as tx:
        for statement in (_FLEETS + analysed).split(";"):
            await tx.execute(text(statement))
        # The generic plan, which PostgreSQL otherwise makes after a few executions.
        await tx.execute(text("SET LOCAL plan_cache_mode = force_generic_plan"))
        await tx.execute(text(f"PREPARE look AS {store.CHANGES.compile(dialect=dialect)}"))
        plan = (await tx.execute(text("EXPLAIN EXECUTE look(1994, 1)"))).scalars().all()

    assert not [line for line in plan if "Seq Scan" in line and "Seq Scan on changes" not in line]
