"""Reports that arrive together share a transaction, and are answered once it is committed."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest
from skyway_provider_registry.presence.mission_reports import ReportKeeper
from skyway_provider_registry.tables import mission_hints
from sqlalchemy import select

from skyway.contracts.mission_reports import MissionReport
from skyway.runtime.clock import ManualClock
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.pace import Pace
from skyway.runtime.sql.database import Database, Tx


class CountingDatabase(Database):
    """Counts its transactions; the first `failing` cannot be had."""

    failing = 0
    begun = 0

    @asynccontextmanager
    async def write(self) -> AsyncIterator[Tx]:
        self.begun += 1
        if self.begun <= self.failing:
            raise ServiceUnavailable("database", "it is away in this test")
        async with super().write() as tx:
            yield tx


@pytest.fixture
async def counting(migrated_url: str, db: Database) -> AsyncIterator[CountingDatabase]:
    """Another pool on the same database."""
    async with CountingDatabase(migrated_url) as opened:
        yield opened


Makers = Callable[[str], MissionReport]


@pytest.fixture
async def report(api: Any) -> Makers:
    """Makes the first report of a mission."""
    drone = await api.drone(await api.provider())

    def make(mission_id: str) -> MissionReport:
        return MissionReport.model_validate(
            {
                "report_id": f"rpt_{mission_id}",
                "delivery_id": "dlv_1",
                "attempt": 1,
                "trip": 1,
                "mission_id": mission_id,
                "provider_id": drone["provider_id"],
                "drone_id": drone["drone_id"],
                "seq": 1,
                "kind": "ACCEPTED",
                "at": "2026-03-01T12:00:00Z",
                "mission_state": "ACCEPTED",
            }
        )

    return make


async def kept(db: Database) -> list[str]:
    async with db.read() as connection:
        found = await connection.execute(select(mission_hints.c.mission_id))
        return sorted(found.scalars())


async def test_reports_that_arrive_during_a_write_share_the_next_transaction(
    counting: CountingDatabase, clock: ManualClock, report: Makers
) -> None:
    keeper = ReportKeeper(counting, clock, Pace())
    names = [f"msn_{number}" for number in range(9)]

    await asyncio.gather(*(keeper.keep([report(name)]) for name in names))

    assert await kept(counting) == names
    assert counting.begun <= 2


async def test_one_caller_gets_the_failure_and_the_next_tries_for_all(
    counting: CountingDatabase, clock: ManualClock, report: Makers
) -> None:
    counting.failing = 1
    keeper = ReportKeeper(counting, clock, Pace())

    outcomes = await asyncio.gather(
        *(keeper.keep([report(f"msn_{number}")]) for number in range(3)), return_exceptions=True
    )

    assert [type(outcome) for outcome in outcomes].count(ServiceUnavailable) == 1
    assert await kept(counting) == ["msn_0", "msn_1", "msn_2"]


async def test_a_report_after_a_failure_is_stored(
    counting: CountingDatabase, clock: ManualClock, report: Makers
) -> None:
    counting.failing = 1
    keeper = ReportKeeper(counting, clock, Pace())
    with pytest.raises(ServiceUnavailable):
        await keeper.keep([report("msn_1")])

    await keeper.keep([report("msn_1")])

    assert await kept(counting) == ["msn_1"]
