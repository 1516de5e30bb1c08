"""The paper's evaluation on instances in which most drones have to recharge, and some to wait."""

from skyway.drone.models import PAPER_SCENARIO
from skyway_lab.experiments.contest import EXACT, EXHAUSTIVE, HEURISTIC
from skyway_lab.experiments.figures import Axis, Line, Stack, draw_lines, draw_stacks
from skyway_lab.experiments.instances import Setting
from skyway_lab.experiments.laboratory import Laboratory
from skyway_lab.experiments.paper import claims, table_of_gaps, table_of_times
from skyway_lab.experiments.report import Section, SummaryLine, duration, image, percent
from skyway_lab.experiments.trials import Contest, Trial, hold

CONTESTANTS = (HEURISTIC, EXHAUSTIVE, EXACT)

_SPACING_M = 10_000.0
_TAKEN = 0.4

#: A wait is longer than this, seconds: charging ends at moments that are rounded.
_WAIT_S = 1.0

_FIGURES = {
    "time": "execution time against the number of stations",
    "labels": "states looked at against the number of stations",
    "delivery": "delivery time against the number of stations",
    "use": "what the delivery time is spent on",
}


def paper_recharging(laboratory: Laboratory) -> Section:
    """10 to 35 stations, the drone of the paper's scenario, 40 % of the pads' time taken."""
    sizes = laboratory.size(quick=(10, 14), full=(10, 15, 20, 25, 30, 35))
    limit_s = laboratory.size(quick=0.2, full=5.0)
    runs = laboratory.size(quick=3, full=40)
    trials = [
        Trial(
            Setting(stations=stations, spacing_m=_SPACING_M, taken=_TAKEN, model=PAPER_SCENARIO),
            seed=laboratory.seed_for("paper recharging", stations, number),
            turn=number,
            contestants=CONTESTANTS,
            limit_s=limit_s,
        )
        for stations in sizes
        for number in range(runs)
    ]
    # No plan exists where a segment is too long for the loaded drone.
    contest = hold(laboratory, "paper-recharging", trials).planned_by(EXACT)
    by_size = contest.by(lambda setting: setting.stations)
    _draw(laboratory, by_size)
    return _section(laboratory, contest, runs=runs, limit_s=limit_s)


def _draw(laboratory: Laboratory, by_size: dict[int, Contest]) -> None:
    sizes = list(by_size)
    for name, y in (
        ("time", Axis("mean execution time, s", "log")),
        ("labels", Axis("mean number of states", "log")),
        ("delivery", Axis("median delivery time, h")),
    ):
        draw_lines(
            laboratory.folder / f"paper-recharging-{name}.png",
            _FIGURES[name].capitalize(),
            x=Axis("stations"),
            y=y,
            lines=[
                Line(
                    who,
                    sizes,
                    [
                        one.times(who).mean()
                        if name == "time"
                        else one.labels(who).mean()
                        if name == "labels"
                        else one.deliveries_h(who).median()
                        for one in by_size.values()
                    ],
                    [one.has_limited(who) for one in by_size.values()],
                )
                for who in CONTESTANTS
            ],
        )
    pairs = [(size, who) for size in sizes for who in (HEURISTIC, EXACT)]
    uses_h = [_mean_uses_h(by_size[size], who) for size, who in pairs]
    draw_stacks(
        laboratory.folder / "paper-recharging-use.png",
        "What the delivery time is spent on: heuristic (h) and exact (e)",
        x=Axis("stations, planner"),
        y=Axis("mean time, h"),
        bars=[f"{size} {who[0]}" for size, who in pairs],
        stacks=[
            Stack(use, [each[number] for each in uses_h])
            for number, use in enumerate(("flying", "recharging", "waiting"))
        ],
    )


def _mean_uses_h(contest: Contest, who: str) -> tuple[float, float, float]:
    """The mean hours of flying, recharging and waiting of the plans; 0 without plans."""
    plans = [
        (run.delivery_s, run.recharging_s or 0.0, run.waiting_s or 0.0)
        for run in contest.runs(who)
        if run.delivery_s is not None
    ]
    hours = 3_600.0 * max(1, len(plans))
    recharging_h = sum(recharging_s for _, recharging_s, _ in plans) / hours
    waiting_h = sum(waiting_s for _, _, waiting_s in plans) / hours
    return (
        sum(each[0] for each in plans) / hours - recharging_h - waiting_h,
        recharging_h,
        waiting_h,
    )


def _section(laboratory: Laboratory, contest: Contest, *, runs: int, limit_s: float) -> Section:
    by_size = contest.by(lambda setting: setting.stations)
    seed = laboratory.seed
    intro = (
        f"The paper's evaluation again, with instances in which charging matters: {min(by_size)} "
        f"to {max(by_size)} stations {_SPACING_M / 1000:g} km apart, the drone of the paper's "
        f"scenario (`{PAPER_SCENARIO.model_id}`, which flies 33 km), and others hold each pad for "
        f"{_TAKEN:.0%} of its time. 2 packages, mean degree 2.5, 4 pads, full recharging. Of "
        f"{runs} instances a size those are left out that are out of range; "
        f"{len(contest.trials)} remain. "
        f"A run has at most {duration(limit_s)}. In the figures a marker is open where the limit "
        "ended some runs: exhaustive then counts with its limit in the mean time, and with its "
        "best plan so far in the delivery time. Where the true mean is at least as high, the "
        "marker has an arrow."
    )
    return Section(
        "The paper's evaluation, with recharging and waiting",
        [
            intro,
            *(image(f"paper-recharging-{name}.png", what) for name, what in _FIGURES.items()),
            table_of_times(by_size, CONTESTANTS, seed=seed),
            table_of_gaps(by_size, seed=seed),
        ],
        [*_uses(contest), *claims(contest, by_size, seed=seed)],
    )


def _uses(contest: Contest) -> list[SummaryLine]:
    """How many plans recharge, and how many wait."""
    lines = []
    for who in (EXACT, HEURISTIC):
        plans = [run for run in contest.runs(who) if run.delivery_s is not None]
        recharging = sum((run.recharging_s or 0.0) > 0 for run in plans) / max(1, len(plans))
        waiting = sum((run.waiting_s or 0.0) > _WAIT_S for run in plans) / max(1, len(plans))
        lines.append(
            SummaryLine(
                f"plans of {who} that recharge, and that wait",
                f"{percent(recharging)}, and {percent(waiting)}",
            )
        )
    return lines
