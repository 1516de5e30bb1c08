"""Checks one database: its own rules, and the facts in it for the rules across services.

Damage breaks a rule, not the check.
"""

from collections import defaultdict, deque
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import Final

from sqlalchemy import Select, String, cast, literal, union_all
from sqlalchemy.exc import DBAPIError

from skyway.errors import SkywayError
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.sql.database import Database
from skyway.runtime.sql.engines import Dialect
from skyway.runtime.verification.fact_files import FactReader, read_facts, write_facts
from skyway.runtime.verification.rule import BrokenRule, Rule, Survey, statement_text
from skyway.units import moment_to_ms

#: The rule that a damaged page or text breaks.
_UNREADABLE: Final = "every row can be read"

#: What reading a damaged row raises.
_DAMAGED: Final = (ValueError, KeyError, TypeError, SkywayError, DBAPIError)

_RESTORE: Final = (
    "A row is damaged, so this rule could not be checked. Other rules may name the row. Stop the "
    "service, copy its database files away, check the disk, and restore the rows or the newest "
    "backup (docs/reference/operations.md)."
)


async def check(
    db: Database,
    rules: Sequence[Rule],
    readers: Mapping[str, FactReader],
    *,
    folder: Path | None,
    wall_at: datetime,
    fleet_at: datetime | None,
    pause: Callable[[], Awaitable[None]],
) -> list[BrokenRule]:
    """As `find_broken`; the facts are written below a new folder, if one is given."""
    broken = await find_broken(db, rules, wall_at=wall_at, fleet_at=fleet_at, pause=pause)
    if folder is None:
        return broken
    try:
        write_facts(await read_facts(db, readers, wall_at=wall_at), folder)
    except _DAMAGED as error:
        broken.append(_unreadable("the facts for other services", error))
    return broken


async def find_broken(
    db: Database,
    rules: Sequence[Rule],
    *,
    wall_at: datetime,
    fleet_at: datetime | None = None,
    pause: Callable[[], Awaitable[None]],
) -> list[BrokenRule]:
    """Each broken rule with each subject that breaks it, in the order of the rules.

    `fleet_at` is the latest fleet time that it may be; None if it is not known. `pause` waits until
    a running system has settled; then rules that settle are checked again.
    """
    now_ms = moment_to_ms(wall_at), None if fleet_at is None else moment_to_ms(fleet_at)
    broken = await _look(db, rules, now_ms)
    names = {each.rule for each in broken}
    unsettled = [rule for rule in rules if rule.settles and rule.name in names]
    if not unsettled:
        return broken
    await pause()
    again = {(each.rule, each.subject) for each in await _look(db, unsettled, now_ms)}
    settling = {rule.name for rule in unsettled}
    return [
        each for each in broken if each.rule not in settling or (each.rule, each.subject) in again
    ]


async def _look(
    db: Database, rules: Sequence[Rule], now_ms: tuple[int, int | None]
) -> list[BrokenRule]:
    """What breaks the rules now: one statement for all queries, then each function by itself."""
    queries = tuple(rule for rule in rules if isinstance(rule.finder, Select))
    found: dict[str, set[str]] = defaultdict(set)
    unreadables: list[BrokenRule] = []
    left: deque[tuple[Rule, ...]] = deque([queries] if queries else [])
    left += [(rule,) for rule in rules if not isinstance(rule.finder, Select)]
    while left:
        async with db.survey() as connection:
            survey = Survey(connection, db.dialect, *now_ms)
            while left:
                looked_at = left.popleft()
                try:
                    for name, subject in await _broken_now(survey, looked_at):
                        found[name].add(subject)
                except _DAMAGED as error:
                    if len(looked_at) > 1:
                        left.extendleft((rule,) for rule in reversed(looked_at))
                    else:
                        unreadables.append(_unreadable(f"rule {looked_at[0].name!r}", error))
                    # PostgreSQL answers nothing more in this transaction: begin another one.
                    break
    return unreadables + [
        BrokenRule(rule.name, subject, rule.advice)
        for rule in rules
        for subject in sorted(found[rule.name])
    ]


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
