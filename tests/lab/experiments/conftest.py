"""Makers of runs and contests with round numbers."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from skyway_lab.experiments.contest import Run
from skyway_lab.experiments.instances import Setting
from skyway_lab.experiments.laboratory import Laboratory, progress_bars
from skyway_lab.experiments.trials import Contest, Trial

A_RUN = Run(
    contestant="exact",
    status="optimal",
    elapsed_s=1.0,
    is_censored=False,
    labels=10,
    compositions=0,
    delivery_s=100.0,
    lower_bound_s=100.0,
    recharging_s=0.0,
    waiting_s=0.0,
)


@pytest.fixture
def make_run() -> Callable[..., Run]:
    def make(contestant: str = "exact", **fields: Any) -> Run:
        return replace(A_RUN, contestant=contestant, **fields)

    return make


@pytest.fixture
def make_contest() -> Callable[[Sequence[tuple[int, Sequence[Run]]]], Contest]:
    def make(results: Sequence[tuple[int, Sequence[Run]]]) -> Contest:
        trials = [
            Trial(Setting(stations=stations), seed=0, turn=0, contestants=(), limit_s=1.0)
            for stations, _ in results
        ]
        return Contest(trials, [runs for _, runs in results])

    return make


@pytest.fixture
def laboratory(tmp_path: Path) -> Laboratory:
    """A laboratory without worker processes."""
    return Laboratory(seed=1, is_quick=True, folder=tmp_path, progress=progress_bars())
