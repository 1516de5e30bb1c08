"""A migration leaves the tables usable for the release before it, or says that it does not.

During an upgrade replicas of two versions use one database, and a rollback starts the older version
on the newer tables. docs/kubernetes.md explains the rule: expand first, contract a release later.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

ROOT: Final = Path(__file__).parents[2]
MIGRATIONS: Final = sorted(ROOT.glob("*/skyway_*/migrations/versions/0*.py"))

_CONTRACTING: Final = {"drop_column", "drop_table", "drop_constraint", "rename_table"}
_SQL: Final = re.compile(
    r"\bDROP (?:TABLE|COLUMN|CONSTRAINT)\b|\bRENAME\b|\bSET NOT NULL\b|\bALTER COLUMN \w+ TYPE\b"
    r"|\bADD COLUMN (?:(?!DEFAULT|,).)*\bNOT NULL(?!.*\bDEFAULT\b)"
)
_OLDEST: Final = re.compile(r'^oldest_code = "(\d+)"', re.MULTILINE)


def findings(source: str) -> Iterator[str]:
    """What a migration takes away, or asks of rows that older code writes."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from (match[0] for match in _SQL.finditer(node.value))
        elif isinstance(node, ast.Call) and name_of(node) in _CONTRACTING:
            yield name_of(node)
        elif isinstance(node, ast.Call) and name_of(node) == "alter_column":
            options = {each.arg: each.value for each in node.keywords}
            yield from sorted({"new_column_name", "type_"} & options.keys())
            yield from ["not nullable"] if is_false(options.get("nullable")) else []
    yield from ("a column without a default" for each in new_columns(tree) if is_required(each))


def new_columns(tree: ast.Module) -> Iterator[ast.Call]:
    """The columns that `upgrade` makes in tables that exist."""
    upgrades = [each for each in tree.body if getattr(each, "name", "") == "upgrade"] or tree.body
    calls = [each for top in upgrades for each in ast.walk(top) if isinstance(each, ast.Call)]
    tables = [each for each in calls if name_of(each) == "create_table"]
    in_new_tables = {id(each) for table in tables for each in ast.walk(table)}
    yield from (
        each for each in calls if name_of(each) == "Column" and id(each) not in in_new_tables
    )


def is_required(column: ast.Call) -> bool:
    """Whether a row of older code, which does not name the column, is refused."""
    options = {each.arg: each.value for each in column.keywords}
    return is_false(options.get("nullable")) and "server_default" not in options


def name_of(call: ast.Call) -> str:
    """The last part of the name of what is called."""
    return call.func.attr if isinstance(call.func, ast.Attribute) else ""


def is_false(node: ast.expr | None) -> bool:
    """Whether an argument is given, and is False."""
    return isinstance(node, ast.Constant) and node.value is False


def place_of(path: Path) -> str:
    """Such as ``skyway_gateway 0017``."""
    return f"{path.parents[2].name} {path.name[:4]}"


@pytest.mark.parametrize("path", MIGRATIONS, ids=place_of)
def test_a_migration_only_adds_or_names_the_oldest_code(path: Path) -> None:
    source = path.read_text()
    if _OLDEST.search(source):
        return

    found = list(findings(source))

    assert not found, f'{found}: add first, take away a release later, with oldest_code = "..."'


@pytest.mark.parametrize("path", MIGRATIONS, ids=place_of)
def test_the_oldest_code_is_a_revision_of_the_service(path: Path) -> None:
    named = _OLDEST.search(path.read_text())
    known = {each.name[:4] for each in path.parent.glob("0*.py")}

    assert named is None or (named[1] in known and named[1] <= path.name[:4])


@pytest.mark.parametrize(
    "statement",
    [
        'op.drop_column("pads", "name")',
        'op.drop_table("pads")',
        'op.rename_table("pads", "docks")',
        'op.drop_constraint("pad_name", "pads")',
        'op.alter_column("pads", "name", new_column_name="title")',
        'op.alter_column("pads", "name", nullable=False)',
        'op.add_column("pads", sa.Column("size", sa.Text(), nullable=False))',
        'op.execute("ALTER TABLE pads DROP COLUMN name")',
        'op.execute("ALTER TABLE pads ADD COLUMN size TEXT NOT NULL")',
    ],
)
def test_what_takes_away_is_found(statement: str) -> None:
    assert len(list(findings(statement))) == 1


@pytest.mark.parametrize(
    "statement",
    [
        'op.add_column("pads", sa.Column("size", sa.Text(), nullable=True))',
        'op.add_column("pads", sa.Column("n", sa.Text(), nullable=False, server_default="0"))',
        'op.create_table("docks", sa.Column("dock", sa.Text(), nullable=False))',
        'op.create_index("pads_by_name", "pads", ["name"])',
        'op.execute("ALTER TABLE pads ADD COLUMN size TEXT NOT NULL DEFAULT 1")',
        'op.execute("ALTER TABLE pads ALTER COLUMN size DROP NOT NULL")',
    ],
)
def test_what_adds_is_allowed(statement: str) -> None:
    assert not list(findings(statement))
