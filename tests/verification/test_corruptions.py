"""Each corruption of a real system's databases is made, and `skyway verify` names it."""

import asyncio

import pytest
from skyway_verifier.across.rules import ACROSS
from skyway_verifier.check import RULES

from tests.end_to_end.verified import broken_rules
from tests.verification.access_corruptions import ACCESS_CORRUPTIONS
from tests.verification.calendar_corruptions import CALENDAR_CORRUPTIONS
from tests.verification.composition_corruptions import COMPOSITION_CORRUPTIONS
from tests.verification.damaged_copies import Corruption, StoppedSystem
from tests.verification.gateway_corruptions import GATEWAY_CORRUPTIONS
from tests.verification.ledger_corruptions import LEDGER_CORRUPTIONS
from tests.verification.mission_corruptions import MISSION_CORRUPTIONS
from tests.verification.newer_corruptions import NEWER_CORRUPTIONS
from tests.verification.registry_corruptions import REGISTRY_CORRUPTIONS
from tests.verification.shared_corruptions import SHARED_CORRUPTIONS
from tests.verification.stopped_system import RATE

pytestmark = [pytest.mark.end_to_end, pytest.mark.fleet_rate(RATE)]

CORRUPTIONS = (
    *GATEWAY_CORRUPTIONS,
    *ACCESS_CORRUPTIONS,
    *LEDGER_CORRUPTIONS,
    *MISSION_CORRUPTIONS,
    *CALENDAR_CORRUPTIONS,
    *SHARED_CORRUPTIONS,
    *COMPOSITION_CORRUPTIONS,
    *REGISTRY_CORRUPTIONS,
    *NEWER_CORRUPTIONS,
)
#: The first corruption of each rule.
FIRST = {each.rule: each for each in reversed(CORRUPTIONS)}
NOTHING = Corruption("nothing", "none")


def test_a_sound_system_breaks_no_rule(
    stopped_system: StoppedSystem, aside: asyncio.Runner
) -> None:
    assert aside.run(stopped_system.broken(NOTHING)) == []


@pytest.mark.parametrize(
    "corruption",
    [
        pytest.param(each, id=each.name, marks=() if FIRST[each.rule] is each else pytest.mark.long)
        for each in CORRUPTIONS
    ],
)
def test_a_corruption_is_named(
    stopped_system: StoppedSystem, aside: asyncio.Runner, corruption: Corruption
) -> None:
    broken = aside.run(stopped_system.broken(corruption))

    assert corruption.rule in {each.rule for each in broken}


@pytest.mark.parametrize("is_across", [False, True], ids=["of one service", "across services"])
def test_the_check_after_stories_names_a_corruption(
    stopped_system: StoppedSystem, aside: asyncio.Runner, is_across: bool
) -> None:
    across = {rule.name for rule in ACROSS}
    corruption = next(
        each
        for each in CORRUPTIONS
        if len(each.scripts) == 1 and (each.rule in across) == is_across
    )
    [(service, script)] = corruption.scripts.items()

    with stopped_system.damaged(service, script):
        broken = aside.run(broken_rules(stopped_system.urls))

    assert corruption.rule in {each.rule for each in broken}


def test_a_corruption_is_undone_before_the_next(
    stopped_system: StoppedSystem, aside: asyncio.Runner
) -> None:
    for corruption in (GATEWAY_CORRUPTIONS[0], COMPOSITION_CORRUPTIONS[0]):
        aside.run(stopped_system.broken(corruption))

    assert aside.run(stopped_system.looked_at_again()) == []


def test_each_rule_names_a_corruption() -> None:
    """A rule that nothing can break checks nothing."""
    named = {corruption.rule for corruption in CORRUPTIONS}
    rules = {rule.name for every in RULES.values() for rule in every}
    rules |= {rule.name for rule in ACROSS}

    assert named == rules


def test_corruptions_have_different_names() -> None:
    assert len({corruption.name for corruption in CORRUPTIONS}) == len(CORRUPTIONS) >= 47
