"""docs/reference/mutants.md is what its table says; each file, text and test of it is there."""

import ast
from functools import cache
from pathlib import Path

from tools.plant_mutants import mutants, page

ROOT = Path(__file__).parents[2]
MUTANTS = mutants()
#: How a test or some of its cases are marked: see tests/long_cases.py.
LONG = ("pytest.mark.long", "sampled(")


@cache
def names_of_tests(path: Path) -> frozenset[str]:
    """The names of the test functions of a file that `make test` runs whole.

    A test that is marked `long`, or that has a case marked `long`, is not among them.
    """
    nodes = ast.parse(path.read_text()).body
    assigned = {
        ast.unparse(target): ast.unparse(node.value)
        for node in nodes
        if isinstance(node, ast.Assign)
        for target in node.targets
    }
    if _names_mark(assigned.get("pytestmark", "")):
        return frozenset()
    long_names = {name for name, value in assigned.items() if _names_mark(value)}
    return frozenset(
        node.name
        for node in nodes
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and not any(_is_long(each, long_names) for each in node.decorator_list)
    )


def _names_mark(source: str) -> bool:
    return any(mark in source for mark in LONG)


def _is_long(decorator: ast.expr, long_names: set[str]) -> bool:
    """Whether a decorator marks a test or one of its cases `long`, here or by an assigned name."""
    names = {node.id for node in ast.walk(decorator) if isinstance(node, ast.Name)}
    return _names_mark(ast.unparse(decorator)) or not names.isdisjoint(long_names)


def test_the_tool_writes_the_same_page() -> None:
    written = (ROOT / "docs/reference/mutants.md").read_text()

    assert page() == written, "run python tools/plant_mutants.py --page"


def test_no_mutant_is_listed_twice() -> None:
    planted = [(each.file, each.old) for each in MUTANTS]

    assert len(planted) == len(set(planted))


def test_the_text_that_a_mutant_replaces_is_in_its_file_once() -> None:
    counts = {each: (ROOT / each.file).read_text().count(each.old) for each in MUTANTS}

    assert {each.change: count for each, count in counts.items() if count != 1} == {}
    assert [each.change for each in MUTANTS if each.new == each.old] == []


def test_make_test_runs_the_test_that_catches_a_mutant() -> None:
    named = {each.change: each.test.partition("::") for each in MUTANTS}

    assert {
        change: name
        for change, (path, _, name) in named.items()
        if name not in names_of_tests(ROOT / path)
    } == {}


def test_a_test_with_a_long_case_is_not_what_make_test_runs_whole(tmp_path: Path) -> None:
    file = tmp_path / "test_made.py"
    file.write_text(
        """
SOME = [1, pytest.param(2, marks=pytest.mark.long)]

@pytest.mark.parametrize("n", [1, pytest.param(2, marks=pytest.mark.long)])
def test_with_a_long_case(n): ...

@pytest.mark.parametrize("n", SOME)
def test_with_a_long_case_by_name(n): ...

@pytest.mark.parametrize("n", sampled([1, 2], every=2))
def test_of_which_a_sample_is_run(n): ...

@pytest.mark.long
def test_long(): ...

@pytest.mark.parametrize("n", [1, 2])
def test_short(n): ...
"""
    )

    assert names_of_tests(file) == {"test_short"}
