"""Looks at databases: what breaks their own rules, and their facts for the rules across services.

Each look reads each database at one moment. A rule holds in every state of a running system unless
it settles, and a rule across services compares different moments. What seems broken by these is
looked at again after a pause. Damage breaks a rule, not the check.
"""

import asyncio
from collections import defaultdict, deque
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from contextlib import AsyncExitStack
from dataclasses import dataclass
from datetime import datetime
from functools import lru_cache
from typing import Final, NamedTuple

from sqlalchemy import Select, String, cast, literal, union_all
from sqlalchemy.exc import DBAPIError

from skyway.errors import SkywayError
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.errors import DamagedDatabase, ServiceUnavailable
from skyway.runtime.sql.read_only import ReadOnlyDatabase, Surveyed
from skyway.runtime.sql.server_url import Dialect
from skyway.units import moment_to_ms
from skyway_verifier.across.rules import ACROSS
from skyway_verifier.composition.rules import RULES as COMPOSITION
from skyway_verifier.composition.rules import read_facts as composition_facts
from skyway_verifier.facts import Facts
from skyway_verifier.gateway.rules import RULES as GATEWAY
from skyway_verifier.gateway.rules import read_facts as gateway_facts
from skyway_verifier.registry.rules import RULES as REGISTRY
from skyway_verifier.registry.rules import read_facts as registry_facts
from skyway_verifier.rule import (
    AnyCrossRule,
    BrokenRule,
    Rule,
    Survey,
    broken_across,
    service_of,
    statement_text,
    still_broken,
)

#: The rule that a damaged page or text breaks.
_UNREADABLE: Final = "every row can be read"

#: What reading a damaged row raises.
_DAMAGED: Final = (ValueError, KeyError, TypeError, SkywayError, DBAPIError)

_RESTORE: Final = (
    "A row is damaged, so this rule could not be checked. Other rules may name the row. Stop the "
    "service, copy its database files away, check the disk, and restore the rows or the newest "
    "backup (docs/reference/operations.md)."
)

_RESTORE_ALL: Final = (
    "The database is damaged, or of another version of Skyway. Stop the service, copy its database "
    "files away, check the disk, and restore the newest backup (docs/reference/operations.md)."
)

#: Reads the facts of a database.
FactReader = Callable[[Survey], Awaitable[Facts]]

#: How long a running system needs to settle, seconds of wall time.
SETTLES_WITHIN_S: Final = 2.0

#: Wall time, and the latest fleet time that it may be if it is known; ms since 1970.
_Now = tuple[int, int | None]


@dataclass(frozen=True, slots=True)
class Checked:
    """A database, the rules that it must keep, and who reads its facts; None if nobody does."""

    db: Surveyed
    rules: Sequence[Rule]
    read_facts: FactReader | None = None


@dataclass(frozen=True, slots=True)
class Look:
    """What breaks the rules of a database, and its facts: None if a damaged row is among them.

    Nothing was checked if there is an error: the database could not be opened, or did not answer.
    """

    broken: Sequence[BrokenRule] = ()
    facts: Facts | None = None
    error: str | None = None


class Findings(NamedTuple):
    """What is broken by database and `across services`, and why databases were not checked."""

    broken: Mapping[str, Sequence[BrokenRule]]
    errors: Mapping[str, str]
    checked: int


async def check(
    databases: Mapping[str, Checked],
    across: Sequence[AnyCrossRule] = (),
    *,
    wall_at: datetime,
    fleet_at: datetime | None = None,
    pauses_s: Sequence[float] = (SETTLES_WITHIN_S,),
) -> Findings:
    """Each broken rule with each subject that breaks it, in the order of the rules.

    `fleet_at` is the latest fleet time that it may be; None if it is not known.
    """
    now = moment_to_ms(wall_at), None if fleet_at is None else moment_to_ms(fleet_at)
    first = await _look_at_all(databases, now)
    found = {name: list(look.broken) for name, look in first.items()}
    between = broken_across(across, first, first)
    for pause_s in pauses_s:
        unsettled = {
            name: Checked(
                checked.db,
                [each for each in checked.rules if each.settles and _has_broken(found[name], each)],
                checked.read_facts if between else None,
            )
            for name, checked in databases.items()
        }
        if not between and not any(each.rules for each in unsettled.values()):
            break
        await asyncio.sleep(pause_s)
        later = await _look_at_all(unsettled, now)
        for name, checked in unsettled.items():
            passing = {each.name for each in checked.rules}
            found[name] = [
                each
                for each in found[name]
                if each.rule not in passing or each in later[name].broken
            ]
        between = still_broken(across, first, later) if between else []
    errors = {name: look.error for name, look in first.items() if look.error is not None}
    if between:
        found["across services"] = between
    return Findings(found, errors, checked=len(first) - len(errors))


def _has_broken(found: Iterable[BrokenRule], rule: Rule) -> bool:
    return any(each.rule == rule.name for each in found)


