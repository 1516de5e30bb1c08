"""Why the heuristic is late: its order, its path, the amounts it charges, or its pads' timing.

The choices are replaced by the best ones, one after the other: the amounts on the heuristic's
route, its pads, the path for its order, the order. The gain of each step is the share of that
choice in the gap.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Literal

from skyway.delivery.plan import Deliver, Fly, Plan
from skyway.ids import StationId
from skyway.network.network import Network, Segment, Station
from skyway.planner.compose import compose, compose_with
from skyway.planner.exact import exact_with
from skyway.planner.exact_task import Method
from skyway.planner.problem import PackageToDeliver, PadReservation, Problem
from skyway_lab.experiments.contest import EXACT, HEURISTIC
from skyway_lab.experiments.figures import Axis, Stack, draw_stacks
from skyway_lab.experiments.instances import SHORT_RANGE, Setting, city_problem
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

_LIMIT_S = 3.0
_POLICIES: tuple[Literal["full", "partial"], ...] = ("full", "partial")
_CAUSES = ("order", "path", "amount", "pads")
_NO_PLAN = dict.fromkeys(_CAUSES)


@dataclass(frozen=True, slots=True)
class CauseTrial:
    """One instance, by its setting and seed."""

    setting: Setting
    seed: int


@dataclass(frozen=True, slots=True)
class Causes:
    """The delivery time that each choice of the heuristic costs, as shares of the best time.

    `pads` is the cost of charging at the wrong moments and places where pads are taken. It leaves
    out what the amounts cost on the same route with all pads free. The four shares add up.
    """

    order: float
    path: float
    amount: float
    pads: float

    @property
    def whole(self) -> float:
        """The heuristic's gap."""
        return self.order + self.path + self.amount + self.pads


def run_trial(trial: CauseTrial) -> Causes | None:
    """The causes on one instance, None where heuristic or `exact` has no plan."""
    problem = city_problem(trial.setting, seed=trial.seed)
    plan = compose(problem.model_copy(update={"strategy": HEURISTIC, "time_limit_s": _LIMIT_S}))
    best_s = _delivery_s(problem, EXACT)
    if plan.delivery_time_s is None or best_s is None:
        return None
    line = line_problem(problem, plan)
    free_line = line.model_copy(update={"pad_reservations": ()})
    order = [step.station_id for step in plan.steps if isinstance(step, Deliver)]
    same_order_s = _in_order_s(problem, [each for each in order if each != problem.source])
    same_route_s = _delivery_s(line, EXACT)
    free_s, best_free_s = _delivery_s(free_line, HEURISTIC), _delivery_s(free_line, EXACT)
    if same_order_s is None or same_route_s is None or free_s is None or best_free_s is None:
        return None
    amount_s = free_s - best_free_s
    return Causes(
        order=(same_order_s - best_s) / best_s,
        path=(same_route_s - same_order_s) / best_s,
        amount=amount_s / best_s,
        pads=(plan.delivery_time_s - same_route_s - amount_s) / best_s,
    )


def _delivery_s(problem: Problem, strategy: str) -> float | None:
    limited = problem.model_copy(update={"strategy": strategy, "time_limit_s": _LIMIT_S})
    return compose(limited).delivery_time_s


def _in_order_s(problem: Problem, order: Sequence[StationId]) -> float | None:
    """The earliest delivery in this order of destinations."""
    strategy = exact_with(Method(), order=tuple(order))
    limited = problem.model_copy(update={"time_limit_s": _LIMIT_S})
    return compose_with(strategy, limited, name="exact, in order").delivery_time_s


def causes(laboratory: Laboratory) -> Section:
    """The gap split by cause: full and partial recharging, free and taken pads."""
    cells = {
        f"{policy}, {taken:.0%} taken": Setting(
            stations=laboratory.size(quick=12, full=30),
            degree=4.0,
            spacing_m=8_000.0,
            packages=3,
            taken=taken,
            model=SHORT_RANGE,
            recharge_policy=policy,
        )
        for policy in _POLICIES
        for taken in (0.0, 0.6)
    }
    numbers = range(laboratory.size(quick=2, full=30))
    trials = [
        (name, CauseTrial(setting, laboratory.seed_for("causes", number)))
        for name, setting in cells.items()
        for number in numbers
    ]
    results = laboratory.results("causes", run_trial, [trial for _, trial in trials])
    rows = []
    found: dict[str, list[Causes | None]] = {name: [] for name in cells}
    for (name, trial), causes_of_one in zip(trials, results, strict=True):
        found[name].append(causes_of_one)
        shares = _NO_PLAN if causes_of_one is None else asdict(causes_of_one)
        rows.append({"cell": name, "seed": trial.seed, **shares})
    write_rows(laboratory.folder / "causes.csv", rows)
    split = {name: [one for one in all_of if one is not None] for name, all_of in found.items()}
    draw_stacks(
        laboratory.folder / "causes.png",
        "What makes the heuristic late",
        x=Axis("recharging and pads"),
        y=Axis("mean gap, %"),
        bars=list(split),
        stacks=[
            Stack(cause, [100 * _mean(of_cell, cause).value for of_cell in split.values()])
            for cause in _CAUSES
        ],
    )
    return _section(found, split, cells, seed=laboratory.seed)


