"""The tables of the paper's evaluation: times with labels, gaps with delivery times."""

from collections.abc import Sequence

from skyway.experiments.contest import EXACT, EXACT_PLAIN, EXHAUSTIVE, HEURISTIC
from skyway.experiments.trials import Contest
from skyway.experiments.words import (
    count,
    duration,
    estimated,
    hours,
    markdown_table,
    percent,
    with_interval,
)

CONTESTANTS = (HEURISTIC, EXHAUSTIVE, EXACT, EXACT_PLAIN)


def table_of_times(by_size: dict[int, Contest], *, seed: int) -> str:
    """Means and medians of times, with the labels and compositions beside them."""
    rows: list[Sequence[str]] = []
    for size, contest in by_size.items():
        for who in CONTESTANTS:
            times = contest.times(who)
            rows.append(
                (
                    str(size),
                    who,
                    str(len(times.values)),
                    percent(times.share_finished),
                    estimated(times.mean(seed=seed), duration),
                    estimated(times.median(seed=seed), duration),
                    estimated(contest.labels(who).median(seed=seed), count),
                    estimated(contest.compositions(who).median(seed=seed), count),
                )
            )
    header = ("stations", "contestant", "runs", "finished", "mean", "median", "labels", "comp.")
    return markdown_table(header, rows)


def table_of_gaps(by_size: dict[int, Contest], *, seed: int) -> str:
    """How much later than the best known plan each contestant delivers."""
    rows = [
        (
            str(size),
            who,
            *(
                with_interval(contest.gaps(who).quantile(share, seed=seed), percent)
                for share in (0.5, 0.95, 1.0)
            ),
            estimated(contest.deliveries_h(who).mean(seed=seed), hours),
        )
        for size, contest in by_size.items()
        for who in (HEURISTIC, EXHAUSTIVE, EXACT)
    ]
    return markdown_table(
        ("stations", "contestant", "gap p50", "gap p95", "gap max", "mean delivery"), rows
    )
