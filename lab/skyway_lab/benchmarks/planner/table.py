"""A table of results: as text for people, as numbers for programs."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass(slots=True)
class Table:
    """A caption, a header and rows of text; `numbers` holds what the rows say, unrounded.

    `name` is where the table stands in the page of the docs. `remarks` are lines below it.
    """

    name: str
    caption: str
    header: tuple[str, ...]
    rows: list[tuple[str, ...]] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    numbers: list[dict[str, Any]] = field(default_factory=list)  # any JSON value

    def as_markdown(self) -> str:
        """The caption, the table with aligned columns, the remarks."""
        widths = [max(map(len, column)) for column in zip(self.header, *self.rows, strict=True)]
        lines = [_line(self.header, widths), _line(["-" * width for width in widths], widths)]
        lines += [_line(row, widths) for row in self.rows]
        remarks = [f"- {remark}" for remark in self.remarks]
        return "\n".join([self.caption, "", *lines, *([""] if remarks else []), *remarks])


def _line(cells: Sequence[str], widths: Sequence[int]) -> str:
    padded = (cell.ljust(width) for cell, width in zip(cells, widths, strict=True))
    return f"| {' | '.join(padded)} |"
