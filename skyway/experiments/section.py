"""What an experiment hands back: a section of the page, and lines for the terminal."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

#: A cell of a CSV file.
Cell = str | int | float | bool | None
Row = Mapping[str, Cell]


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the summary: what was asked, what came out."""

    question: str
    answer: str


@dataclass(frozen=True, slots=True)
class Section:
    """One experiment's part of the page, in Markdown, and its summary."""

    title: str
    paragraphs: Sequence[str]
    findings: Sequence[Finding] = field(default_factory=tuple)


def image(name: str, meaning: str) -> str:
    """A figure of the experiments' folder, as the page shows it."""
    return f"![{meaning}](experiments/{name})"
