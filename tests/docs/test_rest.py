"""docs/reference/rest.md names every error type and code, each repeatable call, and the limits."""

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

from skyway.contracts.problem_details import CONFLICT_CODES
from skyway.runtime.http.body_bounds import BODY_LIMIT_BYTES
from skyway.runtime.http.paging import PageQuery
from skyway.runtime.http.problems import status_problem

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/reference/rest.md").read_text()
SOURCES = [
    path
    for folder in ("skyway", "gateway", "services")
    for path in (ROOT / folder).rglob("*.py")
    if "migrations" not in path.parts
]


def conflict_codes() -> Iterator[str]:
    """The codes of all `Conflict("CODE", ...)` in the code."""
    for path in SOURCES:
        if "Conflict(" not in (text := path.read_text()):
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                first = node.args[0] if node.args else None
                if node.func.id == "Conflict" and isinstance(first, ast.Constant):
                    yield str(first.value)


def problem_types() -> set[tuple[str, str]]:
    """Status and name of each type in the table of problems."""
    table = (ROOT / "skyway/runtime/http/problems.py").read_text()
    return set(re.findall(r"\(\s*(\d{3}),\s*\"([a-z-]+)\",\s*\"", table))


def test_the_page_names_every_code_of_a_conflict() -> None:
    codes = set(conflict_codes()) | set(CONFLICT_CODES)
    on_page = set(re.findall(r"\b[A-Z]+(?:_[A-Z]+)*\b", PAGE))

    assert len(codes) > 15
    assert codes <= on_page


def test_the_page_names_every_type_of_problem_with_its_status() -> None:
    types = problem_types()
    on_page = set(re.findall(r"^\| (\d{3}) \| `([a-z-]+)` \|", PAGE, re.MULTILINE))

    assert len(types) > 8
    assert types <= on_page


def test_the_types_of_plain_statuses_are_those_on_the_page() -> None:
    on_page = re.findall(r"^\| (\d{3}) \| `([a-z-]+)` \|", PAGE, re.MULTILINE)

    for status in (400, 405, 415):
        names = {name for number, name in on_page if number == str(status)}
        assert status_problem(status, None).type.removeprefix("urn:skyway:problem:") in names


def test_the_limits_on_the_page_are_those_of_the_code() -> None:
    limits = PageQuery.model_json_schema()["properties"]["limit"]

    assert BODY_LIMIT_BYTES == 256 * 1024
    assert "at least 4 KiB, at most 256 KiB |" in PAGE
    assert f"`limit` is {limits['minimum']} to {limits['maximum']} and {limits['default']}" in PAGE


def test_the_page_names_every_call_that_takes_an_idempotency_key() -> None:
    paths = json.loads((ROOT / "openapi/gateway.json").read_text())["paths"]
    repeatable = {
        path
        for path, operations in paths.items()
        for operation in operations.values()
        for parameter in operation.get("parameters", [])
        if parameter.get("name", "").lower() == "idempotency-key"
    }
    section = PAGE.split("## Idempotency\n")[1].split("## ")[0]

    assert len(repeatable) > 5
    assert not [path for path in repeatable if path not in section]
