"""docs/reference/invariants.md lists I1 to I15, and says rightly what `verify` checks."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/reference/invariants.md").read_text()
ROWS = [line.strip("| ").split(" | ") for line in PAGE.splitlines() if line.startswith("| I")]


def checked_by(service: str) -> set[str]:
    """The invariants that the rules of a service's verify module name."""
    (module,) = ROOT.glob(f"*/{service}/verify.py")
    return set(re.findall(r"\"(I\d+)\b", module.read_text()))


def test_the_page_lists_the_fifteen_invariants() -> None:
    assert [row[0] for row in ROWS] == [f"I{number}" for number in range(1, 16)]


def test_the_page_says_which_service_verifies_what() -> None:
    for word, service in (("gateway", "skyway_gateway"), ("composition", "skyway_composition")):
        on_page = {row[0] for row in ROWS if word in row[3]}
        assert on_page == checked_by(service)


def test_every_invariant_that_code_or_tests_name_is_on_the_page() -> None:
    numbers = {
        int(number)
        for folder in ("gateway", "services", "tests")
        for path in (ROOT / folder).rglob("*.py")
        for number in re.findall(r"\bI(\d{1,2})(?=[:)\s]| to I)", path.read_text())
    }

    assert numbers
    assert numbers <= set(range(1, 16))