async def _look_at_all(databases: Mapping[str, Checked], now: _Now) -> dict[str, Look]:
    """Look at each database, side by side."""
    looks = await asyncio.gather(*(_look(each, now) for each in databases.values()))
    return dict(zip(databases, looks, strict=True))


async def _look(checked: Checked, now: _Now) -> Look:
    try:
        return await _read(checked, now)
    except DamagedDatabase as error:
        return Look([BrokenRule("the database can be opened", str(error), _RESTORE_ALL)])
    except ServiceUnavailable as error:
        reason = getattr(error.__cause__, "orig", None) or error.__cause__
        return Look(error=f"{error}{f' ({reason})' if reason else ''}")


async def _read(checked: Checked, now: _Now) -> Look:
    """One statement for all queries, then each function by itself, and the facts at last."""
    queries = tuple(rule for rule in checked.rules if isinstance(rule.finder, Select))
    found: dict[str, set[str]] = defaultdict(set)
    unreadables: list[BrokenRule] = []
    facts: Facts | None = None
    left: deque[tuple[Rule, ...] | FactReader] = deque([queries] if queries else [])
    left += [(rule,) for rule in checked.rules if not isinstance(rule.finder, Select)]
    left += [checked.read_facts] if checked.read_facts else []
    while left:
        async with checked.db.survey() as connection:
            survey = Survey(connection, checked.db.dialect, *now)
            while left:
                task = left.popleft()
                try:
                    if not isinstance(task, tuple):
                        facts = await task(survey)
                        continue
                    for name, subject in await _broken_now(survey, task):
                        found[name].add(subject)
                except _DAMAGED as error:
                    if not isinstance(task, tuple):
                        unreadables.append(_unreadable("the facts for other services", error))
                    elif len(task) > 1:
                        left.extendleft((rule,) for rule in reversed(task))
                    else:
                        unreadables.append(_unreadable(f"rule {task[0].name!r}", error))
                    # PostgreSQL answers nothing more in this transaction: begin another one.
                    break
    own = [
        BrokenRule(rule.name, subject, rule.advice)
        for rule in checked.rules
        for subject in sorted(found[rule.name])
    ]
    return Look(unreadables + own, facts)


async def _broken_now(survey: Survey, rules: tuple[Rule, ...]) -> Iterable[tuple[str, str]]:
    """The names of these rules and the subjects that break them: of one rule, or of queries."""
    [rule, *others] = rules
    if not others and not isinstance(rule.finder, Select):
        return [(rule.name, subject) for subject in await rule.finder(survey)]
    return [(name, subject) for name, subject in await survey.texts(_text(rules, survey.dialect))]


@lru_cache(maxsize=100)
def _text(rules: tuple[Rule, ...], dialect: Dialect) -> str:
    """One statement that finds the name of each broken rule and each subject that breaks it."""
    named = (
        rule.finder.with_only_columns(
            literal(rule.name, String),
            cast(rule.finder.selected_columns[0], String),
            maintain_column_froms=True,
        )
        for rule in rules
        if isinstance(rule.finder, Select)
    )
    return statement_text(union_all(*named), dialect)


def _unreadable(what: str, error: Exception) -> BrokenRule:
    """The rule that a damaged row breaks; the row keeps `what` from finding anything else.

    Raises the error again if no row causes it, because the database does not answer.
    """
    if isinstance(error, ServiceUnavailable) or getattr(error, "connection_invalidated", False):
        raise error
    detail = getattr(error, "orig", None) or error
    return BrokenRule(_UNREADABLE, f"{what}: {type(detail).__name__}: {detail}", _RESTORE)


#: The rules of each service's database.
RULES: Final[Mapping[str, tuple[Rule, ...]]] = {
    "registry": REGISTRY,
    "composition": COMPOSITION,
    "gateway": GATEWAY,
}

_FACT_READERS: Final[Mapping[str, FactReader]] = {
    "registry": registry_facts,
    "composition": composition_facts,
    "gateway": gateway_facts,
}

#: How far ahead of this machine's clock the clocks of others may be.
_AHEAD_S: Final = {"fleet_s": 600.0, "wall_s": 30.0}


def checked_as(service: str, db: Surveyed) -> Checked:
    """How a database of this service is checked."""
    return Checked(db, RULES[service], _FACT_READERS[service])


def verify(urls: Mapping[str, str], clock: FleetClock) -> Findings:
    """What is broken in the databases of these URLs, by service, or by `cell_name`.

    Rules across services are left out where a database of one of the two is missing.
    """
    return asyncio.run(_verify(urls, clock))


async def _verify(urls: Mapping[str, str], clock: FleetClock) -> Findings:
    async with AsyncExitStack() as opened:
        checked = {
            name: checked_as(
                service_of(name), await opened.enter_async_context(ReadOnlyDatabase(url))
            )
            for name, url in urls.items()
        }
        fleet_at = clock.now() + fleet_margin(clock, **_AHEAD_S)
        return await check(checked, ACROSS, wall_at=clock.wall_now(), fleet_at=fleet_at)
