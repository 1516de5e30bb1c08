"""Puts tables into a page of the docs, between the marks that name them.

A mark is ``<!-- table: NAME -->``, ended by ``<!-- end -->``; the text between the marks is
replaced. The mark `measured` takes the line with the command, the seed and the machine.
"""

import re
from collections.abc import Mapping
from pathlib import Path

from skyway_lab.benchmarks.planner.table import Table

_MARKED = re.compile(r"(<!-- table: (\S+) -->\n).*?(<!-- end -->)", re.DOTALL)


def write_page(path: Path, heading: str, tables: list[Table]) -> None:
    """Replace the tables of this run; those that it did not measure stay."""
    texts = {table.name: table.as_markdown() for table in tables}
    path.write_text(filled(path.read_text(), {"measured": heading, **texts}))


def filled(page: str, texts: Mapping[str, str]) -> str:
    """The page with these texts at their marks."""

    def replaced(mark: re.Match[str]) -> str:
        opening, name, closing = mark.groups()
        return f"{opening}{texts[name]}\n{closing}" if name in texts else mark.group()

    return _MARKED.sub(replaced, page)
