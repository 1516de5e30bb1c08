"""The archive of composition has each mission that is over, with all its parts."""

from datetime import timedelta
from pathlib import Path
from typing import Any

from pyarrow.parquet import read_table
from skyway_composition.retention.archived_tables import ARCHIVED

from skyway.runtime.archive import Export


async def test_missions_that_are_over_are_archived_with_their_parts(
    composition: Any, drone: Any, tmp_path: Path
) -> None:
    await composition.book()
    [instruction] = await composition.sent()
    await composition.receive(drone.ack(instruction), *drone.flown(instruction))
    composition.clock.advance(timedelta(days=3))
    await composition.book(delivery_id="dlv_2")
    over = f"mission_id = '{instruction.mission_id}'"

    written = await Export(composition.db, composition.clock, tmp_path).write(ARCHIVED)

    rows = {each.table: each.rows for each in written}
    for table in ("missions", "mission_steps", "custody", "instructions"):
        [(stored,)] = await composition.rows(f"SELECT count(*) FROM {table} WHERE {over}")
        assert rows[table] == stored > 0, table
    [file] = (tmp_path / "missions").glob("*.parquet")
    [row] = read_table(file).to_pylist()
    assert (row["mission_id"], row["state"]) == (instruction.mission_id, "COMPLETED")
    assert "claimed_by" not in row
