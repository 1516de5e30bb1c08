"""Flies deliveries on the simulator's days, and compares promised with actual arrival times.

`python -m skyway_lab days --days calm,windy --deliveries 40 --seeds 1,2` runs a whole Skyway on the
embedded database and broker for each day and seed. One provider has drones of the model DJI
Matrice 300 RTK all over the bundled corridor, and each request has one package. Without
`--forecast-error-mps` plans use measured wind. `python -m tests.composition.virtual_day` has
the same options: composition and the agents fly in virtual time, so the figures depend only on the
seed.
"""

import argparse
import asyncio
import functools
import operator
import sys
from collections.abc import Callable, Coroutine
from typing import Any, Final

from skyway_lab.benchmarks.days.day import Trial, fly
from skyway_lab.benchmarks.days.figures import HEADER, Day
from skyway_lab.benchmarks.planner.machine import Machine
from skyway_lab.benchmarks.planner.table import Table

from skyway.errors import SkywayError

_DAYS: Final = "calm,busy,windy,cold,stormy"


def main(fly_day: Callable[[Trial], Coroutine[Any, Any, Day]] = fly) -> int:
    """Fly the days that are asked for, and print a row for each."""
    parser = argparse.ArgumentParser(prog="python -m skyway_lab days", description=__doc__)
    parser.add_argument("--days", default=_DAYS, help="scenarios, separated by commas")
    parser.add_argument("--deliveries", type=int, default=40, help="number for each day and seed")
    parser.add_argument("--drones", type=int, default=30, help="number of drones")
    parser.add_argument(
        "--every-s", type=float, default=180.0, help="fleet seconds between two requests"
    )
    parser.add_argument(
        "--clock-rate", type=float, default=120.0, help="fleet seconds in a wall second"
    )
    parser.add_argument("--seeds", default="1", help="whole numbers, separated by commas")
    parser.add_argument(
        "--forecast-error-mps",
        type=float,
        help="plan with a forecast whose wind is wrong by this standard error, metres per second",
    )
    parser.add_argument(
        "--reserve-risk",
        type=float,
        help="margins follow from this risk of a landing below the reserve, for example 0.01",
    )
    given = parser.parse_args()
    error_mps = given.forecast_error_mps
    seeds = [int(each) for each in given.seeds.split(",")]
    about = (
        f"{given.deliveries} deliveries every {given.every_s:g} s, {given.drones} drones, "
        f"clock rate {given.clock_rate:g}, seeds {given.seeds}, "
        f"forecast {'none' if error_mps is None else f'wrong by {error_mps:g} m/s'}, "
        f"reserve risk {'none' if given.reserve_risk is None else f'{given.reserve_risk:g}'}"
    )
    print(f"{Machine.here().as_text()}; {about}\n", flush=True)
    rows: list[tuple[str, ...]] = []
    try:
        for scenario in given.days.split(","):
            flown = [
                asyncio.run(
                    fly_day(
                        Trial(
                            scenario=scenario,
                            deliveries=given.deliveries,
                            drones=given.drones,
                            every_s=given.every_s,
                            clock_rate=given.clock_rate,
                            seed=seed,
                            error_mps=error_mps,
                            reserve_risk=given.reserve_risk,
                        )
                    )
                )
                for seed in seeds
            ]
            rows.append((scenario, *functools.reduce(operator.add, flown).row()))
            print(" | ".join(rows[-1]), flush=True)
    except SkywayError as error:
        print(error, file=sys.stderr)
        return 1
    caption = "Promised against delivered on the simulator's days."
    print(Table("days", caption, ("day", *HEADER), rows).as_markdown(), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
