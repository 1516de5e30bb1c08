"""Measures of a dispatched hour, and of the search of one plan: trials in, numbers out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import mean
from typing import Final

from skyway.dispatch.optimise import begun, proven_s
from skyway.planner.stop import processor_stopwatch
from skyway_lab.experiments.dispatched_hour.cases import FleetCase, fleet_case
from skyway_lab.experiments.dispatched_hour.policies import (
    DispatchPolicy,
    searched_in_rounds,
    searches,
)
from skyway_lab.experiments.dispatched_hour.rolling import RollingHour, on_time_share
from skyway_lab.experiments.fleet_hour.calendars import CHAINED, ONE_AT_A_TIME
from skyway_lab.experiments.fleet_hour.calendars import Policy as Calendar
from skyway_lab.experiments.fleet_hour.cases import Load, Place
from skyway_lab.experiments.fleet_hour.measures import simulate
from skyway_lab.experiments.report import Row

#: The policies by name: the calendars of `fleet_hour`, and the search that lets requests share
#: trips or not. The search is short, so that an hour takes some seconds.
CALENDARS: Final[Mapping[str, Calendar]] = {
    "P0 one at a time": ONE_AT_A_TIME,
    "P3 calendars": CHAINED,
}
SEARCHES: Final[Mapping[str, DispatchPolicy]] = {
    f"P4 {each.name}": each for each in searches(searched_in_rounds(5, most_steps=20_000))
}

#: Requests have equal pickups only where there are few hubs.
PLACES: Final[Sequence[Place]] = ("city", "corridor", "three hubs")
SHARED: Final[Sequence[Place]] = ("three hubs",)


@dataclass(frozen=True, slots=True)
class PolicyHour:
    """One policy in one seeded case, minute after minute."""

    place: Place
    load: Load
    seed: int
    policy: str


@dataclass(frozen=True, slots=True)
class HourOutcome:
    """Minutes from each request to its last delivery, and shares of all requests."""

    delays_min: tuple[float, ...]
    served_share: float
    on_time_share: float
    energy_kwh: float


@dataclass(frozen=True, slots=True)
class PlanSearch:
    """One case whose requests are all known together; the search is read after these rounds."""

    place: Place
    load: Load
    seed: int
    rounds: tuple[int, ...]

    @property
    def name(self) -> str:
        """The case in words."""
        return f"{self.place}, {self.load}"


@dataclass(frozen=True, slots=True)
class Improvement:
    """Mean minutes and processor time after each number of rounds; before, and at best."""

    arrival_min: float
    means_min: tuple[float, ...]
    proven_min: float
    elapsed_s: tuple[float, ...]


def fly_hour(hour: PolicyHour) -> HourOutcome:
    """Fly one hour under its policy."""
    case = fleet_case(hour.place, hour.load, seed=hour.seed)
    if hour.policy in CALENDARS:
        flown = simulate(case.hour, CALENDARS[hour.policy])
        waited_s = {
            each.request.number: (each.served_ms - each.request.asked_ms) / 1000
            for each in flown.missions
        }
        return _outcome(case, waited_s, sum(each.energy_j for each in flown.missions))
    rolling = RollingHour(case, SEARCHES[hour.policy], hour.seed)
    rolling.run()
    return _outcome(case, rolling.waited_s(), rolling.energy_j)


def _outcome(case: FleetCase, waited_s: Mapping[int, float], energy_j: float) -> HourOutcome:
    return HourOutcome(
        tuple(each / 60 for each in waited_s.values()),
        len(waited_s) / len(case.granted_s),
        on_time_share(case, waited_s),
        energy_j / 3.6e6,
    )


def improve(curve: PlanSearch) -> Improvement:
    """Search the plan of one case, and read its mean after each number of rounds."""
    case = fleet_case(curve.place, curve.load, seed=curve.seed)
    problem = case.known_together(pooling=False)
    elapsed_s = processor_stopwatch()
    search = begun(problem, seed=curve.seed)
    per_min = 60.0 * len(problem.requests)
    found: dict[int, tuple[float, float]] = {}

    def is_over(made: int) -> bool:
        if made in curve.rounds and made not in found:
            found[made] = search.best.costs.delivery_s / per_min, elapsed_s()
        return made >= curve.rounds[-1]

    search.run(is_over)
    # What is proven before the last round does not change any more.
    end = search.best.costs.delivery_s / per_min, elapsed_s()
    means_min, times_s = zip(*(found.get(each, end) for each in curve.rounds), strict=True)
    return Improvement(
        search.arrival.costs.delivery_s / per_min,
        means_min,
        proven_s(search) / per_min,
        times_s,
    )


def hour_row(hour: PolicyHour, outcome: HourOutcome) -> Row:
    """The row of an hour in the CSV file."""
    return {
        "place": hour.place,
        "drones": hour.load.drones,
        "requests": hour.load.requests,
        "policy": hour.policy,
        "seed": hour.seed,
        "served_share": outcome.served_share,
        "mean_min": round(mean(outcome.delays_min), 3),
        "on_time_share": round(outcome.on_time_share, 4),
        "energy_kwh": round(outcome.energy_kwh, 3),
    }


def plan_rows(curve: PlanSearch, found: Improvement) -> list[Row]:
    """The rows of a search in the CSV file, one for each number of rounds."""
    return [
        {
            "place": curve.place,
            "drones": curve.load.drones,
            "requests": curve.load.requests,
            "seed": curve.seed,
            "rounds": rounds,
            "arrival_min": round(found.arrival_min, 3),
            "mean_min": round(mean_min, 3),
            "proven_min": round(found.proven_min, 3),
        }
        for rounds, mean_min in zip(curve.rounds, found.means_min, strict=True)
    ]
