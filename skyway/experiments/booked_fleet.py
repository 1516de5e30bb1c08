"""Congestion by other drones' plans: many drones book their pads one after another."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from skyway.experiments.contest import EXACT, HEURISTIC
from skyway.experiments.figures import Axis, Line, draw_lines
from skyway.experiments.fleet import INTERVAL_S, Fleet, Flight, fly_fleet
from skyway.experiments.instances import SHORT_RANGE, Setting
from skyway.experiments.laboratory import Laboratory
from skyway.experiments.report import (
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
from skyway.experiments.sample import Sample

PLANNERS = (HEURISTIC, EXACT)


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
