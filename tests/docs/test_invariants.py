"""docs/reference/invariants.md lists I1 to I17, and says rightly what `verify` checks."""

import re
from pathlib import Path

import pytest
from skyway_composition.verify.rules import RULES as COMPOSITION
from skyway_gateway.verify.rules import RULES as GATEWAY
from skyway_provider_registry.verify import RULES as REGISTRY

from skyway.cli.verify.drone_rules import RULES as ACROSS

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/reference/invariants.md").read_text()
ROWS = [line.strip("| ").split(" | ") for line in PAGE.splitlines() if line.startswith("| I")]


#: Where the rules are that each word of the page stands for.
RULES = {
    "gateway": "gateway/skyway_gateway/verify",
    "composition": "services/skyway_composition/verify",
    "registry": "services/skyway_provider_registry/verify",
    "across": "skyway/cli/verify",
}


def checked_in(folder: str) -> set[str]:
    """The invariants that the rules in a folder name."""
    texts = (path.read_text() for path in (ROOT / folder).glob("*.py"))
    return {number for text in texts for number in re.findall(r"\"(I\d+) ", text)}


def test_the_page_lists_the_seventeen_invariants() -> None:
    assert [row[0] for row in ROWS] == [f"I{number}" for number in range(1, 18)]


@pytest.mark.parametrize("word", RULES)
def test_the_page_says_which_rules_verify_what(word: str) -> None:
    on_page = {row[0] for row in ROWS if word in row[3]}

    assert on_page == checked_in(RULES[word])


def test_each_rule_has_a_name_of_its_own_and_advice() -> None:
    for rules in (GATEWAY, COMPOSITION, REGISTRY, ACROSS):
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
