"""What a forecast is worth: promises and landings of plans with and without one, by kind of day."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Final

from skyway.delivery.lateness import Conditions, PackageArrival, late_share, later_by_s
from skyway.drone.learned_values import AS_MODELLED, model_as_learned
from skyway.drone.model import DroneModel
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.planner.compose import compose
from skyway.planner.problem import Problem
from skyway_lab.experiments.contest import EXACT
from skyway_lab.experiments.figures import Axis, Stack, draw_groups
from skyway_lab.experiments.instances import Setting, chance, seed_of, texas_problem
from skyway_lab.experiments.laboratory import Laboratory
from skyway_lab.experiments.report import (
    Section,
    SummaryLine,
    image,
    markdown_table,
    percent,
    with_interval,
    write_rows,
)
from skyway_lab.experiments.sample import Estimate, Sample
from skyway_lab.experiments.weather_day import (
    DAYS,
    FlownDelivery,
    KindOfDay,
    WeatherDay,
    fly_in_weather,
)

#: What plans know of the weather, and the standard error of the wind in the forecast, m/s.
_ERRORS_MPS: Final[Mapping[str, float | None]] = {
    "still air": None,
    "exact forecast": 0.0,
    "wrong by 1 m/s": 1.0,
}

SETTING: Final = Setting(packages=1, model=DJI_MATRICE_300_RTK, recharge_policy="partial")

#: The energy margin of networks.
_ENERGY_MARGIN: Final = 0.15

#: The last packages from which the P90 is learned, as in the gateway.
_LAST: Final = 600

#: A package that comes later than planned by more than this counts as late, seconds.
_LATE_S: Final = 600.0

#: A landing this far below the reserve is within the error of the sensors.
_SENSOR_ERROR_SOC: Final = 0.005


@dataclass(frozen=True, slots=True)
class WeatherTrial:
    """Deliveries one after the other on one kind of day; `knowledge` is what plans know of it."""

    day: str
    knowledge: str
    seed: int
    deliveries: int


@dataclass(frozen=True, slots=True)
class PromisedDelivery:
    """A delivery of a trial; `p90_s` is how much later than planned its P90 is, None without P90.

    `number` counts all deliveries of the trial from 0, also those without a plan.
    """

    number: int
    planned_s: float
    late_s: float
    p90_s: float | None
    landings: int
    low_landings: int

    @property
    def came_by_p90(self) -> bool:
        """Whether it came by its P90, to the second."""
        return self.p90_s is not None and self.late_s <= self.p90_s


def weather(laboratory: Laboratory) -> Section:
    """Promises and landings by kind of day, and by what plans know of the weather."""
    days = laboratory.size(quick=("stormy",), full=tuple(DAYS))
    deliveries, learning = laboratory.size(quick=(60, 45), full=(400, 200))
    trials = [
        WeatherTrial(day, knowledge, laboratory.seed_for("weather", day), deliveries)
        for day in days
        for knowledge in _ERRORS_MPS
    ]
    results = laboratory.results("weather", run_weather_trial, trials)
    found = {
        (trial.day, trial.knowledge): flown for trial, flown in zip(trials, results, strict=True)
    }
    write_rows(
        laboratory.folder / "weather.csv",
        [
            {"day": trial.day, "plans": trial.knowledge, "seed": trial.seed, **asdict(one)}
            for trial, flown in zip(trials, results, strict=True)
            for one in flown
        ],
    )
    _draw(laboratory, days, found, learning=learning)
    return _section(found, days, deliveries=deliveries, learning=learning, seed=laboratory.seed)


def run_weather_trial(trial: WeatherTrial) -> list[PromisedDelivery]:
    """Plan, promise and fly the deliveries; each P90 is learned from the deliveries before."""
    kind, error_mps = DAYS[trial.day], _ERRORS_MPS[trial.knowledge]
    come: list[PackageArrival] = []
    flown: list[PromisedDelivery] = []
    for number in range(trial.deliveries):
        # All trials of a day have the same requests, weather and random numbers.
        seed = seed_of(trial.seed, number)
        problem = texas_problem(SETTING, seed=seed)
        day = WeatherDay.of(kind, chance(f"{seed}/day"))
        plan = compose(_as_known(problem, day, error_mps=error_mps, seed=seed))
        if not plan.delivery_time_s:
            continue
        delivery = fly_in_weather(problem, plan, day)
        # All deliveries of a trial fly on one kind of day: their weather need not be known.
        known = Conditions.of_plan(plan, None, None)
        share = late_share(known, come[-_LAST:])
        p90_s = None if share is None else later_by_s(plan.delivery_time_s, share)
        one = _promised(number, plan.delivery_time_s, delivery, p90_s=p90_s)
        flown.append(one)
        was_covered = None if p90_s is None else one.came_by_p90
        come.append(PackageArrival(one.planned_s, one.late_s, was_covered, known))
    return flown


def _as_known(problem: Problem, day: WeatherDay, *, error_mps: float | None, seed: int) -> Problem:
    """The problem as a network plans it: with its energy margin, and its forecast if it has one."""
    kind = day.kind if error_mps is not None else None
    with_margin = as_planned(problem.drone.model, kind)
    changes: dict[str, object] = {
        "strategy": EXACT,
        "drone": problem.drone.model_copy(update={"model": with_margin}),
        "time_limit_s": 20.0,
    }
    if error_mps is not None:
        random, (east, north) = chance(f"{seed}/forecast"), day.wind_mps
        wrong = east + random.gauss(0.0, error_mps), north + random.gauss(0.0, error_mps)
        changes["weather"] = day.kind.planned_weather(problem.network, with_margin, wrong)
    return problem.model_copy(update=changes)


def as_planned(model: DroneModel, kind: KindOfDay | None) -> DroneModel:
    """The drone as a network plans it: with its energy margin, and slow charging in known cold."""
    learned = AS_MODELLED if kind is None else AS_MODELLED.in_cold(kind.temperature_c)
    changes = {"power_empty_w": model.power_empty_w * (1 + _ENERGY_MARGIN)}
    return model_as_learned(model, learned).model_copy(update=changes)


def _promised(
    number: int, planned_s: float, flown: FlownDelivery, *, p90_s: float | None
) -> PromisedDelivery:
    least_soc = SETTING.model.reserve_soc - _SENSOR_ERROR_SOC
    return PromisedDelivery(
        number,
        round(planned_s, 1),
        round(flown.delivered_s - planned_s, 1),
        None if p90_s is None else round(p90_s, 1),
        landings=len(flown.landing_socs),
        low_landings=sum(soc < least_soc for soc in flown.landing_socs),
    )


_Flown = Sequence[PromisedDelivery]
_Found = Mapping[tuple[str, str], _Flown]


def _draw(laboratory: Laboratory, days: Sequence[str], found: _Found, *, learning: int) -> None:
    """A figure of the landings, one of the lateness, and one of the promises."""

    def draw(name: str, title: str, label: str, value: Callable[[_Flown], float]) -> None:
        draw_groups(
            laboratory.folder / f"weather-{name}.png",
            title,
            x=Axis("kind of day"),
            y=Axis(label),
            groups=list(days),
            bars=[
                Stack(knowledge, [value(found[day, knowledge]) for day in days])
                for knowledge in _ERRORS_MPS
            ],
        )

    title = "Landings below the reserve, without new plans"
    draw("landings", title, "share of all landings, %", lambda flown: 100 * _low(flown))
    title = "How much later than planned nine of ten packages come"
    draw("lateness", title, "minutes", lambda flown: _late_min(flown, 0.9).value)
    title, label = "Packages that came by their P90", "share of the packages with a P90, %"
    draw("promises", title, label, lambda flown: 100 * _kept(flown, learning).value)


def _low(flown: _Flown) -> float:
    return sum(one.low_landings for one in flown) / max(1, sum(one.landings for one in flown))


def _late_min(flown: _Flown, share: float) -> Estimate:
    return Sample.of([one.late_s / 60 for one in flown] or [math.inf]).quantile(share)


def _kept(flown: _Flown, learning: int, *, seed: int = 0) -> Estimate:
    """The share of packages that came by their P90, after so many deliveries."""
    kept = [float(one.came_by_p90) for one in flown if one.number >= learning]
    return Sample.of(kept or [0.0]).mean(seed=seed)


def _by_plan(flown: _Flown, *, seed: int) -> Estimate:
    """The share of packages that came by the planned time."""
    return Sample.of([float(one.late_s <= 0) for one in flown] or [0.0]).mean(seed=seed)


def _section(
    found: _Found, days: Sequence[str], *, deliveries: int, learning: int, seed: int
) -> Section:
    rows = [
        (
            f"{day}, {knowledge}",
            f"{len(flown)} of {deliveries}",
            f"{Sample.of([one.planned_s / 3600 for one in flown]).mean().value:.2f} h",
            f"{_late_min(flown, 0.5).value:.1f}, {_late_min(flown, 0.9).value:.1f} min",
            percent(sum(one.late_s > _LATE_S for one in flown) / max(1, len(flown))),
            with_interval(_by_plan(flown, seed=seed), percent),
            with_interval(_kept(flown, learning, seed=seed), percent),
            f"{Sample.of(_margins_min(flown, learning)).median().value:.1f} min",
            f"{sum(one.low_landings for one in flown)} of {sum(one.landings for one in flown)}",
        )
        for (day, knowledge), flown in found.items()
    ]
    findings = [
        SummaryLine(
            f"{day}: landings below the reserve, {', '.join(_ERRORS_MPS)}",
            ", ".join(percent(_low(found[day, knowledge])) for knowledge in _ERRORS_MPS),
        )
        for day in days
    ]
    findings += [
        SummaryLine(
            f"{day}: packages by their P90, forecast wrong by 1 m/s",
            with_interval(_kept(found[day, "wrong by 1 m/s"], learning, seed=seed), percent),
        )
        for day in days
    ]
    intro = (
        "Requests of one package between random places of the Texas corridor, "
        f"`{SETTING.model.model_id}`, all pads free. On each kind of day the wind, its gusts, the "
        "cold and the noise are those of the simulator's scenario of this name, and the mean wind "
        f"comes from any direction. {deliveries} deliveries follow one another, each with its own "
        "wind. They are planned in still air, with the forecast of the mean wind, and with a "
        "forecast whose wind is wrong by a standard error of 1 m/s in each of its two components. "
        f"Each plan has the networks' energy margin of {_ENERGY_MARGIN:.0%} and is flown as it "
        "stands: nothing is planned again, no failsafe acts, and a session lasts until the planned "
        "charge. So the figures show what plans alone are worth. All three kinds of plans fly in "
        "the same weather. The P90 is learned as the gateway learns it, from the packages before."
    )
    header = (
        "day, plans",
        "planned",
        "planned delivery",
        "late p50, p90",
        "later than 10 min",
        "by the plan (P50)",
        f"by the P90, after {learning}",
        "P90 after the plan",
        "landings below the reserve",
    )
    notes = (
        "Late: against the planned time. By the plan: the share of packages that came by the "
        "planned time. A promise of P50 should hold for half of them; plans that count gusts as "
        "head wind keep it for more. P90 after the plan: how much later than planned the P90 is; "
        "the median of the packages that the column before counts."
    )
    return Section(
        "Weather: what a forecast is worth",
        [
            intro,
            image("weather-landings.png", "landings below the reserve by kind of day"),
            image("weather-lateness.png", "lateness by kind of day"),
            image("weather-promises.png", "packages that came by their P90"),
            markdown_table(header, rows),
            notes,
        ],
        findings,
    )


def _margins_min(flown: _Flown, learning: int) -> list[float]:
    margins = [one.p90_s / 60 for one in flown if one.number >= learning and one.p90_s is not None]
    return margins or [math.inf]
