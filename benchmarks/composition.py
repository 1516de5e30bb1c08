"""How long the paper's heuristic composes, by stations and packages: median and worst of runs.

Synthetic cities of degree about 6, 4 pads a station, destinations anywhere; seed 1. Prints
milliseconds for the whole solve with its verification, one core, plain Python.
"""

import platform
import random
import statistics
import time

from skyway.drone.models import PAPER_MATRICE_300
from skyway.network.network import Network
from skyway.network.synthetic import synthetic_city
from skyway.planner import compose
from skyway.planner.airspace import Airspace
from skyway.planner.problem import Problem

SEED = 1
RUNS = 20
STATIONS = (35, 60, 120, 500)
PACKAGES = (1, 3, 5)


def main() -> None:
    """Print the table."""
    machine = f"Python {platform.python_version()}, {platform.machine()}"
    print(f"seed {SEED}, {RUNS} runs a cell, {machine}; median / worst ms")
    print("stations " + "".join(f"{count:>8} packages" for count in PACKAGES))
    for stations in STATIONS:
        network = synthetic_city(stations=stations, seed=SEED)
        cells = []
        for packages in PACKAGES:
            times_ms = solve_times_ms(network, packages=packages)
            cells.append(f"{statistics.median(times_ms):8.1f} / {max(times_ms):6.1f}")
        print(f"{stations:8} {' '.join(cells)}")


def solve_times_ms(network: Network, *, packages: int) -> list[float]:
    """The time of each run, on requests drawn anew."""
    airspace = Airspace.of(network)
    chance = random.Random(f"{SEED}-{len(network.stations)}-{packages}")
    times_ms = []
    for _ in range(RUNS):
        problem = make_problem(network, *chance.sample(list(network.stations), packages + 1))
        started = time.perf_counter()
        compose(problem, airspace=airspace)
        times_ms.append(1000 * (time.perf_counter() - started))
    return times_ms


def make_problem(network: Network, source: str, *destinations: str) -> Problem:
    """A package of half a kilogram to each destination."""
    packages = [
        {"package_id": f"p{number}", "mass_kg": 0.5, "destination": destination}
        for number, destination in enumerate(destinations)
    ]
    drone = {"model": PAPER_MATRICE_300, "soc": 1.0}
    return Problem.model_validate(
        {"network": network, "drone": drone, "source": source, "packages": packages}
    )


if __name__ == "__main__":
    main()
