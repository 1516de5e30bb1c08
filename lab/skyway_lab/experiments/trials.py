"""Contests over many instances: the trials, their runs, and statistics that compare them."""

import csv
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from functools import partial
from pathlib import Path
from typing import Final, TypeVar

from pydantic import TypeAdapter

from skyway.errors import SkywayError
from skyway.planner.problem import Problem
from skyway_lab.experiments.contest import Run, contest
from skyway_lab.experiments.instances import Setting, city_problem
from skyway_lab.experiments.laboratory import Laboratory
from skyway_lab.experiments.report import Row, write_rows
from skyway_lab.experiments.sample import Sample

Key = TypeVar("Key")

_RUN: Final = TypeAdapter(Run)


@dataclass(frozen=True, slots=True)
class Trial:
    """One instance, on which all contestants run; `turn` chooses the one that begins."""

    setting: Setting
    seed: int
    turn: int
    contestants: tuple[str, ...]
    limit_s: float
    make_problem: Callable[..., Problem] = city_problem


def run_trial(trial: Trial) -> list[Run]:
    """The runs of all contestants, in the order in which the trial names them."""
    problem = trial.make_problem(trial.setting, seed=trial.seed)
    return contest(problem, trial.contestants, limit_s=trial.limit_s, turn=trial.turn)


@dataclass(frozen=True, slots=True)
class Contest:
    """Trials with their runs; `select` narrows them down to a cell."""

    trials: Sequence[Trial]
    results: Sequence[Sequence[Run]]

    def select(self, is_selected: Callable[[Setting], bool]) -> "Contest":
        """The trials whose setting is selected."""
        kept = [
            (trial, runs)
            for trial, runs in zip(self.trials, self.results, strict=True)
            if is_selected(trial.setting)
        ]
        return Contest([trial for trial, _ in kept], [runs for _, runs in kept])

    def planned_by(self, contestant: str) -> "Contest":
        """The trials for which this contestant has a plan."""
        kept = [
            (trial, runs)
            for trial, runs, own in zip(
                self.trials, self.results, self.runs(contestant), strict=True
            )
            if own.delivery_s is not None
        ]
        return Contest([trial for trial, _ in kept], [runs for _, runs in kept])

    def by(self, key: Callable[[Setting], Key]) -> "dict[Key, Contest]":
        """The trials grouped by this key of their settings, in the order in which keys appear."""
        keys = dict.fromkeys(key(trial.setting) for trial in self.trials)
        return {one: self.select(partial(_has, key, one)) for one in keys}

    def runs(self, contestant: str) -> list[Run]:
        """The contestant's runs, one for each trial."""
        return [run for runs in self.results for run in runs if run.contestant == contestant]

    def times(self, contestant: str) -> Sample:
        """The contestant's execution times, seconds."""
        return Sample.of_times(self.runs(contestant))

    def deliveries_h(self, contestant: str) -> Sample:
        """The contestant's delivery times, hours; infinite where it has no plan."""
        return Sample.of(
            [
                math.inf if run.delivery_s is None else run.delivery_s / 3600
                for run in self.runs(contestant)
            ]
        )

    def gaps(self, contestant: str) -> Sample:
        """How much later it delivers than the best contestant of each trial, as a share of that."""
        return Sample.of(
            [
                gap(run, best_s(runs))
                for runs in self.results
                for run in runs
                if run.contestant == contestant
            ]
        )

    def gaps_to(self, baseline: str, contestant: str) -> Sample:
        """How much later it delivers than the baseline, where the baseline finished with a plan."""
        pairs = zip(self.runs(baseline), self.runs(contestant), strict=True)
        return Sample.of(
            [
                gap(run, base.delivery_s)
                for base, run in pairs
                if base.delivery_s is not None and not base.is_censored
            ]
        )

    def has_limited(self, contestant: str) -> bool:
        """Whether the limit ended some of its runs."""
        return any(run.is_censored for run in self.runs(contestant))

    def labels(self, contestant: str) -> Sample:
        """The states that it looked at; censored where its limit ended the run."""
        runs = self.runs(contestant)
        return Sample(
            tuple(float(run.labels) for run in runs), tuple(run.is_censored for run in runs)
        )

    def compositions(self, contestant: str) -> Sample:
        """The whole routes that it simulated; censored where its limit ended the run."""
        runs = self.runs(contestant)
        return Sample(
            tuple(float(run.compositions) for run in runs), tuple(run.is_censored for run in runs)
        )


def _has(key: Callable[[Setting], Key], value: Key, setting: Setting) -> bool:
    return key(setting) == value


def hold(
    laboratory: Laboratory,
    name: str,
    trials: Sequence[Trial],
    run: Callable[[Trial], list[Run]] = run_trial,
) -> Contest:
    """Run all trials, and write a row for every run to ``name.csv``.

    A laboratory that redraws reads these rows instead.

    Raises
    ------
    RowsOfOtherTrials
        The rows are of other instances.
    """
    path = laboratory.folder / f"{name}.csv"
    if laboratory.redraws:
        return Contest(trials, _read_results(path, trials))
    results = laboratory.results(name, run, trials)
    rows = [_row(trial, run) for trial, runs in zip(trials, results, strict=True) for run in runs]
    write_rows(path, rows)
    return Contest(trials, results)


class RowsOfOtherTrials(SkywayError):
    """A file of rows holds runs of other instances than the part has now."""

    def __init__(self, path: Path) -> None:
        super().__init__(f"{path} holds runs of other instances: run the part again")


def _read_results(path: Path, trials: Sequence[Trial]) -> list[list[Run]]:
    """The runs of each trial, as `hold` wrote them."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    each = len(rows) // len(trials)
    names = [field.name for field in fields(Run)]
    results = []
    for number, trial in enumerate(trials):
        own = rows[number * each : (number + 1) * each]
        if not own or any(row["seed"] != str(trial.seed) for row in own):
            raise RowsOfOtherTrials(path)
        results.append(
            [_RUN.validate_python({name: row[name] or None for name in names}) for row in own]
        )
    return results


def best_s(runs: Sequence[Run]) -> float | None:
    """The earliest delivery time of these runs, None if none has a plan."""
    return min((run.delivery_s for run in runs if run.delivery_s is not None), default=None)


def gap(run: Run, best_delivery_s: float | None) -> float:
    """How much later than the best this run's plan delivers, as a share; infinite without a plan.

    The gap is 0 where no contestant has a plan.
    """
    if best_delivery_s is None:
        return 0.0
    if run.delivery_s is None:
        return math.inf
    return run.delivery_s / best_delivery_s - 1 if best_delivery_s > 0 else 0.0


def _row(trial: Trial, run: Run) -> Row:
    setting = trial.setting
    own = {
        "stations": setting.stations,
        "degree": setting.degree,
        "spacing_m": setting.spacing_m,
        "packages": setting.packages,
        "pads": setting.pads,
        "taken": setting.taken,
        "model": setting.model.model_id,
        "recharge_policy": setting.recharge_policy,
        "seed": trial.seed,
    }
    return {**own, **asdict(run)}
