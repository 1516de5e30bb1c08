"""What the paper leaves open: its claims in every cell of degree, spacing, packages, congestion."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from skyway_lab.experiments.claims import (
    FAILS,
    HOLDS,
    ClaimResult,
    grows_exponentially,
    is_far_faster,
    is_near_optimal,
)
from skyway_lab.experiments.contest import EXACT, EXHAUSTIVE, HEURISTIC
from skyway_lab.experiments.instances import Setting
from skyway_lab.experiments.laboratory import Laboratory
from skyway_lab.experiments.report import Section, SummaryLine, duration, markdown_table, percent
from skyway_lab.experiments.trials import Contest, Trial, hold

CONTESTANTS = (HEURISTIC, EXHAUSTIVE, EXACT)


@dataclass(frozen=True, slots=True)
class Cell:
    """A setting that differs from the setting of the first section in one thing: its `name`."""

    name: str
    setting: Setting


def open_settings(laboratory: Laboratory) -> Section:
    """One thing varied at a time, over several sizes of network."""
    cells = _cells(laboratory)
    sizes = laboratory.size(quick=(8, 14), full=(10, 15, 20, 25))
    limit_s = laboratory.size(quick=0.1, full=2.0)
    trials = [
        Trial(
            replace(cell.setting, stations=stations),
            seed=laboratory.seed_for("open settings", stations, number),
            turn=number,
            contestants=CONTESTANTS,
            limit_s=limit_s,
        )
        for cell in cells
        for stations in sizes
        for number in range(laboratory.size(quick=2, full=30))
    ]
    contest = hold(laboratory, "open-settings", trials)
    found_of = {
        cell.name: _findings(_of_cell(contest, cell), largest=sizes[-1], seed=laboratory.seed)
        for cell in cells
    }
    finished = {
        cell.name: _of_cell(contest, cell).times(EXHAUSTIVE).share_finished for cell in cells
    }
    return _section(found_of, finished, sizes, limit_s)


def _cells(laboratory: Laboratory) -> list[Cell]:
    usual = Setting()
    cells = [Cell("as above", usual)]
    cells += [Cell(f"degree {d:g}", replace(usual, degree=d)) for d in (2.0, 3.0, 4.0)]
    cells += [Cell(f"spacing {m / 1000:g} km", replace(usual, spacing_m=m)) for m in (2e3, 8e3)]
    cells += [
        Cell("1 package" if k == 1 else f"{k} packages", replace(usual, packages=k))
        for k in (1, 3, 4)
    ]
    cells += [Cell(f"{t:.0%} of pads taken", replace(usual, taken=t)) for t in (0.5, 0.8)]
    return laboratory.size(quick=cells[:2], full=cells)


def _of_cell(contest: Contest, cell: Cell) -> Contest:
    return contest.select(lambda setting: replace(setting, stations=30) == cell.setting)


def _findings(contest: Contest, *, largest: int, seed: int) -> Sequence[ClaimResult]:
    on_largest = contest.select(lambda setting: setting.stations == largest)
    return (
        grows_exponentially(contest, seed=seed),
        is_far_faster(on_largest, seed=seed),
        is_near_optimal(contest.gaps_to(EXHAUSTIVE, HEURISTIC), seed=seed),
        is_near_optimal(contest.gaps_to(EXACT, HEURISTIC), seed=seed),
    )


def _section(
    found_of: dict[str, Sequence[ClaimResult]],
    finished: dict[str, float],
    sizes: Sequence[int],
    limit_s: float,
) -> Section:
    claims = (
        "grows exponentially",
        "heuristic far faster",
        "heuristic near-optimal against exhaustive",
        "heuristic near-optimal against exact",
    )
    findings = []
    for number, claim in enumerate(claims):
        answers = [of_cell[number].answer for of_cell in found_of.values()]
        findings.append(
            SummaryLine(
                f"{claim}",
                f"holds in {answers.count(HOLDS)}, fails in {answers.count(FAILS)} "
                f"of {len(answers)} cells",
            )
        )
    rows = [
        (name, percent(finished[name]), *(str(finding) for finding in of_cell))
        for name, of_cell in found_of.items()
    ]
    return Section(
        "What the paper leaves open",
        [
            (
                "Each cell changes one thing in the setting of the first section, on networks of "
                f"{sizes[0]} to {sizes[-1]} stations, with {duration(limit_s)} a run. The "
                "comparison with exhaustive is the paper's, on the instances on which exhaustive "
                "finished; the comparison with exact is ours."
            ),
            markdown_table(("cell", "exhaustive finished", *claims), rows),
        ],
        findings,
    )
