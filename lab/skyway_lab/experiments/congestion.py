"""Congestion by chance: a share of every pad's time is taken by others, from 0 to 95 %."""

from collections.abc import Mapping

from skyway_lab.experiments.contest import EXACT, HEURISTIC
from skyway_lab.experiments.figures import Axis, Line, draw_lines
from skyway_lab.experiments.instances import SHORT_RANGE, Setting
from skyway_lab.experiments.laboratory import Laboratory
from skyway_lab.experiments.report import (
    Section,
    SummaryLine,
    count,
    duration,
    estimated,
    hours,
    image,
    markdown_table,
    percent,
    with_interval,
)
from skyway_lab.experiments.trials import Contest, Trial, hold

CONTESTANTS = (HEURISTIC, EXACT)
SHARES = (0.0, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95)


def congestion(laboratory: Laboratory) -> Section:
    """The same requests, with ever more of the pads' time taken."""
    shares = laboratory.size(quick=(0.0, 0.7, 0.95), full=SHARES)
    stations = laboratory.size(quick=12, full=35)
    trials = [
        Trial(
            Setting(
                stations=stations,
                degree=4.0,
                spacing_m=8_000.0,
                packages=3,
                taken=taken,
                model=SHORT_RANGE,
                recharge_policy="partial",
            ),
            seed=laboratory.seed_for("congestion", number),
            turn=number,
            contestants=CONTESTANTS,
            limit_s=laboratory.size(quick=0.5, full=3.0),
        )
        for taken in shares
        for number in range(laboratory.size(quick=2, full=20))
    ]
    by_share = hold(laboratory, "congestion", trials).by(lambda setting: setting.taken)
    percents = [100 * share for share in by_share]
    draw_lines(
        laboratory.folder / "congestion-delivery.png",
        "Delivery time against congestion",
        x=Axis("share of the pads' time taken, %"),
        y=Axis("mean delivery time, h"),
        lines=[
            Line(
                who,
                percents,
                [one.deliveries_h(who).mean() for one in by_share.values()],
                [one.has_limited(who) for one in by_share.values()],
            )
            for who in CONTESTANTS
        ],
    )
    draw_lines(
        laboratory.folder / "congestion-time.png",
        "Execution time against congestion",
        x=Axis("share of the pads' time taken, %"),
        y=Axis("median execution time, s", "log"),
        lines=[
            Line(who, percents, [one.times(who).median() for one in by_share.values()])
            for who in CONTESTANTS
        ],
    )
    return _section(by_share, stations, seed=laboratory.seed)


def _section(by_share: Mapping[float, Contest], stations: int, *, seed: int) -> Section:
    rows = [
        (
            percent(share),
            who,
            percent(contest.times(who).share_finished),
            estimated(contest.deliveries_h(who).mean(seed=seed), hours),
            estimated(contest.times(who).median(seed=seed), duration),
            estimated(contest.labels(who).median(seed=seed), count),
            *(
                with_interval(contest.gaps(who).quantile(at, seed=seed), percent)
                for at in (0.5, 0.95, 1.0)
            ),
        )
        for share, contest in by_share.items()
        for who in CONTESTANTS
    ]
    free, taken = by_share[min(by_share)], by_share[max(by_share)]
    findings = [
        SummaryLine(
            f"delivery time, 0 to {max(by_share):.0%} taken, {who}",
            f"{estimated(free.deliveries_h(who).mean(), hours)} to "
            f"{estimated(taken.deliveries_h(who).mean(), hours)}",
        )
        for who in CONTESTANTS
    ]
    intro = (
        f"{stations} stations 8 km apart, 4 pads, 3 packages, `{SHORT_RANGE.model_id}`, partial "
        "recharging. Others hold each pad for 20 to 60 minutes at a time, at random, for two "
        "days, so that the given share of its time is taken. The requests are the same for every "
        "share."
    )
    header = (
        "taken",
        "planner",
        "finished",
        "mean delivery",
        "median time",
        "labels",
        "gap p50",
        "p95",
        "max",
    )
    return Section(
        "Congestion by chance",
        [
            intro,
            image("congestion-delivery.png", "delivery time against congestion"),
            image("congestion-time.png", "execution time against congestion"),
            markdown_table(header, rows),
        ],
        findings,
    )
