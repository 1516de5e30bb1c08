"""Two plans in two threads take about the time of one, and other calls are answered meanwhile.

`python -m skyway_lab.solver_pool [--rounds 20]` composes the same problem alone, twice one after
the other, and two in parallel in the composition service's solver pool, and measures how late the
event loop comes meanwhile. Medians of the rounds; the machine needs two idle cores, and whether it
has them is measured beside it.
"""

import argparse
import asyncio
import hashlib
import os
import platform
import random
import statistics
import sys
import time
from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np
from skyway_composition.planning.solver_pool import SolverPool

from skyway.delivery.plan import Plan
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.network.network import Network
from skyway.network.synthetic import synthetic_city
from skyway.planner.airspace import Airspace
from skyway.planner.pad_book import PadBook
from skyway.planner.problem import Problem

SEED = 1

#: Wall seconds between two looks at the event loop.
TICK_S = 0.001


def crowded_problem(stations: int, packages: int) -> Problem:
    """Packages to all over a city: a search long enough to be measured."""
    city = synthetic_city(stations=stations, seed=SEED)
    rng = random.Random(SEED)
    source, *destinations = rng.sample(list(city.stations), packages + 1)
    return Problem.model_validate(
        {
            "network": city,
            "drone": {"model": DJI_MATRICE_300_RTK, "soc": 1.0},
            "source": source,
            "packages": [
                {"package_id": f"p{number}", "mass_kg": 0.2, "destination": destination}
                for number, destination in enumerate(destinations)
            ],
        }
    )


def crowded_pads(network: Network) -> PadBook:
    """Every pad taken for 3,000 s of each 3,500 s, as composition reads it from its database."""
    rng = random.Random(SEED)
    starts_s = np.arange(0, 60_000, 3_500)
    station, pad, start_s = (
        each.ravel() for each in np.meshgrid(np.arange(len(network.row_of)), np.arange(4), starts_s)
    )
    offsets_s = np.array([rng.randrange(3_500) for _ in network.row_of])
    start_ms = 1000 * (start_s + offsets_s[station] - 3_500 * (pad % 2))
    return PadBook.of_arrays(
        station=station, pad=pad, start_ms=start_ms, end_ms=start_ms + 3_000_000
    )


@dataclass(frozen=True, slots=True)
class Taken:
    """Wall seconds that something took, and processor seconds of this process."""

    wall_s: float
    processor_s: float

    @property
    def cores(self) -> float:
        """How many cores it had on average; fewer than it could use where others want them."""
        return self.processor_s / self.wall_s


async def taken_by(work: Callable[[], Awaitable[object]]) -> Taken:
    """What this takes."""
    wall_s, processor_s = time.perf_counter(), time.process_time()
    await work()
    return Taken(time.perf_counter() - wall_s, time.process_time() - processor_s)


def median_of(taken: Iterable[Taken]) -> Taken:
    """The medians of both times."""
    walls, processors = zip(*((each.wall_s, each.processor_s) for each in taken), strict=True)
    return Taken(statistics.median(walls), statistics.median(processors))


async def latest_tick_s(until: asyncio.Future[object]) -> float:
    """The most by which the event loop was late until this was done."""
    latest_s = 0.0
    while not until.done():
        due_s = time.perf_counter() + TICK_S
        await asyncio.sleep(TICK_S)
        latest_s = max(latest_s, time.perf_counter() - due_s)
    return latest_s


def hash_much() -> None:
    """Work that certainly holds no lock of the interpreter's: what the machine itself gives."""
    for _ in range(8):
        hashlib.sha256(bytes(1 << 24)).digest()


async def print_machine() -> None:
    """Print what hashing in two threads takes, beside hashing in one."""

    async def hashing(threads: int) -> None:
        await asyncio.gather(*(asyncio.to_thread(hash_much) for _ in range(threads)))

    one = [await taken_by(partial(hashing, 1)) for _ in range(5)]
    two = [await taken_by(partial(hashing, 2)) for _ in range(5)]
    ratio = median_of(two).wall_s / median_of(one).wall_s
    print(f"the machine now: hashing in two threads takes {ratio:.2f} x as long as in one")


async def measure(problem: Problem, rounds: int) -> None:
    """Print medians of so many rounds."""
    await print_machine()
    async with SolverPool(threads=2, time_limit_s=60.0) as solver:
        await solver.warm()
        booked, airspace = crowded_pads(problem.network), Airspace.of(problem.network)
        compose = partial(solver.compose, problem, booked=booked, airspace=airspace)
        plan: Plan = await compose()

        async def in_turn() -> None:
            await compose()
            await compose()

        async def at_once() -> None:
            await asyncio.gather(compose(), compose())

        one, two, both, late = [], [], [], []
        for _ in range(rounds):
            one.append(await taken_by(compose))
            two.append(await taken_by(in_turn))
            both.append(await taken_by(at_once))
            late.append(await latest_tick_s(asyncio.ensure_future(at_once())))
    first = median_of(one)
    print(f"plan {plan.status.value}, {plan.stats['labels']} labels, seed {SEED}, {rounds} rounds")
    for name, taken in (
        ("one plan", first),
        ("two in turn", median_of(two)),
        ("two in parallel", median_of(both)),
    ):
        ratio = taken.wall_s / first.wall_s
        print(
            f"{name:<12} {1000 * taken.wall_s:8.1f} ms  {ratio:5.2f} x one  {taken.cores:.2f} cores"
        )
    print(f"event loop late by {1000 * statistics.median(late):.1f} ms at most while two compose")


def main(arguments: list[str]) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--stations", type=int, default=10_000)
    parser.add_argument("--packages", type=int, default=12)
    options = parser.parse_args(arguments)
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}")
    asyncio.run(measure(crowded_problem(options.stations, options.packages), options.rounds))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