def _mean(of_cell: Sequence[Causes], cause: str, *, seed: int = 0) -> Estimate:
    if not of_cell:
        return Estimate(0.0, 0.0, 0.0)
    return Sample.of([getattr(one, cause) for one in of_cell]).mean(seed=seed)


def _section(
    found: Mapping[str, Sequence[Causes | None]],
    split: Mapping[str, Sequence[Causes]],
    cells: Mapping[str, Setting],
    *,
    seed: int,
) -> Section:
    rows = [
        (
            name,
            f"{len(of_cell)} of {len(found[name])}",
            *(with_interval(_mean(of_cell, cause, seed=seed), percent) for cause in _CAUSES),
            with_interval(_mean(of_cell, "whole", seed=seed), percent),
        )
        for name, of_cell in split.items()
    ]
    findings = [SummaryLine(f"largest cause, {name}", _largest(split[name])) for name in split]
    setting = next(iter(cells.values()))
    intro = (
        f"{setting.stations} stations 8 km apart, {setting.packages} packages, "
        f"`{setting.model.model_id}`. The choices of the heuristic are replaced by the best "
        "choices, one after the other: how much "
        "it charges on its own route (**amount**, all pads free), when and where it uses pads on "
        "that route (**pads**), the **path** for its order, and the **order**. Each share is the "
        "mean over the instances of the delivery time lost by this choice, relative to the best; "
        "the four add up to the whole gap. `amount` also covers where on its route the drone "
        "charges; under full recharging only that is open. A share below 0 means that the route "
        "loses less with taken pads than with free ones. Instances where the heuristic has no "
        "plan cannot be split; they are counted."
    )
    header = ("recharging, pads", "split", *_CAUSES, "whole gap")
    return Section(
        "Why the heuristic is late",
        [
            intro,
            image("causes.png", "the gap by cause"),
            markdown_table(header, rows),
        ],
        findings,
    )


def _largest(of_cell: Sequence[Causes]) -> str:
    means = {cause: _mean(of_cell, cause).value for cause in _CAUSES}
    cause = max(means, key=lambda one: means[one])
    return f"{cause}: {percent(means[cause])} of {percent(_mean(of_cell, 'whole').value)}"


def line_problem(problem: Problem, plan: Plan) -> Problem:
    """The same delivery with the route fixed to that of this plan.

    Every visit of a station is a station of its own, with the pads and reservations of the
    original; the only segments lead from each visit to the next.
    """
    visits = [problem.start_station_id]
    handed_over_at: dict[StationId, int] = {}
    segments = []
    for step in plan.steps:
        if isinstance(step, Fly):
            visits.append(step.to_id)
            segments.append(_segment(problem.network, step, number=len(visits) - 1))
        elif isinstance(step, Deliver):
            handed_over_at[step.station_id] = len(visits) - 1
    stations = [
        _visit(problem.network.stations[original], number) for number, original in enumerate(visits)
    ]
    network = Network({station.station_id: station for station in stations}, tuple(segments))
    return problem.model_copy(
        update={
            "network": network,
            "source": _visit_id(visits.index(problem.source)),
            "drone": problem.drone.model_copy(update={"station_id": _visit_id(0)}),
            "packages": tuple(
                _package(package, handed_over_at[package.destination])
                for package in problem.packages
            ),
            "pad_reservations": _reservations(problem, visits),
        }
    )


def _visit_id(number: int) -> StationId:
    return StationId(f"visit-{number}")


def _visit(original: Station, number: int) -> Station:
    return Station(_visit_id(number), original.position, original.pads)


def _segment(network: Network, step: Fly, *, number: int) -> Segment:
    """The segment to the visit of this number."""
    length_m = next(
        segment.length_m
        for segment in network.segments_from(step.from_id)
        if segment.to_id == step.to_id
    )
    return Segment(_visit_id(number - 1), _visit_id(number), length_m)


def _package(package: PackageToDeliver, visit: int) -> PackageToDeliver:
    return package.model_copy(update={"destination": _visit_id(visit)})


def _reservations(problem: Problem, visits: list[StationId]) -> tuple[PadReservation, ...]:
    numbers: dict[StationId, list[int]] = defaultdict(list)
    for number, original in enumerate(visits):
        numbers[original].append(number)
    return tuple(
        reservation.model_copy(update={"station_id": _visit_id(number)})
        for reservation in problem.pad_reservations
        for number in numbers[reservation.station_id]
    )
