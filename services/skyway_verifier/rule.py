"""A rule of a database, a rule across two services, and a database as rules read it.

What one service has stored, the other must have stored too, and a running system must break no such
rule. So there are two looks, a pause apart, and each rule says which service counts by the first
look: what was settled there must be in the other service by the second look. What is still on its
way explains a difference: a report in an outbox, a booking that is not answered.
"""

from collections import ChainMap
from collections.abc import (
    AsyncIterator,
    Awaitable,
    Callable,
    Iterable,
    Iterator,
    Mapping,
    Sequence,
)
from dataclasses import dataclass, field
from typing import Any, Final, Generic, Literal, Protocol, TypeVar, cast

from sqlalchemy import CompoundSelect, Executable, Select
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.engine import Dialect as SqlDialect
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.runtime.sql.connection import AnyRow, each_row
from skyway.runtime.sql.server_url import Dialect
from skyway_verifier.facts import Facts

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

    async def rows(self, query: Executable, **parameters: int) -> list[AnyRow]:
        """All rows of a query, with these values of its parameters."""
        return list(await self.connection.execute(query, parameters))

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


FactT = TypeVar("FactT")

Service = Literal["gateway", "composition", "registry"]


class HasFacts(Protocol):
    """A look at a database."""

    @property
    def facts(self) -> Facts | None:
        """The facts in the database; None if they could not be read."""
        ...


#: The looks at databases, by service, or by `cell_name`.
Looks = Mapping[str, HasFacts]


def cell_name(number: int) -> str:
    """The name of the database of a cell, which has a part of composition's facts."""
    return f"composition of cell {number}"


def service_of(name: str) -> str:
    """The service of the database of this name."""
    return name.partition(" ")[0]


# Without slots, because a generic class with slots cannot be made with its type.
@dataclass(frozen=True)
class CrossRule(Generic[FactT]):
    """A sentence about the facts of one key in two services; the `second` is read later.

    The finder names what breaks the rule, by a fact of the first service and the fact of the same
    key in the second one, None if there is none.
    """

    name: str
    finder: Callable[[FactT, FactT | None], Iterable[str]]
    advice: str
    first: Service
    second: Service
    facts: Callable[[Facts], Mapping[Any, FactT]]  # Any: keys are texts, or tuples of texts

    def broken(self, look: Looks, later: Looks) -> Iterator[BrokenRule]:
        """What breaks the rule by a look at the first service, and a later one at the second."""
        one, other = _facts_of(self.first, look), _facts_of(self.second, later)
        if one is None or other is None:
            return
        known = ChainMap(*(dict(self.facts(each)) for each in other))
        facts = [fact for each in one for fact in self.facts(each).items()]
        found = {subject for key, fact in facts for subject in self.finder(fact, known.get(key))}
        yield from (BrokenRule(self.name, subject, self.advice) for subject in sorted(found))


def _facts_of(service: Service, looks: Looks) -> Sequence[Facts] | None:
    """The facts of all databases of a service; None if one is missing."""
    facts = [each.facts for name, each in looks.items() if service_of(name) == service]
    return None if None in facts or not facts else [each for each in facts if each is not None]


#: A rule about facts of any kind.
AnyCrossRule = CrossRule[Any]


def broken_across(rules: Sequence[AnyCrossRule], look: Looks, later: Looks) -> list[BrokenRule]:
    """What breaks the rules by two looks; with the same look twice, what may break them."""
    return [each for rule in rules for each in rule.broken(look, later)]


def still_broken(rules: Sequence[AnyCrossRule], look: Looks, later: Looks) -> list[BrokenRule]:
    """What may break the rules by each look alone, and does so by both looks.

    What changed only between the looks is no fault: each service was read at another moment. Nor is
    what a service has deleted since because of its age.
    """
    suspected = frozenset(broken_across(rules, look, look))
    suspected &= frozenset(broken_across(rules, later, later))
    return [each for each in broken_across(rules, look, later) if each in suspected]
