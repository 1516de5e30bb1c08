"""One request planned with a margin on the drone's power, and flown on many days."""

from collections.abc import Mapping
from dataclasses import dataclass

from skyway.delivery.plan import Plan
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.experiments.contest import EXACT
from skyway.experiments.flown_plan import Climate, Day, fly_plan
from skyway.experiments.instances import Setting, chance, texas_problem
from skyway.planner.compose import compose
from skyway.planner.problem import Problem
from skyway.units import CHARGE_TOLERANCE, minutes_to_s

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
