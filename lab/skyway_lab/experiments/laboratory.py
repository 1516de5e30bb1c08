"""Where experiments run: worker processes, the seed, the sizes, and the folder for results."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from skyway.workers import open_workers
from skyway_lab.experiments.contest import EXACT, run
from skyway_lab.experiments.instances import Setting, city_problem, seed_of

Trial = TypeVar("Trial")
Result = TypeVar("Result")

#: Processes that run trials at a time: one for each core, each of one thread, at most this many,
#: so that the runs of a contest do not slow each other down.
_MOST_WORKERS = 2


@dataclass(frozen=True, slots=True)
class Laboratory:
    """The environment that every experiment receives.

    Without an executor the trials run in this process, one after the other. A laboratory that
    `redraws` runs nothing: it reads the rows that an earlier run wrote.
    """

    seed: int
    is_quick: bool
    folder: Path
    progress: Progress
    executor: Executor | None = None
    redraws: bool = False

    def size(self, *, quick: Result, full: Result) -> Result:
        """The size for this run: quick or full."""
        return quick if self.is_quick else full

    def seed_for(self, *parts: object) -> int:
        """The seed of one instance of this run."""
        return seed_of(self.seed, *parts)

    def results(
        self, what: str, function: Callable[[Trial], Result], trials: Sequence[Trial]
    ) -> list[Result]:
        """The function's result for every trial, in order; a bar shows the progress."""
        bar = self.progress.add_task(what, total=len(trials))
        if self.executor is None:
            results = []
            for trial in trials:
                results.append(function(trial))
                self.progress.advance(bar)
            return results
        futures = [self.executor.submit(function, trial) for trial in trials]
        try:
            for future in as_completed(futures):
                future.result()
                self.progress.advance(bar)
        finally:
            for future in futures:
                future.cancel()
        return [future.result() for future in futures]


@contextmanager
def open_laboratory(
    *,
    seed: int,
    is_quick: bool,
    folder: Path,
    ray_address: str | None = None,
    redraws: bool = False,
) -> Iterator[Laboratory]:
    """A laboratory with worker processes, here or on a Ray cluster; its bar is on standard error.

    On a cluster each node runs a trial on each processor, so times are those of busy machines.
    """
    folder.mkdir(parents=True, exist_ok=True)
    count = min(_MOST_WORKERS, os.cpu_count() or 1)
    workers = open_workers(count, warm_up=warm_up, ray_address=ray_address)
    with workers as executor, progress_bars() as progress:
        yield Laboratory(seed, is_quick, folder, progress, executor, redraws)


def progress_bars() -> Progress:
    """Bars on standard error, one for each experiment."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
    )


def warm_up() -> None:
    """Load the compiled code, so that no contestant's first run pays for it."""
    run(city_problem(Setting(stations=6), seed=1), EXACT, limit_s=60)
