"""Keeps the figures of all runs in a file, and writes the tables of the reference from them."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Self

from skyway_lab.benchmarks.chaos.fault_kinds import KINDS
from skyway_lab.benchmarks.chaos.outcome import Outcome, recovery_table
from skyway_lab.benchmarks.chaos.recovery import Recovery
from skyway_lab.benchmarks.load.burst import Storage
from skyway_lab.benchmarks.planner.page import filled
from skyway_lab.benchmarks.planner.table import Table

_REFERENCE: Final = Path(__file__).parents[4] / "docs/reference"
PAGE: Final = _REFERENCE / "reliability.md"
RUNS: Final = _REFERENCE / "reliability.jsonl"


@dataclass(frozen=True, slots=True)
class FinishedRun:
    """A run as a line of the file: what it was, on which machine, and what it found."""

    storage: Storage
    seed: int
    minutes: float
    clock_rate: float
    machine: str
    requests: int
    faults: int
    flaws: int
    recoveries: tuple[Recovery, ...]

    @classmethod
    def of(cls, outcome: Outcome, *, machine: str) -> Self:
        """The line for this outcome."""
        trial = outcome.trial
        return cls(
            storage=trial.storage,
            seed=trial.seed,
            minutes=trial.minutes,
            clock_rate=trial.clock_rate,
            machine=machine,
            requests=len(outcome.evidence.accepted),
            faults=len(outcome.recoveries),
            flaws=len(outcome.flaws),
            recoveries=outcome.recoveries,
        )

    @classmethod
    def read(cls, line: str) -> Self:
        """The run of a line."""
        document: dict[str, Any] = json.loads(line)  # the JSON of `as_line`
        recoveries = tuple(Recovery(**each) for each in document.pop("recoveries"))
        return cls(**document, recoveries=recoveries)

    def as_line(self) -> str:
        """The run as JSON, seconds rounded to a tenth."""
        document = asdict(self)
        document["recoveries"] = [
            {name: round(value, 1) if isinstance(value, float) else value for name, value in each}
            for each in (recovery.items() for recovery in document["recoveries"])
        ]
        return json.dumps(document)


def write(run: FinishedRun) -> None:
    """Add a run to the file, in place of an earlier one of its pair and seed, and fill the page."""
    runs = [each for each in read_runs() if (each.storage, each.seed) != (run.storage, run.seed)]
    runs = sorted([*runs, run], key=lambda each: (each.storage, each.seed))
    RUNS.write_text("".join(f"{each.as_line()}\n" for each in runs))
    PAGE.write_text(page_with(PAGE.read_text(), runs))


def read_runs() -> list[FinishedRun]:
    """All runs of the file."""
    lines = RUNS.read_text().splitlines() if RUNS.exists() else []
    return [FinishedRun.read(line) for line in lines]


def page_with(page: str, runs: Sequence[FinishedRun]) -> str:
    """The page with the tables of these runs, and with the table of faults."""
    tables = [_faults(), _runs(runs)]
    for storage in ("embedded", "production"):
        of_pair = (run for run in runs if run.storage == storage)
        tables.append(recovery_table(storage, [each for run in of_pair for each in run.recoveries]))
    return filled(page, {table.name: table.as_markdown() for table in tables})


def _faults() -> Table:
    return Table(
        "faults",
        "Seconds of wall time; `embedded` is SQLite with the embedded broker.",
        ("fault", "what happens", "seconds", "on", "what to expect"),
        [
            (
                kind.name,
                kind.what,
                f"{kind.lasts_s[0]:g} to {kind.lasts_s[1]:g}",
                "both" if kind.embedded and kind.production else _only_pair(bool(kind.embedded)),
                kind.expect,
            )
            for kind in KINDS
        ],
    )


def _only_pair(is_embedded: bool) -> str:
    return "embedded" if is_embedded else "production"


def _runs(runs: Iterable[FinishedRun]) -> Table:
    return Table(
        "runs",
        "All runs, each with `python -m skyway_lab chaos --write` and its storage, seed, minutes.",
        ("storage", "seed", "minutes", "clock rate", "requests", "faults", "flaws", "machine"),
        [
            (
                run.storage,
                str(run.seed),
                f"{run.minutes:g}",
                f"{run.clock_rate:g}",
                str(run.requests),
                str(run.faults),
                str(run.flaws),
                run.machine,
            )
            for run in runs
        ],
    )
