"""Looks at databases: what settles is no fault, and damage stops no other check."""

from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from typing import Any, Final

import pytest
from skyway_verifier.check import Checked, Findings, check
from skyway_verifier.facts import Facts
from skyway_verifier.rule import CrossRule, Rule, Survey

from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.sql.server_url import Dialect

NOW: Final = datetime(2026, 3, 1, 12, tzinfo=UTC)


class Surveys:
    """A database of which nothing is read; it counts its surveys."""

    dialect: Dialect = "sqlite"

    def __init__(self, *, is_away: bool = False) -> None:
        self.count = 0
        self._is_away = is_away

    @asynccontextmanager
    async def survey(self) -> AsyncIterator[Any]:
        """No connection."""
        self.count += 1
        if self._is_away:
            raise ServiceUnavailable("database", "no connection")
        yield None


def rule(
    find: Callable[[], Sequence[str]], *, name: str = "drones stand", settles: bool = False
) -> Rule:
    """A rule that is broken by what a function finds at each look."""

    async def finder(_: Survey) -> Sequence[str]:
        return find()

    return Rule(name, finder, "Look.", settles)


def providers(*looks: Sequence[str]) -> Callable[[Survey], Any]:
    """Reads these providers as facts, other ones at each look."""
    left = iter(looks)

    async def read(_: Survey) -> Facts:
        return Facts(providers={each: each for each in next(left)})

    return read


KNOWN: Final = CrossRule[str](
    "a provider is known",
    lambda own, known: () if known else (own,),
    "Look.",
    first="gateway",
    second="registry",
    facts=lambda facts: facts.providers,
)


async def across(gateway: Checked, registry: Checked) -> Findings:
    databases = {"gateway": gateway, "registry": registry}
    return await check(databases, [KNOWN], wall_at=NOW, pauses_s=(0.0,))


async def test_a_sound_database_gets_a_single_look() -> None:
    db = Surveys()

    found = await check({"gateway": Checked(db, [rule(list)])}, wall_at=NOW)

    assert (found.broken, db.count) == ({"gateway": []}, 1)


@pytest.mark.parametrize(("later", "subjects"), [(["drn_1"], ["drn_1"]), ([], [])])
async def test_a_rule_that_settles_is_broken_by_what_breaks_it_twice(
    later: list[str], subjects: list[str]
) -> None:
    looks = iter([["drn_1", "drn_2"], later])
    checked = Checked(Surveys(), [rule(lambda: next(looks), settles=True)])

    found = await check({"gateway": checked}, wall_at=NOW, pauses_s=(0.0,))

    assert [each.subject for each in found.broken["gateway"]] == subjects


async def test_a_difference_that_settles_breaks_no_rule() -> None:
    gateway = Checked(Surveys(), (), providers(["prv_1"], ["prv_1"]))
    registry = Checked(Surveys(), (), providers([], ["prv_1"]))

    found = await across(gateway, registry)

    assert "across services" not in found.broken


async def test_a_difference_that_stays_breaks_a_rule() -> None:
    gateway = Checked(Surveys(), (), providers(["prv_1"], ["prv_1"]))
    registry = Checked(Surveys(), (), providers([], []))

    found = await across(gateway, registry)

    assert [each.subject for each in found.broken["across services"]] == ["prv_1"]


async def test_a_database_that_is_away_is_named_and_the_other_one_is_checked() -> None:
    gateway = Checked(Surveys(), [rule(lambda: ["drn_1"])], providers(["prv_1"]))
    registry = Checked(Surveys(is_away=True), (), providers([]))

    found = await across(gateway, registry)

    assert [each.subject for each in found.broken["gateway"]] == ["drn_1"]
    assert found.errors == {"registry": "database is unavailable: no connection"}
    assert (found.checked, "across services" in found.broken) == (1, False)


async def test_damage_breaks_a_rule_and_the_others_are_checked() -> None:
    def damaged() -> Sequence[str]:
        raise ValueError("half of a row")

    rules = [rule(damaged), rule(lambda: ["drn_1"], name="drones fly")]
    found = await check({"gateway": Checked(Surveys(), rules)}, wall_at=NOW)

    broken = [each.rule for each in found.broken["gateway"]]
    assert broken == ["every row can be read", "drones fly"]
