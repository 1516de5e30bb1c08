"""The paper's future work: the number of destinations."""

from skyway_lab.experiments.contest import EXACT, EXHAUSTIVE, HEURISTIC
from skyway_lab.experiments.figures import Axis, Line, draw_lines
from skyway_lab.experiments.instances import Setting
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

CONTESTANTS = (HEURISTIC, EXHAUSTIVE, EXACT)


def destinations(laboratory: Laboratory) -> Section:
    """1 to 12 destinations on networks of one size."""
    stations = laboratory.size(quick=14, full=35)
    numbers = laboratory.size(quick=(1, 3, 5), full=(1, 2, 3, 4, 5, 6, 8, 10, 12))
    limit_s = laboratory.size(quick=0.15, full=3.0)
    contest = hold(
        laboratory,
        "destinations",
        [
            Trial(
                Setting(stations=stations, packages=packages, recharge_policy="partial"),
                seed=laboratory.seed_for("destinations", packages, number),
                turn=number,
                contestants=CONTESTANTS,
                limit_s=limit_s,
            )
            for packages in numbers
            for number in range(laboratory.size(quick=2, full=10))
        ],
    )
    by_number = contest.by(lambda setting: setting.packages)
    for name, title, unit, scale in (
        ("time", "Execution time against the number of destinations", "s", "log"),
        ("delivery", "Delivery time against the number of destinations", "h", "linear"),
    ):
        draw_lines(
            laboratory.folder / f"destinations-{name}.png",
            title,
            x=Axis("destinations"),
            y=Axis(f"median {title.split()[0].lower()} time, {unit}", scale),
            lines=[
                Line(
                    who,
                    numbers,
                    [
                        (one.times(who) if name == "time" else one.deliveries_h(who)).median()
                        for one in by_number.values()
                    ],
                    [one.has_limited(who) for one in by_number.values()],
                )
                for who in CONTESTANTS
            ],
        )
    return _section(by_number, stations, limit_s, seed=laboratory.seed)


def _section(by_number: dict[int, Contest], stations: int, limit_s: float, *, seed: int) -> Section:
    rows = [
        (
            str(number),
            who,
            percent(contest.times(who).share_finished),
            estimated(contest.times(who).median(seed=seed), duration),
            estimated(contest.labels(who).median(seed=seed), count),
            *(
                estimated(contest.gaps(who).quantile(share, seed=seed), percent)
                for share in (0.5, 0.95, 1.0)
            ),
        )
        for number, contest in by_number.items()
        for who in CONTESTANTS
    ]
    most, contest = max(by_number.items())
    findings = [
        SummaryLine(
            f"exact at {most} on {stations} stations",
            f"median {estimated(contest.times(EXACT).median(seed=seed), duration)}, "
            f"{percent(contest.times(EXACT).share_finished)} proven",
        ),
        SummaryLine(
            f"heuristic's gap at {most}",
            f"p50 {estimated(contest.gaps(HEURISTIC).median(seed=seed), percent)}",
        ),
    ]
    return Section(
        "The number of destinations",
        [
            (
                f"The paper's first future work. {stations} stations as in the first section, "
                f"partial recharging, 1 to {most} destinations, {duration(limit_s)} a run."
            ),
            image("destinations-time.png", "execution time against destinations"),
            image("destinations-delivery.png", "delivery time against destinations"),
            markdown_table(
                (
                    "destinations",
                    "contestant",
                    "finished",
                    "median time",
                    "labels",
                    "gap p50",
                    "gap p95",
                    "gap max",
                ),
                rows,
            ),
        ],
        findings,
    )
