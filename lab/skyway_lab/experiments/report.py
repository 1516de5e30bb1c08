"""What an experiment reports: a section of the page, lines for the terminal, and rows of CSV.

The functions below write numbers and tables as the page and the terminal show them.
"""

import csv
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from skyway_lab.experiments.sample import Estimate

#: A cell of a CSV file.
Cell = str | int | float | bool | None
Row = Mapping[str, Cell]


@dataclass(frozen=True, slots=True)
class SummaryLine:
    """One line of the summary: a question and its answer."""

    question: str
    answer: str


@dataclass(frozen=True, slots=True)
class Section:
    """One experiment's part of the page, in Markdown, and its summary."""

    title: str
    paragraphs: Sequence[str]
    findings: Sequence[SummaryLine] = field(default_factory=tuple)


def image(name: str, meaning: str) -> str:
    """A figure, as a page beside it shows it."""
    return f"![{meaning}]({name})"


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """Write the rows; all have the columns of the first."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


_MINUTE_S = 60.0
_HOUR_S = 3600.0

#: A share smaller than this is a rounding error and counts as 0.
_NOTHING = 1e-9


def duration(value_s: float) -> str:
    """A duration in the unit that reads best."""
    if not math.isfinite(value_s):
        return "never"
    if value_s < 1e-3:
        return f"{value_s * 1e6:.0f} µs"
    if value_s < 1.0:
        return f"{value_s * 1e3:.3g} ms"
    if value_s < 3 * _MINUTE_S:
        return f"{value_s:.3g} s"
    if value_s < _HOUR_S:
        return f"{value_s / _MINUTE_S:.3g} min"
    return f"{value_s / _HOUR_S:.2f} h"


def hours(value_h: float) -> str:
    """A time in hours."""
    return f"{value_h:.2f} h" if math.isfinite(value_h) else "never"


def percent(share: float) -> str:
    """A share of one as a percentage."""
    if not math.isfinite(share):
        return "∞"
    return f"{0 if abs(share) < _NOTHING else share * 100:.3g} %"


def count(number: float) -> str:
    """A whole number, with commas."""
    return "∞" if not math.isfinite(number) else f"{number:,.0f}"


def estimated(estimate: Estimate, form: Callable[[float], str]) -> str:
    """A value, "≥" where it is censored, without its interval."""
    is_at_least = estimate.is_at_least and math.isfinite(estimate.value)
    return f"{'≥ ' if is_at_least else ''}{form(estimate.value)}"


def with_interval(estimate: Estimate, form: Callable[[float], str]) -> str:
    """A value with its 95 % interval."""
    return f"{estimated(estimate, form)} ({form(estimate.low)} to {form(estimate.high)})"


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown; all columns but the first are numbers, set right."""
    rule = ["---", *("---:" for _ in header[1:])]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (header, rule, *rows))
