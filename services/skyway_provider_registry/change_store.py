"""All SQL of the change numbers.

Every write that candidates depend on takes the next number first, before any other row: its row
lock lasts until the commit. So numbers are committed in their order, and who has seen one has seen
all that came before it. Taking it first also keeps writers from waiting for each other in a ring.
"""

from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy.dialects import postgresql
from sqlalchemy.sql.dml import ReturningInsert

from skyway.runtime.sql.database import Tx
from skyway_provider_registry.tables import changes

#: There is one row.
ONLY_ROW: Final = 1


@dataclass(frozen=True, slots=True)
class ChangeMarks:
    """The last number taken, and those under which providers changed and a drone was removed."""

    latest: int = 0
    providers: int = 0
    removals: int = 0


async def next_change(tx: Tx) -> int:
    """The number of this write, for the `changed` of the rows that it changes."""
    return await _taken(tx, _NEXT)


async def mark_providers(tx: Tx) -> None:
    """Have every reader read the providers again."""
    await _taken(tx, _NEXT_OF_PROVIDERS)


async def mark_removal(tx: Tx) -> None:
    """Have every reader read all drones again: of a row that is gone nothing else tells."""
    await _taken(tx, _NEXT_REMOVAL)


async def _taken(tx: Tx, statement: ReturningInsert[*tuple[Any, ...]]) -> int:
    return int((await tx.execute(statement)).scalar_one())


def _taking(*named: str) -> ReturningInsert[*tuple[Any, ...]]:
    """Takes the next number, as that of all changes and of the named ones."""
    first = {"only": ONLY_ROW, "latest": 1} | dict.fromkeys(("providers", "removals"), 0)
    following: dict[str, Any] = dict.fromkeys(("latest", *named), changes.c.latest + 1)
    # SQLite's compiler takes it as it is: both spell ON CONFLICT the same.
    statement = postgresql.insert(changes).values(first | dict.fromkeys(named, 1))
    statement = statement.on_conflict_do_update(index_elements=["only"], set_=following)
    return statement.returning(changes.c.latest)


_NEXT: Final = _taking()
_NEXT_OF_PROVIDERS: Final = _taking("providers")
_NEXT_REMOVAL: Final = _taking("removals")
