"""Flown against planned: how often disturbances break a plan, and the price of a margin."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

from skyway.delivery.plan import Plan
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.planner.compose import compose
from skyway.planner.problem import Problem
from skyway.units import CHARGE_TOLERANCE, minutes_to_s
from skyway_lab.experiments.contest import EXACT
from skyway_lab.experiments.figures import Axis, Line, draw_lines
from skyway_lab.experiments.flown_plan import Climate, Day, fly_plan
from skyway_lab.experiments.instances import Setting, chance, texas_problem
from skyway_lab.experiments.laboratory import Laboratory
from skyway_lab.experiments.report import (
    Row,
    Section,
    SummaryLine,
    duration,
    image,
    markdown_table,
    percent,
    with_interval,
    write_rows,
)
from skyway_lab.experiments.sample import Estimate, Sample

MARGINS = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3)


SETTING = Setting(packages=3, taken=0.3, model=DJI_MATRICE_300_RTK, recharge_policy="partial")


CLIMATES = {
    "power noise 5 %": Climate(power_noise=0.05),
    "wind 4 m/s": Climate(wind_mps=4.0),
    "late pads 30 %": Climate(late_share=0.3),
    "all three": Climate(power_noise=0.05, wind_mps=4.0, late_share=0.3),
}


#: A delivery later than planned by more than this counts as late. Our own choice.
LATE_S = minutes_to_s(10)


@dataclass(frozen=True, slots=True)
class MarginTrial:
    """One request, planned with one margin, flown on so many days of every climate."""

    seed: int
    margin: float
    days: int


@dataclass(frozen=True, slots=True)
class Flights:
    """Shares of the flights of one plan under one climate, and their mean delivery time."""

    safe: float
    late: float
    flown_h: float


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of one request; `price` is None without a plan for the margin.

    `price` is how much later the plan delivers than the plan without a margin, as a share.
    """

    price: float | None
    flights: Mapping[str, Flights]


def flown(laboratory: Laboratory) -> Section:
    """Shares of safe and late flights by margin and by what disturbs them."""
    margins = laboratory.size(quick=(0.0, 0.2), full=MARGINS)
    days = laboratory.size(quick=20, full=100)
    trials = [
        MarginTrial(laboratory.seed_for("flown", number), margin, days)
        for margin in margins
        for number in range(laboratory.size(quick=3, full=50))
    ]
    results = laboratory.results("flown", run_margin_trial, trials)
    by_margin = {
        margin: [
            outcome
            for trial, outcome in zip(trials, results, strict=True)
            if trial.margin == margin and outcome is not None
        ]
        for margin in margins
    }
    write_rows(laboratory.folder / "flown.csv", _rows(trials, results))
    percents = [100 * margin for margin in margins]
    draw_lines(
        laboratory.folder / "flown-safe.png",
        "Flights that never fall below the reserve",
        x=Axis("margin on the power that the plan counts with, %"),
        y=Axis("share of flights, %"),
        lines=[
            Line(name, percents, [_mean(by_margin[m], name, "safe", unit=100) for m in margins])
            for name in CLIMATES
        ],
    )
    draw_lines(
        laboratory.folder / "flown-price.png",
        "The price of the margin",
        x=Axis("margin on the power that the plan counts with, %"),
        y=Axis("planned delivery later by, %"),
        lines=[Line("mean over requests", percents, [_price(by_margin[m], 100) for m in margins])],
    )
    return _section(by_margin, days, seed=laboratory.seed)


def _rows(trials: Sequence[MarginTrial], results: Sequence[Outcome | None]) -> list[Row]:
    nothing = Flights(math.nan, math.nan, math.nan)
    return [
        {
            "seed": trial.seed,
            "margin": trial.margin,
            "climate": name,
            "price": outcome.price,
            **asdict(outcome.flights.get(name, nothing)),
        }
        for trial, outcome in zip(trials, results, strict=True)
        if outcome is not None
        for name in CLIMATES
    ]


def _mean(
    outcomes: Sequence[Outcome], climate: str, what: str, *, unit: float = 1.0, seed: int = 0
) -> Estimate:
    shares = [unit * getattr(one.flights[climate], what) for one in outcomes if one.flights]
    return Sample.of(shares or [math.inf]).mean(seed=seed)


