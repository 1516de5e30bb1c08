"""Congestion by other drones' plans: many drones book their pads one after another."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from skyway.delivery.plan import Plan, Recharge
from skyway.planner.compose import compose
from skyway.planner.problem import PadReservation, Problem
from skyway.units import minutes_to_s
from skyway_lab.experiments.contest import EXACT, HEURISTIC
from skyway_lab.experiments.figures import Axis, Line, draw_lines
from skyway_lab.experiments.instances import (
    SHORT_RANGE,
    Setting,
    chance,
    city_problem,
    packages_for,
)
from skyway_lab.experiments.laboratory import Laboratory
from skyway_lab.experiments.report import (
    Row,
    Section,
    SummaryLine,
    duration,
    hours,
    image,
    markdown_table,
    percent,
    with_interval,
    write_rows,
)
from skyway_lab.experiments.sample import Sample

PLANNERS = (HEURISTIC, EXACT)

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


def booked_fleet(laboratory: Laboratory) -> Section:
    """How much later drones deliver that start after many others."""
    drones = laboratory.size(quick=8, full=40)
    setting = Setting(
        stations=laboratory.size(quick=10, full=25),
        degree=4.0,
        spacing_m=8_000.0,
        packages=2,
        pads=1,
        model=SHORT_RANGE,
        recharge_policy="partial",
    )
    fleets = [
        Fleet(setting, laboratory.seed_for("fleet", number), drones, planner)
        for number in range(laboratory.size(quick=1, full=6))
        for planner in PLANNERS
    ]
    results = laboratory.results("booked-fleet", fly_fleet, fleets)
    flown = FleetFlights(laboratory.size(quick=4, full=10), dict(zip(fleets, results, strict=True)))
    write_rows(laboratory.folder / "booked-fleet.csv", flown.rows())
    draw_lines(
        laboratory.folder / "booked-fleet.png",
        "Later than alone, by the number of drones booked before",
        x=Axis("drones booked before"),
        y=Axis("mean delay, % of the delivery time alone"),
        lines=[
            Line(
                planner,
                [begin + flown.group / 2 for begin in flown.begins],
                [_delays(flown.of(planner, begin), unit=100).mean() for begin in flown.begins],
            )
            for planner in PLANNERS
        ],
    )
    return _section(flown, setting, seed=laboratory.seed)


@dataclass(frozen=True, slots=True)
class FleetFlights:
    """The flights of all fleets, in groups of `group` drones in the order of their starts."""

    group: int
    fleets: Mapping[Fleet, Sequence[Flight]]

    @property
    def begins(self) -> range:
        """How many drones are booked before the first of each group."""
        return range(0, max(len(flights) for flights in self.fleets.values()), self.group)

    def of(self, planner: str, begin: int) -> list[Flight]:
        """The flights of one group under this planner, of all fleets."""
        return [
            flight
            for fleet, flights in self.fleets.items()
            if fleet.planner == planner
            for flight in flights[begin : begin + self.group]
        ]

    def rows(self) -> list[Row]:
        """A row for every drone."""
        return [
            {
                "planner": fleet.planner,
                "seed": fleet.seed,
                "drone": number,
                "delivery_s": flight.delivery_s,
                "alone_s": flight.alone_s,
                "waiting_s": flight.waiting_s,
            }
            for fleet, flights in self.fleets.items()
            for number, flight in enumerate(flights)
        ]


def _delays(flights: Sequence[Flight], *, unit: float = 1.0) -> Sample:
    """How much later than alone, as shares; infinite where the other drones leave no plan."""
    return Sample.of(
        [
            math.inf
            if flight.delivery_s is None
            else unit * (flight.delivery_s / flight.alone_s - 1)
            for flight in flights
            if flight.alone_s
        ]
    )


def _deliveries_h(flights: Sequence[Flight]) -> Sample:
    return Sample.of(
        [
            math.inf if flight.delivery_s is None else flight.delivery_s / 3600
            for flight in flights
            if flight.alone_s
        ]
    )


def _section(flown: FleetFlights, setting: Setting, *, seed: int) -> Section:
    rows = [
        (
            f"{begin} to {begin + flown.group - 1}",
            planner,
            with_interval(_delays(flown.of(planner, begin)).mean(seed=seed), percent),
            with_interval(_delays(flown.of(planner, begin)).quantile(0.95, seed=seed), percent),
            with_interval(_deliveries_h(flown.of(planner, begin)).mean(seed=seed), hours),
        )
        for begin in flown.begins
        for planner in PLANNERS
    ]
    last = flown.begins[-1]
    findings = [
        SummaryLine(
            f"mean delay of drones {last} to {last + flown.group - 1}, {planner}",
            f"{percent(_delays(flown.of(planner, last)).mean().value)}, delivered after "
            f"{hours(_deliveries_h(flown.of(planner, last)).mean().value)}",
        )
        for planner in PLANNERS
    ]
    intro = (
        f"{setting.stations} stations 8 km apart with one pad each. Every {duration(INTERVAL_S)} a "
        f"drone starts with {setting.packages} packages. It is planned around the pads that "
        "earlier drones booked, and then books its own. One planner plans a whole fleet; both "
        "planners get the same requests. The delay compares a plan with the same planner's plan "
        "for the same request with all pads free. Requests that are out of range even then do not "
        "count."
    )
    return Section(
        "Congestion by others' plans",
        [
            intro,
            image("booked-fleet.png", "delay by drones booked before"),
            markdown_table(
                ("drones booked before", "planner", "mean delay", "p95", "mean delivery"), rows
            ),
        ],
        findings,
    )


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
