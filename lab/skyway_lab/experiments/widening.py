"""The paper's future work: a wider subgraph, what it costs and what it brings."""

from skyway.planner.heuristic import heuristic_from
from skyway.planner.subnetwork import WIDENINGS
from skyway_lab.experiments.contest import EXACT, Run, run, run_strategy
from skyway_lab.experiments.figures import Axis, Line, draw_lines
from skyway_lab.experiments.instances import SHORT_RANGE, Setting, city_problem
from skyway_lab.experiments.laboratory import Laboratory
from skyway_lab.experiments.report import (
    Section,
    SummaryLine,
    duration,
    estimated,
    image,
    markdown_table,
    percent,
    with_interval,
)
from skyway_lab.experiments.sample import Sample
from skyway_lab.experiments.trials import Contest, Trial, hold

#: From the paper's own sector to the whole network.
LEVELS = tuple(range(WIDENINGS + 1))
_NAMES = ("the paper's sector", "+15°, × 1.1", "+30°, × 1.25", "+60°, × 1.5", "whole network")


def run_trial(trial: Trial) -> list[Run]:
    """The heuristic from every width of its sector, and `exact`."""
    problem = city_problem(trial.setting, seed=trial.seed)
    return [
        run(problem, EXACT, limit_s=trial.limit_s),
        *(
            run_strategy(problem, str(level), heuristic_from(level), limit_s=trial.limit_s)
            for level in LEVELS
        ),
    ]


def widening(laboratory: Laboratory) -> Section:
    """The heuristic's time and gap by the width of the sector that it begins with."""
    sizes = laboratory.size(quick=(12,), full=(35, 100))
    trials = [
        Trial(
            Setting(
                stations=stations,
                degree=4.0,
                packages=3,
                taken=0.5,
                model=SHORT_RANGE,
                recharge_policy="partial",
            ),
            seed=laboratory.seed_for("widening", stations, number),
            turn=number,
            contestants=(EXACT, *map(str, LEVELS)),
            limit_s=laboratory.size(quick=0.5, full=3.0),
        )
        for stations in sizes
        for number in range(laboratory.size(quick=2, full=25))
    ]
    by_size = hold(laboratory, "widening", trials, run_trial).by(lambda s: s.stations)
    for name, label, scale in (("time", "median time, s", "log"), ("gap", "mean gap, %", "linear")):
        draw_lines(
            laboratory.folder / f"widening-{name}.png",
            f"The heuristic by the width of its sector: {label.split(',')[0]}",
            x=Axis("width: 0 the paper's sector, 4 the whole network"),
            y=Axis(label, scale),
            lines=[
                Line(
                    f"{size} stations",
                    LEVELS,
                    [
                        contest.times(str(level)).median()
                        if name == "time"
                        else _in_percent(contest.gaps(str(level))).mean()
                        for level in LEVELS
                    ],
                )
                for size, contest in by_size.items()
            ],
        )
    return _section(by_size, seed=laboratory.seed)


def _in_percent(sample: Sample) -> Sample:
    return Sample.of([100 * value for value in sample.values])


def _section(by_size: dict[int, Contest], *, seed: int) -> Section:
    rows = [
        (
            str(size),
            _NAMES[level],
            estimated(contest.times(str(level)).median(seed=seed), duration),
            *(
                with_interval(contest.gaps(str(level)).quantile(share, seed=seed), percent)
                for share in (0.5, 0.95, 1.0)
            ),
            estimated(contest.gaps(str(level)).mean(seed=seed), percent),
        )
        for size, contest in by_size.items()
        for level in LEVELS
    ]
    size, contest = max(by_size.items())
    narrow, wide = str(LEVELS[0]), str(LEVELS[-1])
    findings = [
        SummaryLine(
            f"the whole network instead of the sector, {size} stations",
            f"mean gap {estimated(contest.gaps(narrow).mean(), percent)} to "
            f"{estimated(contest.gaps(wide).mean(), percent)}, median time "
            f"{estimated(contest.times(narrow).median(), duration)} to "
            f"{estimated(contest.times(wide).median(), duration)}",
        )
    ]
    header = ("stations", "begins with", "median time", "gap p50", "gap p95", "gap max", "mean gap")
    intro = (
        "The paper's second future work. The heuristic begins with its sector or with a wider one "
        "(degrees added on both sides, and a factor for the radius). It widens the sector until "
        "it finds a plan. If its plan has to wait, it also searches the whole network. 3 "
        f"packages, half of the pads' time taken, `{SHORT_RANGE.model_id}`, partial recharging; "
        "gaps are measured against the best plan found, which `exact` proves best."
    )
    return Section(
        "A wider subgraph",
        [
            intro,
            image("widening-time.png", "time by width"),
            image("widening-gap.png", "gap by width"),
            markdown_table(header, rows),
        ],
        findings,
    )
