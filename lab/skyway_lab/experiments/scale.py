"""From 1,000 to 1,000,000 stations: whether cost follows the request or the network."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.geo import EARTH_RADIUS_M
from skyway.network.network import Network
from skyway.network.synthetic import synthetic_city
from skyway.planner.pad_book import PadBook
from skyway.planner.problem import DroneAtStart, Problem
from skyway.planner.stop import stopwatch
from skyway_lab.experiments.contest import EXACT, Run, run
from skyway_lab.experiments.figures import Axis, Line, draw_lines
from skyway_lab.experiments.instances import (
    Rows,
    Setting,
    chance,
    packages_for,
    seed_of,
    taken_book,
)
from skyway_lab.experiments.laboratory import Laboratory
from skyway_lab.experiments.report import (
    Section,
    SummaryLine,
    count,
    duration,
    estimated,
    image,
    markdown_table,
    percent,
    write_rows,
)
from skyway_lab.experiments.sample import Sample

#: Destinations lie within so many metres of the source (a local request).
REACH_M = 45_000.0
#: Pads are taken within so many metres of the source; no plan of such a request goes further.
_TAKEN_REACH_M = 120_000.0
_TAKEN = 0.7
_HORIZON_S = 24 * 3600.0
_LIMIT_S = 20.0


@dataclass(frozen=True, slots=True)
class ScaleTrial:
    """A network of so many stations, and so many requests for each number of packages."""

    stations: int
    seed: int
    packages: Sequence[int]
    requests: int


@dataclass(frozen=True, slots=True)
class Planned:
    """How long the network took to build, and a run of each request by its number of packages."""

    building_s: float
    runs: Sequence[tuple[int, Run]]


def run_trial(trial: ScaleTrial) -> Planned:
    """Build the network once, and plan all requests on it."""
    elapsed_s = stopwatch()
    network = synthetic_city(stations=trial.stations, seed=trial.seed)
    building_s = elapsed_s()
    runs: list[tuple[int, Run]] = []
    for number in range(trial.requests):
        for packages in trial.packages:
            seed = seed_of(trial.seed, number, packages)
            problem, booked = local_problem(network, packages, seed=seed)
            if not runs:
                # A service prepares a network once, when it loads it: this run is not counted.
                run(problem, EXACT, limit_s=_LIMIT_S, booked=booked)
            runs.append((packages, run(problem, EXACT, limit_s=_LIMIT_S, booked=booked)))
    return Planned(building_s, runs)


def local_problem(network: Network, packages: int, *, seed: int) -> tuple[Problem, PadBook]:
    """A request with destinations around its source, and the reservations of the pads there."""
    random = chance(seed)
    source_row = random.randrange(len(network.columns.station_ids))
    source = network.columns.station_ids[source_row]
    near = _around(network, source_row, REACH_M).tolist()
    around = [network.columns.station_ids[row] for row in near if row != source_row]
    setting = Setting(packages=packages, model=DJI_MATRICE_300_RTK)
    problem = Problem(
        network=network,
        drone=DroneAtStart(model=setting.model, soc=setting.model.top_soc),
        source=source,
        packages=packages_for(random.sample(around, packages), setting, random=random),
    )
    rows = _around(network, source_row, _TAKEN_REACH_M)
    return problem, taken_book(network, rows, share=_TAKEN, seed=seed, horizon_s=_HORIZON_S)


def _around(network: Network, row: int, reach_m: float) -> Rows:
    """The rows of the stations within this reach, measured on a plane: a city is nearly flat."""
    columns = network.columns
    stretch = math.cos(math.radians(columns.latitude_deg[row]))
    east_rad = np.radians(columns.longitude_deg - columns.longitude_deg[row]) * stretch
    north_rad = np.radians(columns.latitude_deg - columns.latitude_deg[row])
    return np.flatnonzero(EARTH_RADIUS_M * np.hypot(east_rad, north_rad) <= reach_m)


def scale(laboratory: Laboratory) -> Section:
    """Local requests on ever larger networks, planned to the proven optimum."""
    sizes = laboratory.size(quick=(300, 3_000), full=(1_000, 10_000, 100_000, 1_000_000))
    packages = laboratory.size(quick=(2, 4), full=(3, 5, 8))
    trials = [
        ScaleTrial(
            stations, laboratory.seed_for("scale"), packages, laboratory.size(quick=2, full=20)
        )
        for stations in sizes
    ]
    results = laboratory.results("scale", run_trial, trials)
    runs = {
        (trial.stations, number): [one for k, one in planned.runs if k == number]
        for trial, planned in zip(trials, results, strict=True)
        for number in packages
    }
    write_rows(
        laboratory.folder / "scale.csv",
        [
            {"stations": stations, "packages": number, **asdict(one)}
            for (stations, number), cell in runs.items()
            for one in cell
        ],
    )
    draw_lines(
        laboratory.folder / "scale.png",
        "Execution time of exact against the network's size",
        x=Axis("stations", "log"),
        y=Axis("median execution time, s", "log"),
        lines=[
            Line(
                f"{number} packages",
                sizes,
                [Sample.of_times(runs[stations, number]).median() for stations in sizes],
            )
            for number in packages
        ],
    )
    building_s = {
        trial.stations: planned.building_s for trial, planned in zip(trials, results, strict=True)
    }
    return _section(runs, building_s, seed=laboratory.seed)


def _section(
    runs: dict[tuple[int, int], list[Run]], building_s: dict[int, float], *, seed: int
) -> Section:
    rows = [
        (
            count(stations),
            str(number),
            duration(building_s[stations]),
            percent(sum(one.status == "optimal" for one in cell) / len(cell)),
            *(
                estimated(Sample.of_times(cell).quantile(at, seed=seed), duration)
                for at in (0.5, 0.95, 1.0)
            ),
            count(sum(one.labels for one in cell) / len(cell)),
        )
        for (stations, number), cell in runs.items()
    ]
    small, large = min(building_s), max(building_s)
    findings = [
        SummaryLine(
            f"{number} packages, {count(small)} to {count(large)} stations",
            f"median {duration(Sample.of_times(runs[small, number]).median().value)} to "
            f"{duration(Sample.of_times(runs[large, number]).median().value)}",
        )
        for number in dict.fromkeys(number for _, number in runs)
    ]
    intro = (
        f"Destinations within {REACH_M / 1000:g} km of the source, {_TAKEN:.0%} of the pads' time "
        "taken, stations 3 km apart, mean degree 6, `dji-matrice-300-rtk`, `exact`. Building is "
        "the time to make the network. The first plan on a network is not counted: it also "
        "prepares data that later plans use again."
    )
    header = ("stations", "packages", "building", "optimal", "p50", "p95", "max", "mean labels")
    return Section(
        "To a million stations",
        [
            intro,
            image("scale.png", "execution time against stations"),
            markdown_table(header, rows),
        ],
        findings,
    )
