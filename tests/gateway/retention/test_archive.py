"""The archive has each row of a day that is over once, and nothing that is secret."""

from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from pyarrow.parquet import read_table
from skyway_gateway.retention.archived_tables import ARCHIVED

from skyway.runtime.archive import Export
from tests.gateway.whole_gateway import Gateway

DAY = timedelta(days=1)


async def archive(gateway: Gateway, folder: Path) -> int:
    """How many files were written."""
    return len(await Export(gateway.parts.db, gateway.clock, folder).write(ARCHIVED))


def archived(folder: Path, table: str) -> list[dict[str, Any]]:
    """The archived rows of a table, of all days."""
    return [row for file in sorted((folder / table).glob("*.parquet")) for row in rows_of(file)]


def rows_of(file: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = read_table(file).to_pylist()
    return found


def written_at(folder: Path) -> dict[Path, int]:
    """When each file below a folder was written, whole or not."""
    return {file: file.stat().st_mtime_ns for file in (folder / "deliveries").iterdir()}


async def count(gateway: Gateway, table: str) -> int:
    async with gateway.parts.db.read() as connection:
        found = await connection.exec_driver_sql(f"SELECT count(*) FROM {table}")
        return int(found.scalar_one())


async def flown(gateway: Gateway) -> str:
    """A delivery that is over."""
    delivery_id = await gateway.planned()
    for seq, kind in enumerate(("ACCEPTED", "LOADING", "LOADED"), start=1):
        await gateway.report(delivery_id, kind, seq=seq)
    await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1"])
    await gateway.report(delivery_id, "ENDED", seq=5)
    return delivery_id


@pytest.fixture
async def two_days(gateway_on_both: Gateway) -> Gateway:
    """A gateway with deliveries that ended on two days which are over, and audited calls."""
    gateway = gateway_on_both
    for _ in range(2):
        await flown(gateway)
        await flown(gateway)
        body = {"role": "customer", "subject_id": "carol"}
        assert (await gateway.http.post("/v1/keys", json=body, headers=gateway.operator)).is_success
        gateway.clock.advance(DAY)
    gateway.clock.advance(DAY)
    return gateway


async def test_the_archive_has_every_row(two_days: Gateway, tmp_path: Path) -> None:
    await archive(two_days, tmp_path)

    for table in ("deliveries", "packages", "custody", "missions", "events", "audit"):
        assert len(archived(tmp_path, table)) == await count(two_days, table) > 0, table
    assert len(list((tmp_path / "deliveries").glob("*.parquet"))) == 2


async def test_values_are_those_of_the_database(two_days: Gateway, tmp_path: Path) -> None:
    await archive(two_days, tmp_path)

    async with two_days.parts.db.read() as connection:
        found = await connection.exec_driver_sql(
            "SELECT delivery_id, state, is_delayed, updated_ms FROM deliveries ORDER BY 1"
        )
        stored = [dict(row, is_delayed=bool(row["is_delayed"])) for row in found.mappings()]
    rows = sorted(archived(tmp_path, "deliveries"), key=lambda row: str(row["delivery_id"]))
    names = ("delivery_id", "state", "is_delayed", "updated_ms")
    assert [{name: row[name] for name in names} for row in rows] == stored


async def test_a_file_that_exists_is_not_written_again(two_days: Gateway, tmp_path: Path) -> None:
    await archive(two_days, tmp_path)
    before = written_at(tmp_path)

    assert await archive(two_days, tmp_path) == 0

    assert written_at(tmp_path) == before


async def test_a_day_that_is_not_over_is_not_archived(
    gateway_on_both: Gateway, tmp_path: Path
) -> None:
    await flown(gateway_on_both)

    assert await archive(gateway_on_both, tmp_path) == 0


async def test_a_delivery_that_goes_on_is_not_archived(
    gateway_on_both: Gateway, tmp_path: Path
) -> None:
    gateway = gateway_on_both
    await gateway.planned()
    gateway.clock.advance(3 * DAY)

    await archive(gateway, tmp_path)

    assert archived(tmp_path, "deliveries") == []
    gateway.is_damaged = True  # nobody has looked at it for three days


async def test_what_a_killed_archive_left_is_replaced(two_days: Gateway, tmp_path: Path) -> None:
    await archive(two_days, tmp_path)
    [first, _] = sorted((tmp_path / "deliveries").glob("*.parquet"))
    first.rename(first.with_suffix(".unfinished"))
    first.with_suffix(".unfinished").write_bytes(b"half of it")

    assert await archive(two_days, tmp_path) == 1

    assert len(archived(tmp_path, "deliveries")) == 4
    assert {file.suffix for file in written_at(tmp_path)} == {".parquet"}


def test_nothing_secret_is_archived() -> None:
    names = {each.table.name for each in ARCHIVED}
    columns = {column.name for each in ARCHIVED for column in each.columns()}

    assert names.isdisjoint({"api_keys", "webhooks", "sessions", "session_links", "idempotency"})
    assert "personal_data" not in names
    assert not {each for each in columns if "secret" in each or "key_hash" in each}
