"""All SQL of the missions of test deliveries, and of the reports that are still to be played."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from pydantic import TypeAdapter
from sqlalchemy import delete, insert, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.mission import Mission
from skyway.contracts.mission_reports import MissionReport
from skyway.ids import DeliveryId, MissionId
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms
from skyway_gateway.delivery_tables import deliveries
from skyway_gateway.tables import sandbox_missions

REPORTS: Final = TypeAdapter(tuple[MissionReport, ...])


@dataclass(frozen=True, slots=True)
class SandboxMission:
    """A mission, its reports, and how many of them have happened."""

    mission: Mission
    reports: tuple[MissionReport, ...]
    played: int

    @property
    def is_over(self) -> bool:
        """Whether nothing more happens."""
        return self.played == len(self.reports)


async def add(tx: Tx, booked: SandboxMission, *, next_at: datetime) -> None:
    """Add a booked mission, whose first report is due at `next_at`, wall time."""
    mission = booked.mission
    row = {
        "mission_id": mission.mission_id,
        "delivery_id": mission.delivery_id,
        "attempt": mission.attempt,
        "mission": mission.model_dump_json(),
        "reports": REPORTS.dump_json(booked.reports).decode(),
        "played": booked.played,
        "next_wall_ms": moment_to_ms(next_at),
    }
    await tx.execute(insert(sandbox_missions).values(row))


async def of_delivery(
    connection: AsyncConnection, delivery_id: DeliveryId
) -> Sequence[SandboxMission]:
    """The missions of a delivery, by their attempts."""
    statement = select(sandbox_missions).where(sandbox_missions.c.delivery_id == delivery_id)
    rows = await connection.execute(statement.order_by(sandbox_missions.c.attempt))
    return [_mission(row) for row in rows]


async def locked(tx: Tx, mission_id: MissionId) -> SandboxMission | None:
    """A mission that nobody else changes until the transaction ends; None if there is none."""
    statement = (
        select(sandbox_missions)
        .where(sandbox_missions.c.mission_id == mission_id)
        .with_for_update()
    )
    row = (await tx.execute(statement)).one_or_none()
    return None if row is None else _mission(row)


async def lock_delivery(tx: Tx, delivery_id: DeliveryId) -> str | None:
    """The state of a delivery that nobody else changes until the transaction ends."""
    this = deliveries.c.delivery_id == delivery_id
    found = await tx.execute(select(deliveries.c.state).where(this).with_for_update())
    state: str | None = found.scalar_one_or_none()
    return state


async def due(connection: AsyncConnection, *, at: datetime, limit: int) -> Sequence[MissionId]:
    """The missions with something to do at this moment of wall time, the longest due first."""
    statement = (
        select(sandbox_missions.c.mission_id)
        .where(sandbox_missions.c.next_wall_ms <= moment_to_ms(at))
        .order_by(sandbox_missions.c.next_wall_ms, sandbox_missions.c.mission_id)
        .limit(limit)
    )
    return list((await connection.execute(statement)).scalars())


async def save(tx: Tx, changed: SandboxMission, *, next_at: datetime | None) -> None:
    """Store the reports and how many have happened; without `next_at` nothing more is due."""
    values = {
        "reports": REPORTS.dump_json(changed.reports).decode(),
        "played": changed.played,
        "next_wall_ms": None if next_at is None else moment_to_ms(next_at),
    }
    this = sandbox_missions.c.mission_id == changed.mission.mission_id
    await tx.execute(update(sandbox_missions).where(this).values(values))


async def delete_of(tx: Tx, delivery_ids: Collection[DeliveryId]) -> None:
    """Delete the missions of these deliveries."""
    named = sandbox_missions.c.delivery_id.in_(sorted(delivery_ids))
    await tx.execute(delete(sandbox_missions).where(named))


def _mission(row: AnyRow) -> SandboxMission:
    return SandboxMission(Mission.read(row.mission), REPORTS.validate_json(row.reports), row.played)
