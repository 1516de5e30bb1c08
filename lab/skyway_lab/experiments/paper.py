"""The paper's evaluation: execution time and delivery time against the number of stations."""

from collections.abc import Sequence

from skyway.units import CHARGE_TOLERANCE
from skyway_lab.experiments.claims import (
    FAILS,
    HOLDS,
    HOW_TESTED,
    OPEN,
    grows_exponentially,
    is_far_faster,
    is_near_optimal,
)
from skyway_lab.experiments.contest import EXACT, EXACT_PLAIN, EXHAUSTIVE, HEURISTIC
from skyway_lab.experiments.figures import Axis, Line, draw_lines
from skyway_lab.experiments.instances import Setting
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
from skyway_lab.experiments.sample import Sample
from skyway_lab.experiments.trials import Contest, Trial, hold

CONTESTANTS = (HEURISTIC, EXHAUSTIVE, EXACT, EXACT_PLAIN)


def table_of_times(by_size: dict[int, Contest], contestants: Sequence[str], *, seed: int) -> str:
    """Means and medians of times, with the labels and compositions beside them."""
    rows: list[Sequence[str]] = []
    for size, contest in by_size.items():
        for who in contestants:
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


_WORDS = {
    HOLDS: "**we agree**",
    FAILS: "**we disagree**",
    OPEN: "**undecided** by these runs",
}


_SHORT_WORDS = {HOLDS: "yes", FAILS: "no", OPEN: "undecided"}


def paper(laboratory: Laboratory) -> Section:
    """10 to 35 stations, 40 runs each, 4 pads, the paper's drone."""
    sizes = laboratory.size(quick=(10, 15, 20), full=(10, 15, 20, 25, 30, 35))
    limit_s = laboratory.size(quick=0.4, full=10.0)
    contest = hold(
        laboratory,
        "paper",
        [
            Trial(
                Setting(stations=stations),
                seed=laboratory.seed_for("paper", stations, number),
                turn=number,
                contestants=CONTESTANTS,
                limit_s=limit_s,
            )
            for stations in sizes
            for number in range(laboratory.size(quick=3, full=40))
        ],
    )
    by_size = contest.by(lambda setting: setting.stations)
    _draw(laboratory, by_size)
    return _section(laboratory, contest, by_size, limit_s)


def _draw(laboratory: Laboratory, by_size: dict[int, Contest]) -> None:
    sizes = list(by_size)
    draw_lines(
        laboratory.folder / "paper-execution-time.png",
        "Execution time against the number of stations",
        x=Axis("stations"),
        y=Axis("mean execution time, s", "log"),
        lines=[
            Line(who, sizes, [by_size[size].times(who).mean() for size in sizes])
            for who in CONTESTANTS
        ],
    )
    draw_lines(
        laboratory.folder / "paper-delivery-time.png",
        "Delivery time against the number of stations",
        x=Axis("stations"),
        y=Axis("mean delivery time, h"),
        lines=[
            Line(
                who,
                sizes,
                [by_size[size].deliveries_h(who).mean() for size in sizes],
                [by_size[size].has_limited(who) for size in sizes],
            )
            for who in (HEURISTIC, EXHAUSTIVE, EXACT)
        ],
    )


def _section(
    laboratory: Laboratory, contest: Contest, by_size: dict[int, Contest], limit_s: float
) -> Section:
    seed, largest = laboratory.seed, by_size[max(by_size)]
    findings = [*claims(contest, by_size, seed=seed), *_beyond(contest, largest)]
    intro = (
        f"Cities of {min(by_size)} to {max(by_size)} stations, 4 pads each, with the paper's drone "
        "(`paper-matrice-300`). As in the paper, the drone always recharges to the full, source "
        "and destinations are random. The paper has half as many runs as stations, which are too "
        "few to decide a claim for one size; here are more. The paper leaves "
        "three things open. They are set here to 2 packages, a mean degree of 2.5 and a "
        "spacing of 5 km, and are varied in the next section. A run has at most "
        f"{duration(limit_s)}. All contestants run on the same instances, one after the other; "
        "each of them begins in turn."
    )
    return Section(
        "The paper's evaluation",
        [
            intro,
            image("paper-execution-time.png", "execution time"),
            image("paper-delivery-time.png", "delivery time"),
            table_of_times(by_size, CONTESTANTS, seed=seed),
            (
                "Mean and median. ≥ marks values with runs that reached their limit, which counts "
                "as their time. Labels are the states that a search looked at; compositions are "
                "the whole routes that it simulated. In the figures a marker is open where the "
                "limit ended some runs; where the true mean is at least as high, it has an arrow."
            ),
            table_of_gaps(by_size, seed=seed),
            HOW_TESTED,
        ],
        findings,
    )


def claims(contest: Contest, by_size: dict[int, Contest], *, seed: int) -> list[SummaryLine]:
    """The paper's claims and whether our measurements agree, and the claim against exact.

    Gaps are judged for each size: over all sizes together, easy small networks hide large ones.
    """
    largest = max(by_size)
    claims = {
        "exhaustive grows exponentially": grows_exponentially(contest, seed=seed),
        f"the heuristic is far faster (at {largest} stations)": is_far_faster(
            by_size[largest], seed=seed
        ),
    }
    lines = [
        SummaryLine(f"the paper says that {claim}", f"{_WORDS[finding.answer]}: {finding.measured}")
        for claim, finding in claims.items()
    ]
    for size, one in by_size.items():
        near = "the heuristic is near-optimal in comparison to"
        to_exhaustive, to_exact = (
            is_near_optimal(one.gaps_to(baseline, HEURISTIC), seed=seed)
            for baseline in (EXHAUSTIVE, EXACT)
        )
        lines += [
            SummaryLine(
                f"at {size} stations the paper says that {near} exhaustive, where that finished",
                f"{_WORDS[to_exhaustive.answer]}: {to_exhaustive.measured}",
            ),
            SummaryLine(
                f"at {size} stations {near} exact, whose plans are proven",
                f"**{_SHORT_WORDS[to_exact.answer]}**: {to_exact.measured}",
            ),
        ]
    return lines


def _beyond(contest: Contest, largest: Contest) -> list[SummaryLine]:
    """Results that the paper does not give."""
    stations = largest.trials[0].setting.stations
    finished = [
        gap
        for gap, run in zip(contest.gaps(EXHAUSTIVE).values, contest.runs(EXHAUSTIVE), strict=True)
        if not run.is_censored
    ]
    later = [gap for gap in finished if gap > CHARGE_TOLERANCE]
    return [
        SummaryLine(
            "exhaustive is optimal only among simple paths with its recharge rule",
            f"of {len(finished)} runs that finished {len(later)} are later than exact, "
            f"by up to {percent(max(later, default=0.0))}",
        ),
        *(
            SummaryLine(
                f"{fast} against {slow} at {stations} stations",
                f"{_ratio(largest, slow, fast)} times as fast at the median",
            )
            for fast, slow in (
                (EXACT, HEURISTIC),
                (EXACT, EXHAUSTIVE),
                (EXACT_PLAIN, EXHAUSTIVE),
                (EXACT, EXACT_PLAIN),
            )
        ),
    ]


def _ratio(contest: Contest, slow: str, fast: str) -> str:
    """How many times faster on the same instances, with ≥ where `slow` reached its limit."""
    pairs = zip(contest.runs(slow), contest.runs(fast), strict=True)
    ratio = Sample.of([one.elapsed_s / other.elapsed_s for one, other in pairs]).median().value
    is_at_least = contest.times(slow).share_finished < 1
    return f"{'≥ ' if is_at_least else ''}{ratio:.3g}"
