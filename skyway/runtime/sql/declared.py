"""What a write block has declared: it is written when the block ends, all of it or nothing.

PostgreSQL takes all of it as one statement (`at_once`), since each one to a server is a journey of
its own. SQLite, to which the way is short, takes one after the other (`in_turn`).
"""

from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import Executable, FromClause, Select, Table
from sqlalchemy.engine import CursorResult
from sqlalchemy.sql.dml import ReturningUpdate

#: Column values by name; Any, since a row may hold whatever its columns take.
Row = Mapping[str, Any]

#: Runs a statement of the block. Any: whatever columns it returns.
Run = Callable[[Executable, Any], Awaitable[CursorResult[*tuple[Any, ...]]]]


@dataclass(frozen=True, slots=True)
class Guard:
    """An UPDATE on which all else depends: where it finds no row, nothing is written.

    It names its new values as parameters, and returns a column of each row that it finds.
    """

    statement: ReturningUpdate[*tuple[Any, ...]]  # whatever column it returns
    values: Row
    otherwise: Exception


@dataclass(frozen=True, slots=True)
class Change:
    """New values of rows, each found by its `key` among those that `this` finds.

    The `counted` columns are told what is to be added to them.
    """

    table: Table
    this: Row
    rows: Sequence[Row]
    key: str
    counted: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Consequence:
    """Rows of one table that follow from what the block adds to another, or changes there.

    `selected` finds them, by the names of their columns. It is given the rows that are written on
    PostgreSQL, but the whole table on SQLite, and so says which ones it means.
    """

    into: Table
    of: Table
    selected: Callable[[FromClause], Select[*tuple[Any, ...]]]  # whatever columns there are


@dataclass(frozen=True, slots=True)
class Following:
    """A consequence in one block, and who is told once it is on disk that there was any."""

    consequence: Consequence
    values: Row
    then: Callable[[], None] | None


@dataclass(slots=True)
class Declared:
    """All that one block has declared, in the order in which it is written."""

    guard: Guard | None = None
    changes: list[Change] = field(default_factory=list)
    #: Those of one table have the same columns.
    added: dict[Table, list[Row]] = field(default_factory=dict)
    following: list[Following] = field(default_factory=list)

    def __bool__(self) -> bool:
        return bool(self.guard or self.changes or self.added or self.following)
