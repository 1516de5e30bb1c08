"""What composition archives: missions that are over, with their parts; closures and alarms."""

from typing import Final

from sqlalchemy import ColumnElement, Table, func

from skyway.runtime.archive import ArchivedTable
from skyway_composition.tables import (
    alarms,
    better_orders,
    closures,
    custody,
    cut_steps,
    guests,
    instructions,
    is_open,
    mission_steps,
    missions,
    no_shows,
    proofs,
)

#: How the processes share work.
_OF_WORK: Final = frozenset({"retry_wall_ms", "claimed_by", "claimed_until_ms"})

_is_over: Final = ~is_open


def _part(table: Table) -> ArchivedTable:
    """A table of parts of missions; its rows have the day on which their drone was free again."""
    source = table.join(missions, missions.c.mission_id == table.c.mission_id)
    return ArchivedTable(table, missions.c.released_ms, source, _is_over)


def _ended(table: Table, ended_ms: ColumnElement[int]) -> ArchivedTable:
    return ArchivedTable(table, ended_ms, table, ended_ms.is_not(None))


ARCHIVED: Final = (
    ArchivedTable(missions, missions.c.released_ms, missions, _is_over, _OF_WORK),
    *map(_part, (mission_steps, cut_steps, custody, proofs, instructions)),
    ArchivedTable(
        guests,
        missions.c.released_ms,
        guests.join(missions, missions.c.mission_id == guests.c.host_id),
        _is_over,
    ),
    ArchivedTable(no_shows, no_shows.c.at_ms, no_shows, no_shows.c.at_ms.is_not(None)),
    ArchivedTable(
        better_orders, better_orders.c.day_ms, better_orders, better_orders.c.day_ms.is_not(None)
    ),
    _ended(closures, func.coalesce(closures.c.lifted_ms, closures.c.until_ms)),
    _ended(alarms, alarms.c.acknowledged_ms),
)
