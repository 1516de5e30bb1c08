"""`python -m skyway_lab cells`: processor time for each delivery without cells and with them.

The same regions, drones and requests are served by one composition, and by one for each region, in
turns: others who use the machine disturb both alike. `--routing` measures the gateway's way to a
hundred cells instead, without their servers.
"""

import argparse
import asyncio
import shlex
import statistics
import sys

import uvloop
from skyway_lab.benchmarks.cells.routing import routing_rows
from skyway_lab.benchmarks.cells.run import SERVICES, Cost, run
from skyway_lab.benchmarks.load.burst import Burst
from skyway_lab.benchmarks.planner.machine import Machine
from skyway_lab.benchmarks.planner.table import Table


def main(arguments: list[str]) -> int:
    """Run in turns and print what each delivery cost; 1 when an invariant is broken."""
    parser = argparse.ArgumentParser(prog="python -m skyway_lab cells", description=__doc__)
    parser.add_argument("--storage", choices=("embedded", "production"), default="embedded")
    parser.add_argument("--regions", type=int, default=2)
    parser.add_argument("--stations", type=int, default=400, help="of all regions together")
    parser.add_argument("--drones", type=int, default=400, help="of all regions together")
    parser.add_argument("--rate-per-s", type=float, default=6.0, help="of all regions together")
    parser.add_argument("--seconds", type=float, default=40.0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--routing", action="store_true", help="of a hundred cells")
    asked = parser.parse_args(arguments)
    command = shlex.join(["python", "-m", "skyway_lab", "cells", *arguments])
    print(f"`{command}`: {Machine.here().as_text()}.\n", flush=True)
    if asked.routing:
        counts = (1, 10, 100)
        rows = asyncio.run(routing_rows(counts))
        columns = ("processor ms of the gateway", *(f"{each} cells" for each in counts))
        print(Table("cells-routing", "Way to a cell.", columns, rows).as_markdown())
        return 0
    costs = list[Cost]()
    for number in range(asked.rounds):
        burst = Burst(
            storage=asked.storage,
            stations=asked.stations,
            drones=asked.drones,
            providers=4,
            rate_per_s=asked.rate_per_s,
            seconds=asked.seconds,
            clock_rate=1.0,
            agents=1,
            longest_wait_s=30.0,
            seed=asked.seed + number,
        )
        if number == 0:
            print(f"{asked.regions} regions; {burst.as_text()}\n", flush=True)
        # The order changes from round to round, because a machine may become slower with time.
        for cells in (0, asked.regions) if number % 2 == 0 else (asked.regions, 0):
            with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:  # as the services
                costs.append(runner.run(run(burst, regions=asked.regions, cells=cells)))
            print(_row(costs[-1]), file=sys.stderr, flush=True)
    columns = (
        "cells",
        *(f"{each}, ms" for each in SERVICES),
        "together, ms",
        "idle cores",
        "dispatched",
        "check",
    )
    print(
        Table("cells", "Processor time of a delivery.", columns, [*map(_row, costs)]).as_markdown()
    )
    without, with_cells = (_medians(costs, cells) for cells in (0, asked.regions))
    ratios = ", ".join(
        f"{name} {with_cells[name] / without[name]:.2f}" for name in (*SERVICES, "together")
    )
    print(f"\nMedians with {asked.regions} cells, as multiples of one composition: {ratios}")
    return 0 if all(each.violations.startswith("0 violations") for each in costs) else 1


def _row(cost: Cost) -> tuple[str, ...]:
    each = (f"{cost.each_ms[name]:.1f}" for name in SERVICES)
    return (
        str(cost.cells),
        *each,
        f"{cost.all_ms:.1f}",
        f"{cost.idle_cores:.2f}",
        str(cost.dispatched),
        cost.violations,
    )


def _medians(costs: list[Cost], cells: int) -> dict[str, float]:
    chosen = [each for each in costs if each.cells == cells]
    medians = {n: statistics.median(each.each_ms[n] for each in chosen) for n in SERVICES}
    return {**medians, "together": statistics.median(each.all_ms for each in chosen)}


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
