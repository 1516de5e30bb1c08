"""Dry runs in tests: they leave every row as it was."""

from typing import Any

from skyway_composition.missions.interventions.give_command import Command, preview_command
from skyway_composition.missions.replanning.foresee import Foresight
from skyway_composition.tables import metadata
from sqlalchemy import select

from skyway.ids import MissionId
from skyway.runtime.errors import Conflict
from skyway.runtime.sql.database import Database
from tests.composition.busy_world import BusyWorld


async def all_rows(db: Database) -> dict[str, list[str]]:
    """Every row of every table, as text."""
    async with db.read() as connection:
        return {
            table.name: sorted(map(repr, await connection.execute(select(table))))
            for table in metadata.sorted_tables
        }


async def preview(world: BusyWorld, mission_id: MissionId, wish: dict[str, Any]) -> None:
    """Preview a command in a busy world, and check that this changes nothing."""
    command, foresight = Command.model_validate(wish), Foresight(world.context)
    before = await all_rows(world.db)
    try:
        shown = await preview_command(world.context, foresight, mission_id, command)
    except Conflict:
        shown = None
    assert await all_rows(world.db) == before
    assert shown is None or shown.outlook.plan != "TIME_UP"
