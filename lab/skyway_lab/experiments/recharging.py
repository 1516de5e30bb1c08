"""Full against partial recharging, under a linear charge curve and under a real one."""

import math
from collections.abc import Mapping
from typing import Literal

from skyway.drone.model import DroneModel
from skyway.drone.models import DJI_MATRICE_300_RTK, PAPER_SCENARIO
from skyway_lab.experiments.contest import EXACT, HEURISTIC
from skyway_lab.experiments.figures import Axis, Line, draw_lines
from skyway_lab.experiments.instances import Setting, texas_problem
from skyway_lab.experiments.laboratory import Laboratory
from skyway_lab.experiments.report import (
    Section,
    SummaryLine,
    estimated,
    hours,
    image,
    markdown_table,
    percent,
    with_interval,
)
from skyway_lab.experiments.sample import Sample
from skyway_lab.experiments.trials import Contest, Trial, hold

CONTESTANTS = (HEURISTIC, EXACT)

#: Range of the empty drone in the paper's scenario, metres.
PAPER_RANGE_M = 33_000.0
_RANGES_M = (24_000.0, PAPER_RANGE_M, 50_000.0, 75_900.0)

#: kg; light, so that the shortest range still reaches the next station.
_HEAVIEST_KG = 0.5

_POLICIES: tuple[Literal["full", "partial"], ...] = ("full", "partial")

CURVES = {
    "linear": PAPER_SCENARIO.charge_curve,
    "CC-CV": DJI_MATRICE_300_RTK.charge_curve,
}


def recharging(laboratory: Laboratory) -> Section:
    """The same requests on the Texas corridor, by curve, policy and range."""
    ranges_m = laboratory.size(quick=(PAPER_RANGE_M,), full=_RANGES_M)
    trials = [
        Trial(
            Setting(
                packages=3,
                model=_model(curve, range_m),
                recharge_policy=policy,
                heaviest_kg=_HEAVIEST_KG,
            ),
            seed=laboratory.seed_for("recharging", number),
            turn=number,
            contestants=CONTESTANTS,
            limit_s=3.0,
            make_problem=texas_problem,
        )
        for range_m in ranges_m
        for curve in CURVES
        for policy in _POLICIES
        for number in range(laboratory.size(quick=2, full=30))
    ]
    contest = hold(laboratory, "recharging", trials)
    by_model = contest.by(lambda setting: setting.model.model_id)
    cells = {
        (range_m, curve): by_model[_model(curve, range_m).model_id]
        for range_m in ranges_m
        for curve in CURVES
    }
    draw_lines(
        laboratory.folder / "recharging.png",
        "Delivery time saved by recharging partially",
        x=Axis("range of the empty drone, km"),
        y=Axis("mean share saved by exact, %"),
        lines=[
            Line(
                curve,
                [range_m / 1000 for range_m in ranges_m],
                [_saved(cells[range_m, curve], EXACT, unit=100).mean() for range_m in ranges_m],
            )
            for curve in CURVES
        ],
    )
    return _section(cells, seed=laboratory.seed)


def _model(curve: str, range_m: float) -> DroneModel:
    """The paper's drone with this charge curve, and with the battery for this range empty."""
    paper_s = PAPER_SCENARIO.battery_j / PAPER_SCENARIO.power_empty_w
    scale = range_m / (PAPER_SCENARIO.speed_empty_mps * paper_s)
    return PAPER_SCENARIO.model_copy(
        update={
            "model_id": f"{curve}-{range_m / 1000:g}-km",
            "battery_j": PAPER_SCENARIO.battery_j * scale,
            "charge_curve": CURVES[curve],
        }
    )


def _saved(cell: Contest, who: str, *, unit: float = 1.0) -> Sample:
    """The share of the delivery time that partial recharging saves, request by request.

    The share is 1 where only partial recharging has a plan. Requests without a plan under both
    policies are left out; the table counts the requests with a plan.
    """
    by_policy = cell.by(lambda setting: setting.recharge_policy)
    pairs = zip(by_policy["full"].runs(who), by_policy["partial"].runs(who), strict=True)
    return Sample.of(
        [
            unit * (1 - partial.delivery_s / (full.delivery_s or math.inf))
            for full, partial in pairs
            if partial.delivery_s is not None
        ]
    )


def _section(cells: Mapping[tuple[float, str], Contest], *, seed: int) -> Section:
    rows = []
    for (range_m, curve), cell in cells.items():
        for who in CONTESTANTS:
            by_policy = cell.by(lambda setting: setting.recharge_policy)
            saved = _saved(cell, who)
            rows.append(
                (
                    f"{range_m / 1000:g} km",
                    curve,
                    who,
                    f"{len(saved.values)} of {len(by_policy['full'].trials)}",
                    *(
                        estimated(by_policy[policy].deliveries_h(who).median(seed=seed), hours)
                        for policy in _POLICIES
                    ),
                    with_interval(saved.mean(seed=seed), percent),
                )
            )
    findings = [
        SummaryLine(
            f"saved by partial recharging, {curve}, {range_m / 1000:g} km",
            f"{percent(_saved(cell, EXACT).mean().value)} (exact), "
            f"{percent(_saved(cell, HEURISTIC).mean().value)} (heuristic)",
        )
        for (range_m, curve), cell in cells.items()
        if range_m == PAPER_RANGE_M
    ]
    intro = (
        "The paper's drone always recharges to the full, in 2.15 h. The requests here ask for 3 "
        "light packages between random places of the Texas corridor. The paper's drone is scaled "
        "to several ranges, with a linear charge curve and with the curve of a lithium battery "
        "(constant current to 80 %, then constant voltage). Both curves reach their top after "
        "2.15 h."
    )
    header = ("range", "curve", "planner", "with a plan", "full", "partial", "mean saved")
    return Section(
        "Full against partial recharging",
        [
            intro,
            image("recharging.png", "delivery time saved by partial recharging"),
            markdown_table(header, rows),
            "Full and partial are median delivery times over all requests.",
        ],
        findings,
    )
