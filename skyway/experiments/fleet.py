"""A fleet of drones, planned and booked one after another."""

from collections.abc import Sequence
from dataclasses import dataclass

from skyway.delivery.plan import Plan, Recharge
from skyway.experiments.instances import Setting, chance, city_problem, packages_for
from skyway.planner.compose import compose
from skyway.planner.problem import PadReservation, Problem
from skyway.units import minutes_to_s

#: A drone starts every so many seconds. Our own choice: the fleet meets at the pads.
INTERVAL_S = minutes_to_s(2)
_LIMIT_S = 1.0


@dataclass(frozen=True, slots=True)
class Fleet:
    """A number of drones in one city, all planned by one planner in the order of their starts."""

    setting: Setting
    seed: int
    drones: int
    planner: str


@dataclass(frozen=True, slots=True)
class Flight:
    """One drone's delivery among the others, and its delivery alone; None without a plan."""

    delivery_s: float | None
    alone_s: float | None
    waiting_s: float | None


def fly_fleet(fleet: Fleet) -> list[Flight]:
    """Plan and book every drone; each drone uses the pads that earlier drones left free."""
    first = city_problem(fleet.setting, seed=fleet.seed)
    random = chance(f"{fleet.seed}/fleet")
    stations = list(first.network.stations)
    booked: list[PadReservation] = []
    flights = []
    for number in range(fleet.drones):
        start_s = number * INTERVAL_S
        source, *destinations = random.sample(stations, fleet.setting.packages + 1)
        alone = first.model_copy(
            update={
                "source": source,
                "packages": packages_for(destinations, fleet.setting, random=random),
                "strategy": fleet.planner,
                "time_limit_s": _LIMIT_S,
            }
        )
        seen = tuple(_moved(held, by_s=-start_s) for held in booked)
        plan = compose(alone.model_copy(update={"pad_reservations": seen}))
        booked.extend(_moved(held, by_s=start_s) for held in _sessions(plan))
        flights.append(Flight(plan.delivery_time_s, _delivery_s(alone), plan.waiting_s))
    return flights


def _delivery_s(problem: Problem) -> float | None:
    return compose(problem).delivery_time_s


def _sessions(plan: Plan) -> Sequence[PadReservation]:
    return [
        PadReservation(
            station_id=step.station_id, pad=step.pad, start_s=step.start_s, end_s=step.end_s
        )
        for step in plan.steps
        if isinstance(step, Recharge) and step.end_s > step.start_s
    ]


def _moved(held: PadReservation, *, by_s: float) -> PadReservation:
    end_s = None if held.end_s is None else held.end_s + by_s
    return held.model_copy(update={"start_s": held.start_s + by_s, "end_s": end_s})