def _price(outcomes: Sequence[Outcome], unit: float = 1.0, *, seed: int = 0) -> Estimate:
    prices = [unit * one.price for one in outcomes if one.price is not None]
    return Sample.of(prices or [math.inf]).mean(seed=seed)


def _section(by_margin: Mapping[float, Sequence[Outcome]], days: int, *, seed: int) -> Section:
    rows = [
        (
            percent(margin),
            f"{sum(one.price is not None for one in outcomes)} of {len(outcomes)}",
            with_interval(_price(outcomes, seed=seed), percent),
            *(percent(_mean(outcomes, name, "safe").value) for name in CLIMATES),
            *(percent(_mean(outcomes, name, "late").value) for name in CLIMATES),
        )
        for margin, outcomes in by_margin.items()
    ]
    most = max(by_margin)
    findings = [
        SummaryLine(
            f"flights above the reserve, {margin:.0%} margin, all three",
            f"{with_interval(_mean(by_margin[margin], 'all three', 'safe', seed=seed), percent)}, "
            f"delivering {percent(_price(by_margin[margin]).value)} later",
        )
        for margin in (min(by_margin), most)
    ]
    intro = (
        "Requests of 3 packages on the Texas corridor that need recharging, "
        "`dji-matrice-300-rtk`, 30 % of the pads' time taken. `exact` plans each request for a "
        f"drone that needs more power than the true one, by a margin. Each plan is flown on {days} "
        "days without replanning. Power noise: 5 % a segment, half of its variance the same all "
        "day. Wind: Rayleigh, mean 4 m/s, any direction, the same all day; the drone keeps air "
        "speed and track. Late pads: 30 % of sessions begin late, by 10 minutes on average. Safe: "
        f"never below the reserve of 10 %. Late: delivered more than {duration(LATE_S)} after the "
        "plan. A plan charges no more than it needs, so a plan without a margin has no spare "
        "charge."
    )
    header = (
        "margin",
        "planned",
        "price",
        *(f"safe: {name}" for name in CLIMATES),
        *(f"late: {name}" for name in CLIMATES),
    )
    return Section(
        "Flown against planned",
        [
            intro,
            image("flown-safe.png", "share of safe flights by margin"),
            image("flown-price.png", "price of the margin"),
            markdown_table(header, rows),
        ],
        findings,
    )


def run_margin_trial(trial: MarginTrial) -> Outcome | None:
    """Plan with the margin on the drone's power, then fly with its true power.

    None if there is no plan without a margin, or if that plan never recharges: the charge left
    in its battery is margin enough.
    """
    problem = texas_problem(SETTING, seed=trial.seed)
    usual = compose(_with_margin(problem, 0.0))
    if not usual.delivery_time_s or not usual.recharging_s:
        return None
    plan = compose(_with_margin(problem, trial.margin))
    if plan.delivery_time_s is None:
        return Outcome(None, {})
    price = plan.delivery_time_s / usual.delivery_time_s - 1
    return Outcome(price, {name: _flights(problem, plan, name, trial) for name in CLIMATES})


def _flights(problem: Problem, plan: Plan, climate: str, trial: MarginTrial) -> Flights:
    flights = [
        # Every margin is flown on the same days.
        fly_plan(problem, plan, Day.of(CLIMATES[climate], chance(f"{trial.seed}/{climate}/{day}")))
        for day in range(trial.days)
    ]
    reserve_soc = problem.drone.model.reserve_soc - CHARGE_TOLERANCE
    latest_s = (plan.delivery_time_s or 0.0) + LATE_S
    return Flights(
        safe=sum(flight.lowest_soc >= reserve_soc for flight in flights) / trial.days,
        late=sum(flight.delivered_s > latest_s for flight in flights) / trial.days,
        flown_h=sum(flight.delivered_s for flight in flights) / trial.days / 3600,
    )


def _with_margin(problem: Problem, margin: float) -> Problem:
    """The problem for a drone that needs more power by this share."""
    model = problem.drone.model
    with_margin = model.model_copy(update={"power_empty_w": model.power_empty_w * (1 + margin)})
    return problem.model_copy(
        update={
            "strategy": EXACT,
            "drone": problem.drone.model_copy(update={"model": with_margin}),
            "time_limit_s": 20.0,
        }
    )
