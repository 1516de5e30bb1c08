"""The worth of each part of `exact`: bound, dominance and lazy charging switched off."""

from collections.abc import Mapping
from types import MappingProxyType

from skyway.planner.exact import exact_with
from skyway.planner.exact_task import Method
from skyway_lab.experiments.contest import Run, run_strategy
from skyway_lab.experiments.figures import Axis, Stack, draw_stacks
from skyway_lab.experiments.instances import SHORT_RANGE, Setting, city_problem
from skyway_lab.experiments.laboratory import Laboratory
from skyway_lab.experiments.report import (
    Section,
    SummaryLine,
    count,
    duration,
    estimated,
    image,
    markdown_table,
    percent,
)
from skyway_lab.experiments.trials import Contest, Trial, hold

METHODS: Mapping[str, Method] = MappingProxyType(
    {
        "whole": Method(),
        "bound: flight only": Method(bound="flight"),
        "no bound": Method(bound="none"),
        "no dominance": Method(dominance="none"),
        "5 levels": Method(charging=5),
        "20 levels": Method(charging=20),
    }
)


def run_trial(trial: Trial) -> list[Run]:
    """Every method on one instance."""
    problem = city_problem(trial.setting, seed=trial.seed)
    return [
        run_strategy(problem, name, exact_with(method), limit_s=trial.limit_s)
        for name, method in METHODS.items()
    ]


def ablations(laboratory: Laboratory) -> Section:
    """Labels and time of the search while one part at a time is switched off."""
    stations = laboratory.size(quick=20, full=200)
    limit_s = laboratory.size(quick=0.3, full=5.0)
    trials = [
        Trial(
            Setting(
                stations=stations,
                degree=6.0,
                spacing_m=6_000.0,
                packages=packages,
                taken=0.7,
                model=SHORT_RANGE,
                recharge_policy="partial",
            ),
            seed=laboratory.seed_for("ablations", packages, number),
            turn=number,
            contestants=tuple(METHODS),
            limit_s=limit_s,
        )
        for packages in laboratory.size(quick=(2,), full=(4, 8))
        for number in range(laboratory.size(quick=2, full=12))
    ]
    by_packages = hold(laboratory, "ablations", trials, run_trial).by(lambda s: s.packages)
    draw_stacks(
        laboratory.folder / "ablations.png",
        f"Median labels, {stations} stations (cut at {duration(limit_s)})",
        x=Axis("method"),
        y=Axis("labels", "log"),
        bars=list(METHODS),
        stacks=[
            Stack(f"{packages} packages", [contest.labels(name).median().value for name in METHODS])
            for packages, contest in list(by_packages.items())[-1:]
        ],
    )
    return _section(by_packages, stations, limit_s, seed=laboratory.seed)


def _section(
    by_packages: Mapping[int, Contest], stations: int, limit_s: float, *, seed: int
) -> Section:
    rows = [
        (
            str(packages),
            name,
            percent(contest.times(name).share_finished),
            estimated(contest.times(name).median(seed=seed), duration),
            estimated(contest.labels(name).median(seed=seed), count),
            *(estimated(contest.gaps(name).quantile(at, seed=seed), percent) for at in (0.5, 1.0)),
        )
        for packages, contest in by_packages.items()
        for name in METHODS
    ]
    packages, contest = max(by_packages.items())
    whole = contest.times("whole").median().value
    findings = [
        SummaryLine(
            f"{name}, {packages} packages",
            f"{'≥ ' if times.is_at_least else ''}{times.value / whole:.3g} times the time, "
            f"{percent(contest.times(name).share_finished)} finished",
        )
        for name in METHODS
        if name != "whole"
        for times in (contest.times(name).median(),)
    ]
    intro = (
        f"{stations} stations 6 km apart, 70 % of the pads' time taken, partial recharging, "
        f"{duration(limit_s)} a run. **Bound**: the bound counts flying and charging, flying "
        "alone, or nothing. **Dominance**: labels that another label beats are dropped, or all "
        "are kept. **Levels**: the search tries so many levels of charge on each pad, instead of "
        "deciding lazily how much to charge. Its plans are then only as good as the levels (gap)."
    )
    header = ("packages", "method", "finished", "median time", "labels", "gap p50", "gap max")
    return Section(
        "What each part of the search is worth",
        [
            intro,
            image("ablations.png", "labels by method"),
            markdown_table(header, rows),
        ],
        findings,
    )
