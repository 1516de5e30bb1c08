"""A rule that a database must keep, and a database at one moment, as rules read it."""

from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar, cast

from sqlalchemy import CompoundSelect, Executable, Select
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.engine import Dialect as SqlDialect
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.runtime.sql.connection import AnyRow, each_row
from skyway.runtime.sql.server_url import Dialect

T = TypeVar("T")

_DIALECTS: Final[dict[Dialect, SqlDialect]] = {
    # With this style a percent sign is not doubled.
    "sqlite": sqlite.dialect(paramstyle="named"),
    "postgresql": postgresql.dialect(paramstyle="named"),  # type: ignore[no-untyped-call]
}


#: A query whose first column names what breaks a rule. Any: columns have every type.
Subjects = Select[*tuple[Any, ...]]


@dataclass(slots=True)
class Survey:
    """One moment of a database; `wall_ms` is the wall time of that moment, ms since 1970.

    `fleet_ms` is the latest fleet time that it may be then on any machine; None if it is not known.
    """

    connection: AsyncConnection
    dialect: Dialect
    wall_ms: int
    fleet_ms: int | None = None
    _loaded: dict[object, object] = field(default_factory=dict)

    async def texts(self, statement: str) -> list[tuple[str, ...]]:
        """The rows of a statement that is given as text, with each value as text."""
        rows: Iterable[Sequence[object]] = await self.connection.exec_driver_sql(statement)
        return [tuple(map(str, row)) for row in rows]

    async def rows(self, query: Executable) -> list[AnyRow]:
        """All rows of a query."""
        return list(await self.connection.execute(query))

    def each(self, query: Executable) -> AsyncIterator[AnyRow]:
        """The rows of a query one by one, for queries with more rows than fit into memory."""
        return each_row(self.connection, query)

    async def once(self, load: Callable[["Survey"], Awaitable[T]]) -> T:
        """What a function loads from this survey; several rules share one load."""
        if load not in self._loaded:
            self._loaded[load] = await load(self)
        return cast("T", self._loaded[load])


def statement_text(query: Select[Any] | CompoundSelect[Any], dialect: Dialect) -> str:
    """The SQL of a query with its values in it; Any: columns have every type.

    Making it takes longer than running it, so callers keep it where they can.
    """
    return str(query.compile(dialect=_DIALECTS[dialect], compile_kwargs={"literal_binds": True}))


#: Finds what breaks a rule, by a query or by a function of the survey.
Finder = Subjects | Callable[[Survey], Awaitable[Iterable[str]]]


@dataclass(frozen=True, slots=True)
class Rule:
    """A sentence that must hold, a finder of the subjects that break it, and advice.

    A rule holds in every state of a running system, unless it `settles`: such a rule is broken only
    when the same subject breaks it twice, a pause apart.
    """

    name: str
    finder: Finder
    advice: str
    settles: bool = False


@dataclass(frozen=True, slots=True, order=True)
class BrokenRule:
    """A rule that a subject breaks, and what a person can do about it."""

    rule: str
    subject: str
    advice: str
