"""A database that fails when a calendar changes and keeps its number."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

from skyway_composition.missions.mission.record import read_record
from skyway_composition.tables import drone_links, is_open, missions
from sqlalchemy import select

from skyway.ids import DroneId
from skyway.runtime.sql.database import Database, Tx


@dataclass(frozen=True, slots=True)
class SeenCalendar:
    """What others plan with: the open missions of a drone, its hold, and whether it is occupied."""

    version: int
    content: tuple[Any, ...]


class WatchedDatabase(Database):
    """Composition's database; after each transaction it compares all calendars with the last."""

    calendars: dict[DroneId, SeenCalendar] | None = None

    @asynccontextmanager
    async def write(self) -> AsyncIterator[Tx]:
        async with super().write() as tx:
            yield tx
        before, self.calendars = self.calendars or {}, await calendars_in(self)
        for drone_id, now in self.calendars.items():
            seen = before.get(drone_id)
            if seen is not None and seen.content != now.content:
                assert seen.version < now.version, (drone_id, seen, now)


async def calendars_in(db: Database) -> dict[DroneId, SeenCalendar]:
    """The calendars of all drones, read anew."""
    async with db.read() as connection:
        links = (await connection.execute(select(drone_links))).all()
        rows = (await connection.execute(select(missions).where(is_open))).all()
    entries = {row.mission_id: (row.drone_id, read_record(row).in_calendar) for row in rows}
    return {
        link.drone_id: SeenCalendar(
            link.calendar_version,
            (
                link.held_by,
                link.is_occupied,
                *(entry for drone_id, entry in entries.values() if drone_id == link.drone_id),
            ),
        )
        for link in links
    }
