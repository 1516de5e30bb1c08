"""docs/reference/mutants.md is what its table says; each file, text and test of it is there."""

import ast
from functools import cache
from pathlib import Path

import pytest

from tools.plant_mutants import Mutant, mutants, page

ROOT = Path(__file__).parents[2]
MUTANTS = mutants()
LONG = "pytest.mark.long"
each_mutant = pytest.mark.parametrize("mutant", MUTANTS, ids=range(1, len(MUTANTS) + 1))


@cache
def names_of_tests(path: Path) -> set[str]:
    """The names of the test functions of a file that `make test` runs: those not marked `long`."""
    nodes = ast.parse(path.read_text()).body
    if any(isinstance(node, ast.Assign) and LONG in ast.unparse(node) for node in nodes):
        return set()
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    return {each.name for each in functions if LONG not in map(ast.unparse, each.decorator_list)}


def test_the_tool_writes_the_same_page() -> None:
    written = (ROOT / "docs/reference/mutants.md").read_text()

    assert page() == written, "run python tools/plant_mutants.py --page"


def test_no_mutant_is_listed_twice() -> None:
    planted = [(each.file, each.old) for each in MUTANTS]

    assert len(planted) == len(set(planted))


@each_mutant
def test_the_text_that_a_mutant_replaces_is_in_its_file_once(mutant: Mutant) -> None:
    text = (ROOT / mutant.file).read_text()

    assert text.count(mutant.old) == 1
    assert mutant.new != mutant.old


@each_mutant
def test_make_test_runs_the_test_that_catches_a_mutant(mutant: Mutant) -> None:
    path, _, name = mutant.test.partition("::")

    assert name in names_of_tests(ROOT / path)
