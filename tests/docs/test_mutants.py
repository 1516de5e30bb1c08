"""docs/reference/mutants.md is what its table says; each file, text and test of it is there."""

import ast
from functools import cache
from pathlib import Path

import pytest

from tools.plant_mutants import Mutant, mutants, page

ROOT = Path(__file__).parents[2]
MUTANTS = mutants()
each_mutant = pytest.mark.parametrize("mutant", MUTANTS, ids=range(1, len(MUTANTS) + 1))


@cache
def names_of_tests(path: Path) -> set[str]:
    """The names of the test functions of a file."""
    functions = (ast.FunctionDef, ast.AsyncFunctionDef)
    nodes = ast.parse(path.read_text()).body
    return {node.name for node in nodes if isinstance(node, functions)}


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
def test_the_test_that_catches_a_mutant_exists(mutant: Mutant) -> None:
    path, _, name = mutant.test.partition("::")

    assert name in names_of_tests(ROOT / path)
