"""Print the published figures that are older than the code that they measure.

python tools/old_figures.py

A page names the commit at which a figure was measured, and the command that measured it, in one
section. The code that a command measures is below. 1 when a figure is older, or names no commit.
"""

import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parent.parent

_SERVICES: Final = (
    "gateway",
    "services",
    "skyway/runtime",
    "skyway/contracts",
    "skyway/scheduling",
)
_PLANNER: Final = ("skyway/planner", "skyway/network", "skyway/drone")
_DISPATCH: Final = ("skyway/dispatch", "skyway/scheduling", *_PLANNER)

#: The code that each benchmark measures; any other one measures the services.
_MEASURES: Final = {
    "planner": _PLANNER,
    "forecast_plans": _PLANNER,
    "dispatch": _DISPATCH,
    "live_hour": (*_DISPATCH, "services/skyway_composition/missions/queue"),
}

_COMMAND: Final = re.compile(r"python -m skyway_lab (\w+)")
_COMMIT: Final = re.compile(r"\bcommit\s([0-9a-f]{7,40})\b")


@dataclass(frozen=True, slots=True)
class Figure:
    """Figures of one section: its page and heading, their benchmark, and the commits it names."""

    page: str
    heading: str
    benchmark: str
    commits: tuple[str, ...]


def figures() -> Iterator[Figure]:
    """The figures of all pages: each section that names a command and has a table.

    Decision pages say what was true when the decision was made.
    """
    pages = (each for each in (ROOT / "docs").rglob("*.md") if each.parent.name != "decisions")
    for path in (ROOT / "README.md", *sorted(pages)):
        text = path.read_text(encoding="utf-8")
        for section in re.split(r"^(?=#+ )", text, flags=re.MULTILINE):
            commands, is_table = dict.fromkeys(_COMMAND.findall(section)), "\n|" in section
            for command in commands if is_table else ():
                heading = section.partition("\n")[0].lstrip("# ")
                commits = tuple(dict.fromkeys(_COMMIT.findall(section)))
                yield Figure(str(path.relative_to(ROOT)), heading, command, commits)


def newer_commits(figure: Figure) -> int | None:
    """How many commits changed the measured code since the newest commit named; None if none is."""
    paths = _MEASURES.get(figure.benchmark, _SERVICES)
    counts = [
        int(_git("rev-list", "--count", f"{commit}..HEAD", "--", *paths))
        for commit in figure.commits
    ]
    return min(counts, default=None)


def _git(*arguments: str) -> str:
    return subprocess.run(
        ["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout


def main() -> int:
    """Print one line for each old figure."""
    is_old = False
    for figure in figures():
        newer = newer_commits(figure)
        if newer == 0:
            continue
        is_old = True
        why = "names no commit" if newer is None else f"{newer} commits have changed the code since"
        print(f"{figure.page}, {figure.heading} ({figure.benchmark}): {why}")
    return int(is_old)


if __name__ == "__main__":
    sys.exit(main())
