"""Each column of each table has a line: by what a false value is seen, or why it is not."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest
from skyway_composition.tables import metadata as composition
from skyway_gateway.tables import metadata as gateway
from skyway_provider_registry.tables import metadata as registry
from skyway_verifier.across.rules import ACROSS
from skyway_verifier.check import RULES

PAGE: Final = Path(__file__).parents[2] / "docs/reference/invariants.md"
TABLES: Final = {"gateway": gateway, "composition": composition, "registry": registry}
_ROW: Final = re.compile(r"^\| (?!table )(\w+) \| ([\w, `]+) \| (.+) \|$", re.MULTILINE)


def lines(service: str) -> Iterator[tuple[str, str, str]]:
    """Each table of the service in the page, with one of its columns and what the line says."""
    [_, *sections] = re.split(r"^### Columns of (.+)$", PAGE.read_text(), flags=re.MULTILINE)
    for title, section in zip(sections[::2], sections[1::2], strict=True):
        is_own = title.removeprefix("the ") == service
        for table, columns, seen_by in _ROW.findall(section):
            if is_own or (title == "every service" and table in TABLES[service].tables):
                yield from ((table, each.strip(" `"), seen_by) for each in columns.split(","))


@pytest.mark.parametrize("service", TABLES)
def test_each_column_has_one_line_and_each_line_its_column(service: str) -> None:
    written = [(table, column) for table, column, _ in lines(service)]
    stored = [
        (table.name, each.name) for table in TABLES[service].sorted_tables for each in table.c
    ]

    assert sorted(written) == sorted(stored)


@pytest.mark.parametrize("service", TABLES)
def test_each_line_names_rules_that_exist_or_says_why_nothing_is_seen(service: str) -> None:
    every = {rule.name for rules in RULES.values() for rule in rules}
    every |= {rule.name for rule in ACROSS}
    names = {re.sub(r"^I\d+ ", "", name) for name in every}

    for table, column, seen_by in lines(service):
        quoted = re.findall('"([^"]+)"', seen_by)
        assert quoted or "not seen:" in seen_by, f"{table}.{column}"
        for begin in quoted:
            assert any(name.startswith(begin) for name in names), begin
