"""`python -m skyway_lab growth`: run each size, print the cost of a delivery and its growth."""

import asyncio
import shlex
import sys
from collections.abc import Mapping
from typing import Final

import uvloop
from skyway_lab.benchmarks.growth.run import run
from skyway_lab.benchmarks.growth.sizes import Growth, Size, read_growth
from skyway_lab.benchmarks.load.figures import Outcome
from skyway_lab.benchmarks.planner.machine import Machine
from skyway_lab.benchmarks.planner.table import Table

#: The processes whose cost is compared; agents and brokers store no deliveries.
_OURS: Final = ("gateway", "composition", "registry", "postgresql")

#: A run with fewer dispatches says too little.
_LEAST: Final = 20


def main(arguments: list[str]) -> int:
    """Run all sizes, each in a system of its own."""
    growth = read_growth(arguments)
    command = shlex.join(["python", "-m", "skyway_lab", "growth", *arguments])
    print(f"`{command}`: {Machine.here().as_text()}.\n\n{growth.load.as_text()}\n", flush=True)
    smallest = _costs(growth, growth.smallest)
    rows = [_row("the smallest", growth.smallest, smallest, smallest)]
    for kind, size in growth.grown():
        rows.append(_row(kind, size, _costs(growth, size), smallest))
    header = ("grown", "size", *(f"{name}, ms" for name in _OURS), "all, ms", "growth")
    caption = "Processor time for each dispatch, without what the processes take while idle."
    print(Table("growth", caption, header, rows).as_markdown(), flush=True)
    return 0


def _costs(growth: Growth, size: Size) -> Mapping[str, float]:
    """By process: milliseconds for each dispatch."""
    print(f"{size.as_text()} ...", flush=True)
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:  # as the services
        outcome = runner.run(run(size, growth.load))
    dispatched = outcome.followed.count(outcome.burst.counted_event)
    if dispatched < _LEAST:
        print(f"  only {dispatched} dispatches: take a higher rate or more drones", flush=True)
    costs = _each_ms(outcome)
    each_ms = ", ".join(f"{name} {each:.1f}" for name, each in costs.items())
    print(f"  {dispatched} dispatches; ms each: {each_ms}", flush=True)
    return costs


def _each_ms(outcome: Outcome) -> dict[str, float]:
    usage, costs = outcome.usage, dict.fromkeys(_OURS, 0.0)
    dispatched = max(1, outcome.followed.count(outcome.burst.counted_event))
    for name, busy_s in usage.busy.seconds.items():
        idle = usage.idle.seconds.get(name, 0.0) / usage.idle_s
        own = name.split(" ", 1)[0]
        if own in costs:
            costs[own] += max(0.0, busy_s - idle * usage.busy_s) / dispatched * 1e3
    return costs


def _row(
    kind: str, size: Size, costs: Mapping[str, float], smallest: Mapping[str, float]
) -> tuple[str, ...]:
    total, least = sum(costs.values()), sum(smallest.values())
    growth = f"{100 * (total / least - 1):+.0f} %" if least else ""
    return (
        kind,
        size.as_text(),
        *(f"{costs[name]:.1f}" for name in _OURS),
        f"{total:.1f}",
        growth,
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
