"""A text Gantt: rows of bars on one axis of fleet time, in plain characters."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

#: Distances between two marks of the axis, the shortest first.
_MARKS: Final = tuple(
    timedelta(minutes=minutes) for minutes in (1, 5, 15, 30, 60, 120, 180, 360, 720, 1440, 2880)
)

#: Characters between two marks, at least: a mark's text is 11 characters long.
_MARK_CHARACTERS: Final = 13


@dataclass(frozen=True, slots=True)
class Bar:
    """A span of a row, drawn with one character; later bars cover earlier ones."""

    start_at: datetime
    end_at: datetime
    character: str


@dataclass(frozen=True, slots=True)
class Row:
    """A line of the Gantt: its label, its bars, and a note behind them."""

    label: str
    bars: tuple[Bar, ...]
    note: str = ""


def gantt_lines(
    rows: Sequence[Row], *, start_at: datetime, end_at: datetime, columns: int
) -> list[str]:
    """The axis and one line for each row; bars are at most `columns` characters wide.

    A bar has at least one character. Bars outside the axis are left out.
    """
    span = max(end_at - start_at, timedelta(minutes=1))
    axis = _Axis(start_at, span, columns)
    width = max((len(row.label) for row in rows), default=0)
    return [
        f"{'':{width}} {axis.marks()}".rstrip(),
        *(f"{row.label:{width}} {axis.drawn(row.bars)} {row.note}".rstrip() for row in rows),
    ]


@dataclass(frozen=True, slots=True)
class _Axis:
    """Columns of equal duration from `start_at` on."""

    start_at: datetime
    span: timedelta
    columns: int

    def _column(self, moment: datetime) -> int:
        return int((moment - self.start_at) / self.span * self.columns)

    def drawn(self, bars: Iterable[Bar]) -> str:
        """The bars as one text."""
        cells = [" "] * self.columns
        for bar in bars:
            if bar.end_at < self.start_at or bar.start_at > self.start_at + self.span:
                continue
            first = min(max(0, self._column(bar.start_at)), self.columns - 1)
            last = min(max(first + 1, self._column(bar.end_at)), self.columns)
            cells[first:last] = bar.character * (last - first)
        return "".join(cells)

    def marks(self) -> str:
        """Moments above their columns, as "03-01 12:30"."""
        least = self.span * _MARK_CHARACTERS / self.columns
        apart = next((each for each in _MARKS if each >= least), _MARKS[-1])
        midnight = self.start_at.replace(hour=0, minute=0, second=0, microsecond=0)
        mark_at = midnight + apart * -((midnight - self.start_at) // apart)
        text = ""
        while (column := self._column(mark_at)) < self.columns:
            if not text or column >= len(text) + 2:
                text = f"{text:{column}}{mark_at:%m-%d %H:%M}"
            mark_at += apart
        return text
