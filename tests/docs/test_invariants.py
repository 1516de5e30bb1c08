"""docs/reference/invariants.md lists I1 to I17, and says rightly what `verify` checks."""

import re
from collections.abc import Sequence
from pathlib import Path

import pytest
from skyway_verifier.across.rules import ACROSS
from skyway_verifier.check import RULES
from skyway_verifier.rule import AnyCrossRule, Rule

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/reference/invariants.md").read_text()
ROWS = [line.strip("| ").split(" | ") for line in PAGE.splitlines() if line.startswith("| I")]


#: The rules that each word of the page stands for.
RULES_OF: dict[str, Sequence[Rule | AnyCrossRule]] = {**RULES, "across": ACROSS}


def test_the_page_lists_the_seventeen_invariants() -> None:
    assert [row[0] for row in ROWS] == [f"I{number}" for number in range(1, 18)]


@pytest.mark.parametrize("word", RULES_OF)
def test_the_page_says_which_rules_verify_what(word: str) -> None:
    on_page = {row[0] for row in ROWS if word in row[3]}

    names = (rule.name for rule in RULES_OF[word])
    assert on_page == {name.partition(" ")[0] for name in names if re.match(r"I\d+ ", name)}


def test_each_rule_has_a_name_of_its_own_and_advice() -> None:
    for rules in RULES_OF.values():
        names = [rule.name for rule in rules]
        assert len(names) == len(set(names))
        assert all(rule.advice.endswith((".", "`")) for rule in rules)


def test_every_invariant_that_code_or_tests_name_is_on_the_page() -> None:
    numbers = {
        int(number)
        for folder in ("gateway", "services", "tests")
        for path in (ROOT / folder).rglob("*.py")
        for number in re.findall(r"\bI(\d{1,2})(?=[:)\s]| to I)", path.read_text())
    }

    assert numbers
    assert numbers <= set(range(1, 18))
