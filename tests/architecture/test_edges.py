"""SQL and HTTP stay in the files that are named for them."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = (
    "skyway",
    "gateway/skyway_gateway",
    "services/skyway_provider_registry",
    "services/skyway_composition",
    "services/skyway_drone_agent",
    "services/skyway_broker",
)
#: Which files may import a library, as a pattern of their path below the package's folder.
ALLOWED = {
    "sqlalchemy": re.compile(
        r"(.*/)?(\w+_)?store\.py|migrations/.*|(.*/)?(\w+_)?tables(\.py|/.*)"
        r"|runtime/(sql|outbox)/.*|runtime/archive\.py"
    ),
    "fastapi": re.compile(r"(.*/)?(\w+_)?routes\.py|app\.py|runtime/http/.*"),
    "starlette": re.compile(r"(.*/)?(\w+_)?routes\.py|app\.py|runtime/http/.*"),
}


def imported_packages(source: str) -> Iterator[str]:
    """The top-level packages that a file imports."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module.partition(".")[0]


def misplaced_imports(library: str) -> list[str]:
    """The files that import a library although their names do not allow it."""
    return [
        str(path.relative_to(ROOT))
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*.py"))
        if not ALLOWED[library].fullmatch(str(path.relative_to(ROOT / package)))
        # Parsing takes long, and a file that imports the library holds its name.
        and library in (source := path.read_text())
        and library in imported_packages(source)
    ]


@pytest.mark.parametrize("library", list(ALLOWED))
def test_only_files_named_for_a_library_import_it(library: str) -> None:
    assert misplaced_imports(library) == []


def test_an_import_of_sqlalchemy_is_recognised_in_every_form() -> None:
    for source in ("import sqlalchemy.orm", "from sqlalchemy import select"):
        assert list(imported_packages(source)) == ["sqlalchemy"]
