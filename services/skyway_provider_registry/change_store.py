"""All SQL of the change numbers, by which a reader finds the changes since its last read.

Every write that candidates depend on gets the next number first, before it touches another row. Its
row lock lasts until the commit. So numbers are committed in order, and a reader that has seen a
number has seen all smaller numbers. Getting the number first also prevents deadlocks of writers.
"""

from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy.dialects import postgresql
from sqlalchemy.sql.dml import ReturningInsert

from skyway.runtime.sql.database import Tx
from skyway_provider_registry.tables import changes

#: The key of the only row.
ONLY_ROW: Final = 1


@dataclass(frozen=True, slots=True)
class ChangeMarks:
    """The numbers of the last change, of the last provider change and of the last removal."""

    latest: int = 0
    providers: int = 0
    removals: int = 0


async def next_change(tx: Tx) -> int:
    """The number of this write; the write stores it in `changed` of each row that it changes."""
    return await _number(tx, _NEXT)


async def mark_providers(tx: Tx) -> None:
    """Make every reader read the providers again."""
    await _number(tx, _NEXT_OF_PROVIDERS)


async def mark_removal(tx: Tx) -> None:
    """Make every reader read all drones again: a deleted row leaves no other trace."""
    await _number(tx, _NEXT_REMOVAL)


async def _number(tx: Tx, statement: ReturningInsert[*tuple[Any, ...]]) -> int:
    return int((await tx.execute(statement)).scalar_one())


def _numbering(*named: str) -> ReturningInsert[*tuple[Any, ...]]:
    """A statement that returns the next number; it also becomes the number of the named kinds."""
    first = {"only": ONLY_ROW, "latest": 1} | dict.fromkeys(("providers", "removals"), 0)
    following: dict[str, Any] = dict.fromkeys(("latest", *named), changes.c.latest + 1)
    # This also works with SQLite: both dialects write ON CONFLICT in the same way.
    statement = postgresql.insert(changes).values(first | dict.fromkeys(named, 1))
    statement = statement.on_conflict_do_update(index_elements=["only"], set_=following)
    return statement.returning(changes.c.latest)


_NEXT: Final = _numbering()
_NEXT_OF_PROVIDERS: Final = _numbering("providers")
_NEXT_REMOVAL: Final = _numbering("removals")
